#include "tcl/traceCommand.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "bus/call.h"
#include "bus/requestText.h"
#include "bus/span.h"
#include "comm/lateTrace.h"
#include "tcl/commCommands.h"
#include "tcl/convert.h"
#include "tcl/tclService.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kParent{Severity::error, "REQUEST SYNTAX", 0, "-parent {} is no W3C traceparent: 00-<32 hex digits>-<16 hex digits>-<2 hex digits>"};
const Prototype kLate{Severity::error, "REQUEST SYNTAX", 0, "-late {} is no time: 0 to 600000 ms"};

Tcl_Obj* microseconds(std::int64_t t) { return Tcl_NewDoubleObj(double(t) / 1e3); }

// A span as a dict.
Tcl_Obj* treeOf(const Span& s) {
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
    const std::int64_t whole = s.lasted();
    static constexpr const char* kKinds[] = {"call", "oneway", "event", "listener"};
    const bool untold = s.kind == Span::Kind::call ? s.sent && !s.answered : s.told < s.heard;
    put("name", newText(s.name));
    put("kind", newText(kKinds[int(s.kind)]));
    put("method", newText(toText(s.method)));
    if (!s.event.empty()) put("event", newText(s.event));
    put("state", newText(!s.finished || s.underway ? "underway" : s.failed ? "failed" : untold ? "untold" : "done"));
    put("offset", microseconds(s.offset));
    put("whole", microseconds(whole));
    put("waiting", microseconds(s.waited + s.farWaited));
    put("running", microseconds(s.running()));
    put("wire", microseconds(s.sent ? std::max<std::int64_t>(whole - s.waited - s.far, 0) : 0));
    if (s.heard > s.told) put("untold", Tcl_NewWideIntObj(s.heard - s.told));
    if (!s.error.empty()) put("error", newText(s.error));
    if (s.lost > 0) put("more", Tcl_NewWideIntObj(s.lost));
    Tcl_Obj* calls = Tcl_NewListObj(0, nullptr);
    for (auto& c : s.calls) Tcl_ListObjAppendElement(nullptr, calls, treeOf(*c));
    put("calls", calls);
    return dict;
}

struct Wanted {
    TraceNumber number;
    std::int64_t late = 500;                    // [ms] how long to ask for what no reply brings
    std::vector<std::string> ask;               // daemons, beside those that are known
};

// Its options. False: they make no sense.
bool readOptions(int objc, Tcl_Obj* const objv[], Wanted& wanted) {
    if (objc % 2 != 0) return false;
    for (int at = 1; at + 1 < objc; at += 2) {
        const std::string option = toUtf8(objv[at]), value = toUtf8(objv[at + 1]);
        if (option == "-parent") {
            wanted.number = TraceNumber::parse(value);
            if (!wanted.number) fail(kParent, value);
        } else if (option == "-late") {
            if (!parseNumber(value, wanted.late) || wanted.late < 0 || wanted.late > 600'000) fail(kLate, value);
        } else if (option == "-ask") {
            wanted.ask = listStrings(objv[at + 1]);
        } else {
            return false;
        }
    }
    return true;
}

TraceNumber numberOfEnvironment() {
    const char* variable = std::getenv("TRACEPARENT");         // a bad one is ignored, as W3C has it
    const TraceNumber given = variable ? TraceNumber::parse(variable) : TraceNumber();
    return given ? given : TraceNumber::random();
}

// The method of a Tcl service that has said sorma::trace makes its calls in a context of its own.
class WithSpan {
public:
    WithSpan(Interpreter& i, const SpanPointer& span) {
        auto found = i.runs.find(std::string(view(coroutineName(i))));
        if (found == i.runs.end() || !found->second->context) return;
        kept_ = found->second->context;
        outer_ = std::exchange(kept_->span, span);
    }
    ~WithSpan() {
        if (kept_) kept_->span = outer_;
    }
    WithSpan(const WithSpan&) = delete;
    WithSpan& operator=(const WithSpan&) = delete;

private:
    KeptCallPointer kept_;
    SpanPointer outer_;
};

// sorma::trace                                   the traceparent for what the present request calls, or empty
// sorma::trace ?option value ...? script         dict  trace code result options tree
// Other words                                    Tcl's own trace: code in our namespace, such as a snit type, finds this one first
int TraceObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc == 1) {
            InCoroutine context(i, coroutineName(i));
            Tcl_SetObjResult(interp, newText(traceparent()));
            return TCL_OK;
        }
        if (objc > 2 && !view(objv[1]).starts_with('-')) {
            Obj words(Tcl_NewListObj(objc, objv));
            Tcl_Obj* name = newText("::trace");
            Tcl_ListObjReplace(nullptr, words, 0, 1, 1, &name);
            return Tcl_EvalObjEx(interp, words, TCL_EVAL_DIRECT);
        }
        Wanted wanted;
        if (!readOptions(objc, objv, wanted)) return Tcl_WrongNumArgs(interp, 1, objv, "?-parent traceparent? ?-late ms? ?-ask daemons? script"), TCL_ERROR;
        Obj script(objv[objc - 1]);
        auto root = Span::root(wanted.number ? wanted.number : numberOfEnvironment(), i.sorm, "script", Method::exec, monotonicNow());
        int code;
        {
            static const ClientPointer self;
            static const std::string nobody;
            const CallContext* outer = CallContext::current();
            const ClientPointer client = outer ? outer->client : self;
            const std::string behalf = outer ? outer->behalf : nobody;
            CallContext context(client, CallContext::currentDeadline(), CallContext::currentRequest(), behalf);
            context.span = root;
            const WithSpan also(i, root);
            code = Tcl_EvalObjEx(interp, objv[objc - 1], 0);
        }
        if (i.closing()) return TCL_ERROR;
        root->finish();
        Obj result(Tcl_GetObjResult(interp));
        Tcl_Obj* options = Tcl_GetReturnOptions(interp, code);
        if (wanted.late > 0) gatherLate(commOf(i), i.sorm, *root, Deadline::in(wanted.late), wanted.ask);
        Tcl_Obj* dict = Tcl_NewDictObj();
        auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
        put("trace", newText(traceparent(root->share->number)));
        put("code", Tcl_NewIntObj(code));
        put("result", result);
        put("options", options);
        put("tree", treeOf(*root));
        Tcl_SetObjResult(interp, dict);
        return TCL_OK;
    });
}

}  // namespace

void initTraceCommand(Interpreter& i) { i.define("trace", TraceObjCmd); }

}  // namespace sorma
