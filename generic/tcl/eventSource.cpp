#include "tcl/eventSource.h"

#include "bus/deadline.h"
#include "tcl/notifier.h"

namespace sorma {

EventSource::EventSource(Interpreter& interpreter, Comm& comm)
    : interpreter_(interpreter), comm_(comm), epoll_(comm.reactor().descriptor()),
      shared_(notifier::install(interpreter.interp, comm.sharedReactor(), [this] { serve(); })) {
    if (!shared_) Tcl_CreateFileHandler(epoll_, TCL_READABLE, readable, this);
    Tcl_CreateEventSource(enteringLoop, nullptr, this);
    comm_.trouble = [&i = interpreter_](const Entry& what) {
        if (i.closing()) return;
        KeepState keep(i.interp);
        Tcl_ResetResult(i.interp);
        Tcl_SetObjResult(i.interp, newText(what.text));
        Tcl_SetObjErrorCode(i.interp, errorCode(what));
        Tcl_BackgroundException(i.interp, TCL_ERROR);
    };
}

EventSource::~EventSource() {
    comm_.trouble = nullptr;
    Tcl_DeleteEventSource(enteringLoop, nullptr, this);
    if (shared_) notifier::release(comm_.reactor());
    else Tcl_DeleteFileHandler(epoll_);
}

// Tcl is about to wait. In the middle of a request this is a service's own event loop. Requests that the reactor has read and
// not yet served would wait for the end of that request, since no descriptor is readable for them.
void EventSource::enteringLoop(ClientData data, int) {
    auto* self = static_cast<EventSource*>(data);
    Reactor& reactor = self->comm_.reactor();
    if (reactor.polling()) self->comm_.handBack();
    if (!self->shared_) reactor.doze();
}

void EventSource::readable(ClientData data, int) { static_cast<EventSource*>(data)->serve(); }

void EventSource::serve() {
    Interpreter& interpreter = interpreter_;            // *this may end before this call does
    Interpreter::Kept kept(interpreter);
    try {
        callReactor();
    } catch (...) {
        // An error of a request is in its reply; this one is of COMM itself (no memory, no descriptors).
        if (!interpreter.closing()) {
            interpreter.raise(trailOfCurrentException("sorm"), {});
            Tcl_BackgroundException(interpreter.interp, TCL_ERROR);
        }
    }
}

void EventSource::callReactor() {
    Interpreter& interpreter = interpreter_;
    Reactor& reactor = comm_.reactor();
    std::int64_t start = monotonicNow();
    reactor.seen(start);
    // A service that runs the event loop waits for something of its own. Serve the requests that are there, and return.
    bool nested = reactor.polling();
    std::int64_t linger = nested || comm_.servers().empty() ? 0 : comm_.settings.linger * 1000;
    std::int64_t end = start + 2 * linger;
    if (shared_) {
        // The end sets a timer, which wakes us in the middle of our caller's turn. It is there for a script that waits for a variable
        // (vwait) which a request sets. Where no script has run, it may come seldom.
        const unsigned before = interpreter.entries;
        do {
            reactor.callGathered();
            end = start + (interpreter.entries == before ? 20 : 2) * linger;
        } while (linger > 0 && !interpreter.closing() && reactor.seen() < end && notifier::goOn(end));
        return;
    }
    // Nothing may be there: the reactor's timer goes off once more after a linger that a request cut short.
    bool more = reactor.poll(0) > 0 && linger > 0;
    // Each request tells the reactor the time; reading the clock here as well would be a hundredth of a call.
    while (more && !interpreter.closing() && reactor.seen() < end) more = reactor.pollUntil(reactor.seen() + linger) > 0;
}

}  // namespace sorma
