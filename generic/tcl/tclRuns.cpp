#include "tcl/tclServiceParts.h"

#include <algorithm>

#include "tcl/tclPieces.h"
#include "tcl/waiting.h"

namespace sorma {

using namespace tcloo;

namespace {

const Prototype kNothingToCancel{Severity::error, "SERVICE FAILED", 0,
    "sorma::atCancel: no request is being executed here; use it in exec, selftest, an action or an "
    "inspection of a service class, outside of coroutines of your own"};

// sorma::tcloo::Done result options: the EXEC of this coroutine has come to its end.
int DoneObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 4) return Tcl_WrongNumArgs(interp, 1, objv, "coroutine result options"), TCL_ERROR;
    auto found = i.runs.find(std::string(view(objv[1])));
    if (found == i.runs.end()) return TCL_OK;
    Interpreter::Entered entered(i);
    auto run = std::move(found->second);
    i.runs.erase(found);
    run->done = true;
    run->result = objv[2];
    run->options = objv[3];
    Obj key(Tcl_NewStringObj("-code", -1));
    Tcl_Obj* code = nullptr;
    if (Tcl_DictObjGet(nullptr, objv[3], key, &code) != TCL_OK || !code || Tcl_GetIntFromObj(nullptr, code, &run->code) != TCL_OK)
        run->code = TCL_ERROR;
    if (run->code == TCL_RETURN) run->code = TCL_OK;
    if (run->pieces) return run->pieces->came(), TCL_OK;
    if (!run->reply) return TCL_OK;                 // exec() is on the stack, and sees to it
    try {
        Message& m = run->reply.message();
        if (run->service) run->service->answer(*run, m);
        run->reply.complete();
    } catch (const Error& e) {
        run->reply.fail(e);
    } catch (const std::exception& e) {
        run->reply.fail(e);
    }
    Tcl_ResetResult(interp);
    return TCL_OK;
}

// sorma::cancelled: has the caller of this EXEC cancelled it?   sorma::atCancel script: run the script when that happens
int CancelledObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 1) return Tcl_WrongNumArgs(interp, 1, objv, nullptr), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        auto run = currentRun(i);
        bool cancelled = CallContext::currentCancelled() || (run && run->cancelled);
        Tcl_SetObjResult(interp, Tcl_NewWideIntObj(cancelled));
        return TCL_OK;
    });
}

int AtCancelObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "script"), TCL_ERROR;
    return guarded(i, objc, objv, [&] {
        auto run = currentRun(i);
        if (!run) fail(kNothingToCancel);
        run->atCancel = Obj(objv[1]);
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

}  // namespace

std::shared_ptr<TclRun> tcloo::currentRun(Interpreter& i) {
    if (i.runs.empty()) return nullptr;
    auto found = i.runs.find(toUtf8(coroutineName(i)));
    return found == i.runs.end() ? nullptr : found->second;
}

Interpreter::Running runningNow(Interpreter& i) {
    KeepState keep(i.interp);
    auto run = currentRun(i);
    return run ? Interpreter::Running{run->service, &run->said} : i.running;
}

InCoroutine::InCoroutine(Interpreter& i, Tcl_Obj* coroutine) {
    auto found = i.runs.empty() ? i.runs.end() : i.runs.find(std::string(view(coroutine)));
    if (found == i.runs.end()) return;
    run_ = found->second;
    new (context_) CallContext(run_->context);
}

InCoroutine::~InCoroutine() {
    if (run_) reinterpret_cast<CallContext*>(context_)->~CallContext();
}

void TclService::exec(Message& m) {
    Interpreter& i = interpreter_;
    auto run = std::make_shared<TclRun>();
    Obj command[] = {i.constants.runExec, my_, messageDict(i.constants, m)};
    begin(run, command, m);
}

void TclService::act(const std::string& method, Args args, Message& m) {
    static constexpr const char* kRun = "::sorma::tcloo::RunMethod";
    auto run = std::make_shared<TclRun>();
    run->isExec = false;
    run->settles = method == "settle";
    std::vector<Obj> command{str(kRun), my_, str(method)};
    for (auto& word : args) command.emplace_back(str(word));
    begin(run, command, m);
}

std::string TclService::run(const std::shared_ptr<TclRun>& run, std::span<const Obj> command) {
    Interpreter& i = interpreter_;
    if (i.closing()) fail(kInterpGone, name());
    if (!object_) fail(kObjectGone, name());
    run->service = this;
    run->keep = Reference(this);
    if (!run->context) run->context = CallContext::keep();
    std::string coroutine = "::sorma::co::" + std::to_string(++i.lastRun);
    i.runs.emplace(coroutine, run);
    int code;
    {
        Executing executing(i, {this, &run->said});
        constexpr std::size_t kOnStack = 8;
        Obj name = str(coroutine);
        Tcl_Obj* few[kOnStack];
        std::vector<Tcl_Obj*> many;
        Tcl_Obj** objv = few;
        if (command.size() + 2 > kOnStack) many.resize(command.size() + 2), objv = many.data();
        objv[0] = i.constants.coroutine;
        objv[1] = name;
        std::copy(command.begin(), command.end(), objv + 2);
        code = Tcl_EvalObjv(i.interp, int(command.size() + 2), objv, TCL_EVAL_GLOBAL);
        if (i.closing()) fail(kInterpGone, this->name());
    }
    if (code != TCL_OK && !run->done) {     // there is no coroutine, or it was deleted
        i.runs.erase(coroutine);
        Trail trail = run->said.trail;
        trail.append(trailOfTclError(i, code, name(), type()));
        throw Error(std::move(trail));
    }
    Tcl_ResetResult(i.interp);
    return coroutine;
}

// In a coroutine of its own. When it has not come to its end, the answer is given later, by Done.
void TclService::begin(const std::shared_ptr<TclRun>& run, std::span<const Obj> command, Message& m) {
    this->run(run, command);
    if (run->done) return answer(*run, m);
    run->reply = later(m);
    run->reply.onCancel([run] {
        run->cancelled = true;
        if (!run->atCancel || !run->service || run->service->interpreter().closing()) return;
        runScript(run->service->interpreter(), std::exchange(run->atCancel, Obj()));
    });
}

void TclService::answer(TclRun& run, Message& m) const {
    Interpreter& i = interpreter_;
    if (run.code == TCL_OK && run.isExec) {
        m.clear();
        m.trail = std::move(run.said.trail);
        return readResult(run.result, name(), m);
    }
    if (run.code == TCL_OK) {
        m.trail.append(run.said.trail);
        std::string said = toUtf8(run.result);
        if (!said.empty() && !m.text.empty()) m.text += '\n';
        m.text += said;
        return;
    }
    Trail trail = std::move(run.said.trail);
    Tcl_SetObjResult(i.interp, run.result);
    Tcl_SetReturnOptions(i.interp, run.options);
    trail.append(trailOfTclError(i, run.code, name(), type()));
    throw Error(std::move(trail));
}

void tcloo::initRuns(Interpreter& i) {
    i.define("cancelled", CancelledObjCmd);
    i.define("atCancel", AtCancelObjCmd);
    Tcl_CreateObjCommand(i.interp, "::sorma::tcloo::Done", DoneObjCmd, &i, nullptr);
    initPieces(i);
}

}  // namespace sorma
