#include "tcl/traceCommand.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "bus/call.h"
#include "bus/span.h"
#include "tcl/tclService.h"
#include "tcl/waiting.h"

namespace sorma {

namespace {

const Prototype kParent{Severity::error, "REQUEST SYNTAX", 0, "-parent {} is no W3C traceparent: 00-<32 hex digits>-<16 hex digits>-<2 hex digits>"};

std::string parentText(TraceNumber number) { return "00-" + number.toText() + "-" + TraceNumber::random().toText().substr(0, 16) + "-01"; }

Tcl_Obj* microseconds(std::int64_t t) { return Tcl_NewDoubleObj(double(t) / 1e3); }

// A span as a dict.
Tcl_Obj* treeOf(const Span& s) {
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
    const std::int64_t whole = s.lasted();
    put("name", newText(s.name));
    put("method", newText(toText(s.method)));
    put("state", newText(!s.finished || s.underway ? "underway" : s.failed ? "failed" : s.sent && !s.answered ? "untold" : "done"));
    put("offset", microseconds(s.offset));
    put("whole", microseconds(whole));
    put("waiting", microseconds(s.waited + s.farWaited));
    put("running", microseconds(s.running()));
    put("wire", microseconds(s.sent ? std::max<std::int64_t>(whole - s.waited - s.far, 0) : 0));
    if (!s.error.empty()) put("error", newText(s.error));
    if (s.lost > 0) put("more", Tcl_NewWideIntObj(s.lost));
    Tcl_Obj* calls = Tcl_NewListObj(0, nullptr);
    for (auto& c : s.calls) Tcl_ListObjAppendElement(nullptr, calls, treeOf(*c));
    put("calls", calls);
    return dict;
}

TraceNumber numberFor(int objc, Tcl_Obj* const objv[]) {
    if (objc == 4) {
        const std::string parent = toUtf8(objv[2]);
        const TraceNumber given = TraceNumber::parse(parent);
        if (!given) fail(kParent, parent);
        return given;
    }
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
// sorma::trace ?-parent traceparent? script      dict  trace code result options tree
// Other words                                    Tcl's own trace: code in our namespace, such as a snit type, finds this one first
int TraceObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc == 1) {
            CallContext* context = CallContext::current();
            if (context && context->span) Tcl_SetObjResult(interp, newText(parentText(context->span->share->number)));
            else Tcl_ResetResult(interp);
            return TCL_OK;
        }
        if (objc > 2 && !view(objv[1]).starts_with('-')) {
            Obj words(Tcl_NewListObj(objc, objv));
            Tcl_Obj* name = newText("::trace");
            Tcl_ListObjReplace(nullptr, words, 0, 1, 1, &name);
            return Tcl_EvalObjEx(interp, words, TCL_EVAL_DIRECT);
        }
        if (objc != 2 && !(objc == 4 && view(objv[1]) == "-parent")) return Tcl_WrongNumArgs(interp, 1, objv, "?-parent traceparent? script"), TCL_ERROR;
        Obj script(objv[objc - 1]);
        auto root = Span::root(numberFor(objc, objv), i.sorm, "script", Method::exec, monotonicNow());
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
        Tcl_Obj* options = Tcl_GetReturnOptions(interp, code);
        Tcl_Obj* dict = Tcl_NewDictObj();
        auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
        put("trace", newText(parentText(root->share->number)));
        put("code", Tcl_NewIntObj(code));
        put("result", Tcl_GetObjResult(interp));
        put("options", options);
        put("tree", treeOf(*root));
        Tcl_SetObjResult(interp, dict);
        return TCL_OK;
    });
}

}  // namespace

void initTraceCommand(Interpreter& i) { i.define("trace", TraceObjCmd); }

}  // namespace sorma
