#include "tcl/waiting.h"

#include <poll.h>

#include <algorithm>
#include <memory>

namespace sorma {

namespace {

// A command that waits in a coroutine.
struct Waiter {
    Interpreter& interpreter;
    std::vector<Future> futures;
    bool all;
    Deadline deadline;
    std::function<int()> finish;
    Obj coroutine;
    bool kept;                          // the futures go on when the coroutine is deleted
    Timer timer = {};
    bool resuming = false;              // the loop is about to go on with the coroutine
    Tcl_Obj* words[1] = {};             // of yield: Tcl looks at them when we have returned
};
using WaiterPointer = std::shared_ptr<Waiter>;

bool isOver(const std::vector<Future>& futures, bool all, Deadline deadline) {
    auto done = [](const Future& f) { return f.done(); };
    bool there = all ? std::all_of(futures.begin(), futures.end(), done) : std::any_of(futures.begin(), futures.end(), done);
    return there || deadline.passed();
}

// From the loop: the coroutine finds its answers.
void resume(const std::weak_ptr<Waiter>& weak) {
    auto w = weak.lock();
    if (!w || w->resuming || w->interpreter.closing()) return;
    w->resuming = true;
    auto go = [weak] {
        auto w = weak.lock();
        if (!w || w->interpreter.closing()) return;
        w->resuming = false;
        Interpreter& i = w->interpreter;
        Interpreter::Kept kept(i);
        Tcl_Obj* name = w->coroutine;
        Obj keep(name);
        if (!Tcl_FindCommand(i.interp, Tcl_GetString(name), nullptr, TCL_GLOBAL_ONLY)) return;
        w.reset();
        if (Tcl_EvalObjv(i.interp, 1, &name, TCL_EVAL_GLOBAL) != TCL_OK && !i.closing()) Tcl_BackgroundException(i.interp, TCL_ERROR);
    };
    w->interpreter.sorm.mailbox()->post(go);
}

bool cannotYield(Tcl_Interp* interp, int code) {
    if (code != TCL_ERROR) return false;
    Obj options(Tcl_GetReturnOptions(interp, code));
    Obj key(Tcl_NewStringObj("-errorcode", -1));
    Tcl_Obj* value = nullptr;
    Tcl_DictObjGet(nullptr, options, key, &value);
    if (!value) return false;
    std::string_view text = view(value);
    return text == "TCL COROUTINE CANT_YIELD" || text == "TCL COROUTINE ILLEGAL_YIELD";
}

// Block: drive the connections that bring answers, and run the event loop only for futures of objects of this process.
void block(Interpreter& i, const std::vector<Future>& futures, bool all, Deadline deadline) {
    if (all) {
        for (auto& f : futures) {
            try {
                if (!f.done()) f.wait(deadline);
            } catch (const Error&) {            // finish() raises the error
            }
            if (i.closing() || deadline.passed()) return;
        }
        return;
    }
    while (!isOver(futures, all, deadline) && !i.closing()) {
        constexpr std::int64_t kLook = 20;      // [ms] no longer without a look at all of them
        std::vector<pollfd> descriptors;                // of each future; -1: not to be waited for
        bool local = false, remote = false, now = false;
        for (auto& f : futures) {
            auto* carrier = f.pending()->carrier;
            descriptors.push_back({carrier ? carrier->descriptor() : -1, POLLIN, 0});
            if (!carrier) local = true;
            else if (descriptors.back().fd >= 0) remote = true;
            else now = true;
        }
        if (local) i.sorm.turn(Deadline::in(now ? 0 : kLook).earlier(deadline));
        const int patience = local || now ? 0 : int(std::min<std::int64_t>(deadline.left() / 1'000'000 + 1, kLook));
        if (remote) poll(descriptors.data(), nfds_t(descriptors.size()), patience);
        for (std::size_t k = 0; k < futures.size(); ++k) {
            auto& p = *futures[k].pending();
            if (p.answered() || !p.carrier) continue;
            // One that reads a line takes the answers of all of its futures.
            const bool ready = descriptors[k].fd < 0 || descriptors[k].revents;
            if (p.deadline.passed()) p.cancel(p.carrier->overdue(p));
            else if (ready) p.carrier->drive(p, Deadline::in(1).earlier(deadline));
        }
    }
}

int yieldNow(const WaiterPointer& w);

int afterYield(ClientData data[], Tcl_Interp* interp, int code) {
    std::unique_ptr<WaiterPointer> holder(static_cast<WaiterPointer*>(data[0]));
    WaiterPointer w = *holder;
    Interpreter& i = w->interpreter;
    if (Tcl_InterpDeleted(interp)) return TCL_ERROR;
    Interpreter::Entered entered(i);
    bool over = isOver(w->futures, w->all, w->deadline);
    if (!over && code == TCL_OK) return yieldNow(w);    // other code has called the coroutine
    if (!over && cannotYield(interp, code)) {
        block(i, w->futures, w->all, w->deadline);
        if (i.closing()) return TCL_ERROR;
        over = true;
    }
    w->timer.cancel();
    if (!over) {                                        // the coroutine is being deleted
        for (auto& f : w->futures)
            if (!w->kept) f.cancel();
        return code;
    }
    Tcl_ResetResult(interp);
    return w->finish();
}

int yieldNow(const WaiterPointer& w) {
    Tcl_Interp* interp = w->interpreter.interp;
    Tcl_NRAddCallback(interp, afterYield, new WaiterPointer(w), nullptr, nullptr, nullptr);
    w->words[0] = w->interpreter.constants.yield;
    return Tcl_NREvalObjv(interp, 1, w->words, 0);
}

}  // namespace

Obj coroutineName(Interpreter& i) {
    Tcl_Obj* word = i.constants.infoCoroutine;
    // Not evaluated: between two commands Tcl looks for interrupts, and one that came just now would be taken for the answer.
    Tcl_CmdInfo info;
    if (!Tcl_GetCommandInfo(i.interp, Tcl_GetString(word), &info) || !info.objProc ||
        info.objProc(info.objClientData, i.interp, 1, &word) != TCL_OK) {
        Tcl_ResetResult(i.interp);
        return i.constants.empty;
    }
    Obj name(Tcl_GetObjResult(i.interp));
    Tcl_ResetResult(i.interp);
    return name;
}

int waitThen(Interpreter& i, std::vector<Future> futures, bool all, Deadline deadline, std::function<int()> finish, bool kept) {
    if (isOver(futures, all, deadline)) return finish();
    Obj coroutine = coroutineName(i);
    if (view(coroutine).empty()) {
        block(i, futures, all, deadline);
        if (i.closing()) return TCL_ERROR;
        Tcl_ResetResult(i.interp);
        return finish();
    }
    auto w = std::make_shared<Waiter>(Waiter{i, std::move(futures), all, deadline, std::move(finish), coroutine, kept});
    std::weak_ptr<Waiter> weak = w;
    for (auto& f : w->futures)
        f.pending()->whenAnswered([weak] {
            if (auto w = weak.lock(); w && isOver(w->futures, w->all, w->deadline)) resume(weak);
        });
    if (!deadline.none())
        w->timer = i.sorm.loop().after(deadline.when(), [weak] {
            resume(weak);
        });
    return yieldNow(w);
}

}  // namespace sorma
