#include "edit/signals.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <thread>
#include <utility>

namespace sorma::edit {

namespace {

constexpr std::array kNumbers{SIGINT, SIGWINCH, SIGCONT, SIGTERM, SIGHUP};

// Data that a signal handler may use.
volatile int bell = -1;
std::atomic<bool> sawInterrupt, sawResize, sawContinue;
static_assert(std::atomic<bool>::is_always_lock_free);      // or it could not be used by a signal handler
termios terminal;
volatile std::sig_atomic_t terminalKept = 0;
std::array<struct sigaction, kNumbers.size()> before;

void ring() {
    std::uint64_t one = 1;
    ssize_t ignored = write(bell, &one, sizeof one);
    (void)ignored;
}

void onSignal(int number) {
    int saved = errno;
    if (number == SIGTERM || number == SIGHUP) {
        // A daemon with a prompt has a handler of its own, which ends it in order.
        for (std::size_t k = 0; k < kNumbers.size(); ++k)
            if (kNumbers[k] == number && before[k].sa_handler != SIG_DFL && before[k].sa_handler != SIG_IGN) {
                before[k].sa_handler(number);
                errno = saved;
                return;
            }
        if (terminalKept) tcsetattr(0, TCSANOW, &terminal);
        signal(number, SIG_DFL);
        raise(number);
    } else {
        (number == SIGINT ? sawInterrupt : number == SIGWINCH ? sawResize : sawContinue) = true;
        ring();
    }
    errno = saved;
}

}  // namespace

struct Signals::Watcher {
    std::thread thread;
    std::atomic<bool> ends{false};
    std::atomic<bool> pending{false};   // an interrupt that interrupted() has not returned yet
    std::atomic<bool> overdue{false};   // it has waited for long
};

Signals::Signals(Tcl_Interp* interp) : interp_(interp), token_(Tcl_AsyncCreate(onMark, this)), watcher_(new Watcher) {
    bell = eventfd(0, EFD_CLOEXEC);
    // The thread gets none of them itself: its read would be interrupted for nothing.
    sigset_t all, old;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    watcher_->thread = std::thread([this] { watch(); });
    pthread_sigmask(SIG_SETMASK, &old, nullptr);
    for (std::size_t k = 0; k < kNumbers.size(); ++k) {
        struct sigaction action{};
        action.sa_handler = onSignal;
        action.sa_flags = SA_RESTART;
        sigaction(kNumbers[k], nullptr, &before[k]);
        if (before[k].sa_handler != SIG_IGN) sigaction(kNumbers[k], &action, nullptr);
    }
}

Signals::~Signals() {
    for (std::size_t k = 0; k < kNumbers.size(); ++k) sigaction(kNumbers[k], &before[k], nullptr);
    watcher_->ends = true;
    ring();
    watcher_->thread.join();
    delete watcher_;
    close(bell);
    bell = -1;
    Tcl_AsyncDelete(token_);
}

void Signals::watch() {
    while (true) {
        pollfd rung{bell, POLLIN, 0};
        int came = poll(&rung, 1, sawInterrupt || watcher_->pending ? kPatience : -1);
        if (came > 0) {
            std::uint64_t count;
            if (read(bell, &count, sizeof count) < 0 && errno != EINTR) return;
        } else if (came == 0) {
            watcher_->overdue = bool(watcher_->pending);
        }
        if (watcher_->ends) return;
        Tcl_AsyncMark(token_);
    }
}

// On the interpreter's thread: between two commands of a script (running), or in the event loop (null).
int Signals::onMark(ClientData data, Tcl_Interp* running, int code) {
    auto& s = *static_cast<Signals*>(data);
    auto& w = *s.watcher_;
    for (auto* child : std::exchange(s.spared_, {})) Tcl_Canceled(child, 0);
    if (sawInterrupt.exchange(false)) w.pending = true;
    bool overdue = w.overdue.exchange(false);
    if (!w.pending || (s.waiting_ > 0 && !overdue)) return code;
    if (running == s.interp_) {
        w.pending = false;
        Tcl_SetObjResult(running, Tcl_NewStringObj("interrupted", -1));
        Tcl_SetErrorCode(running, "TCL", "CANCEL", "interrupted", nullptr);
        return TCL_ERROR;
    }
    if (!running) {
        w.pending = false;
        s.cancelLoop();
    }
    return code;                        // another interpreter's script: once more after kPatience
}

// Only Tcl_CancelEval ends vwait. It cancels the children of the interpreter as well, and one that is idle would fail
// at the next thing that it is asked. Tcl does it when we have returned, and comes back to us as we have marked ourselves.
void Signals::cancelLoop() {
    Tcl_InterpState state = Tcl_SaveInterpState(interp_, TCL_OK);
    Tcl_Size n = 0;
    Tcl_Obj** names = nullptr;
    if (Tcl_EvalEx(interp_, "::interp slaves", -1, TCL_EVAL_GLOBAL) == TCL_OK) {
        Obj list(Tcl_GetObjResult(interp_));
        Tcl_ListObjGetElements(nullptr, list, &n, &names);
        for (Tcl_Size k = 0; k < n; ++k)
            if (Tcl_Interp* child = Tcl_GetChild(interp_, Tcl_GetString(names[k]))) spared_.push_back(child);
    }
    Tcl_RestoreInterpState(interp_, state);
    Tcl_CancelEval(interp_, Tcl_NewStringObj("interrupted", -1), nullptr, 0);
    Tcl_AsyncMark(token_);
}

bool Signals::interrupted() {
    bool pending = watcher_->pending.exchange(false);
    return Tcl_Canceled(interp_, 0) == TCL_ERROR || pending;
}
bool Signals::resized() { return sawResize.exchange(false); }
bool Signals::continued() { return sawContinue.exchange(false); }

void Signals::keepTerminal() {
    terminalKept = 0;
    if (tcgetattr(0, &terminal) == 0) terminalKept = 1;
}

}  // namespace sorma::edit
