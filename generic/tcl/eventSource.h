// eventSource.h -- runs COMM's reactor inside Tcl's event loop.
//
// Where it can, Tcl waits in the reactor's own set (tcl/notifier.h). Then a daemon that has just served a request waits for
// the next one itself, until Tcl has something to do, and for at most twice Settings::linger.
//
// Elsewhere Tcl watches the set's descriptor. Tcl 8.6 then hands every wait to a helper thread, which costs as much as two
// calls. So a daemon waits for the next request itself, for at most Settings::linger. At the latest after twice that time it
// returns to Tcl, so that timers, file events and idle callbacks get their share. When no request comes, Tcl waits as always.
//
// Threads: the interpreter's.
// Owner:   delete it before the Comm.
// Errors:  what a request throws is in its reply. An error of COMM itself (no memory, no descriptors) is a background error.
#pragma once

#include "comm/comm.h"
#include "tcl/interpreter.h"

namespace sorma {

class EventSource {
public:
    EventSource(Interpreter& interpreter, Comm& comm);
    ~EventSource();
    EventSource(const EventSource&) = delete;
    EventSource& operator=(const EventSource&) = delete;

private:
    static void readable(ClientData data, int mask);        // Tcl: the reactor has something to call
    static void enteringLoop(ClientData data, int flags);   // Tcl: an event loop is about to wait
    void serve();                                           // may run services, and end the interpreter
    void callReactor();

    Interpreter& interpreter_;
    Comm& comm_;
    int epoll_;         // the reactor's descriptor
    bool shared_;       // Tcl waits in the reactor's set
};

}  // namespace sorma
