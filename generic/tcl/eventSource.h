// eventSource.h -- runs COMM's reactor inside Tcl's event loop.
//
// Tcl 8.6 hands every wait to a helper thread, which costs as much as two calls. So a daemon that has just served a request
// waits for the next one itself, for at most Settings::linger. At the latest after twice that time it returns to Tcl, so
// that timers, file events and idle callbacks get their share. When no request comes, Tcl waits as always.
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

    Interpreter& interpreter_;
    Comm& comm_;
    int epoll_;         // the reactor's descriptor
};

}  // namespace sorma
