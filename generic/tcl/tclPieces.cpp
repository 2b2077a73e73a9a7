#include "tcl/tclPieces.h"

#include <utility>

#include "bus/atEnd.h"
#include "bus/kept.h"
#include "tcl/tclServiceParts.h"

namespace sorma {

using namespace tcloo;

namespace {

const Prototype kNoStream{Severity::error, "STREAM WANTED", 1, "{}: its reply comes in pieces: read it with sorma::stream {{{} EXEC ...}}"};
const Prototype kNotRunning{Severity::error, "SERVICE FAILED", 0, "sorma::piece works only in exec of a service class, outside of coroutines of your own"};

constexpr std::size_t kCoroutine = 64 << 10;        // [bytes] what one is charged with

// sorma::tcloo::Give piece, sorma::tcloo::Wanted: see sorma::piece
int GiveObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return wrongArgs(interp, objv, "piece");
        auto run = currentRun(i);
        if (!run || !run->isExec) fail(kNotRunning);
        if (!run->pieces) fail(kNoStream, run->service->name(), run->service->name());
        run->pieces->give(objv[1]);
        Tcl_ResetResult(interp);
        return TCL_OK;
    });
}

int WantedObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        auto run = currentRun(i);
        Tcl_SetObjResult(interp, i.constants.integer(!run || !run->pieces || run->pieces->wanted()));
        return TCL_OK;
    });
}

}  // namespace

std::unique_ptr<Pieces> TclService::inPieces(Message& m) { return std::make_unique<TclPieces>(*this, m); }

TclPieces::TclPieces(TclService& service, Message& request)
    : service_(service), message_(messageDict(service.interpreter().constants, request)) {
    run_->pieces = this;
    run_->context = CallContext::keep();
}

// A coroutine that waits is unwound.
TclPieces::~TclPieces() {
    run_->pieces = nullptr;
    run_->cancelled = true;
    if (run_->context) run_->context->cancel();
    Interpreter& i = service_.interpreter();
    if (coroutine_.empty() || run_->done || i.closing()) return;
    if (run_->atCancel) runScript(i, std::exchange(run_->atCancel, Obj()));
    if (i.closing()) return;
    i.runs.erase(coroutine_);
    Tcl_DeleteCommand(i.interp, coroutine_.c_str());
}

std::size_t TclPieces::heap() const { return kCoroutine + heapOf(piece_) + (rest_ ? rest_->heap() : 0); }

bool TclPieces::next(Message& piece, std::size_t most) {
    if (!has_ && !run_->done) goOn();
    if (std::exchange(has_, false)) return piece.swap(piece_), piece_.reset(), true;
    if (!run_->done) return false;
    if (!rest_) {
        Message last;
        service_.answer(*run_, last);
        rest_ = piecesOf(std::move(last));
    }
    return rest_->next(piece, most);
}

// Until it gives a piece, ends, or waits for something else.
void TclPieces::goOn() {
    Interpreter& i = service_.interpreter();
    if (i.closing()) fail(kInterpGone, service_.name());
    going_ = true;
    const AtEnd end([this] { going_ = false; });
    if (coroutine_.empty()) {
        Obj command[] = {i.constants.runExec, service_.my_, std::exchange(message_, Obj())};
        coroutine_ = service_.run(run_, command);
        return;
    }
    if (!std::exchange(waits_, false)) return;
    Executing executing(i, {&service_, &run_->said});
    Obj name(str(coroutine_));
    Tcl_Obj* objv[] = {name};
    Tcl_EvalObjv(i.interp, 1, objv, TCL_EVAL_GLOBAL);
    if (i.closing()) fail(kInterpGone, service_.name());
    Tcl_ResetResult(i.interp);
}

void TclPieces::give(Tcl_Obj* dict) {
    piece_.reset();
    readResult(dict, service_.name(), piece_);
    if (isEnd(piece_)) return;
    piece_.trail.append(std::exchange(run_->said.trail, {}));
    has_ = waits_ = true;
    came();
}

void TclPieces::came() {
    if (!going_) wake();
}

void tcloo::initPieces(Interpreter& i) {
    Tcl_CreateObjCommand(i.interp, "::sorma::tcloo::Give", GiveObjCmd, &i, nullptr);
    Tcl_CreateObjCommand(i.interp, "::sorma::tcloo::Wanted", WantedObjCmd, &i, nullptr);
}

}  // namespace sorma
