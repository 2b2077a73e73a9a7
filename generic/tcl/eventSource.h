// eventSource.h -- COMM's reactor inside Tcl's event loop.
//
// Tcl 8.6 hands every wait to a helper thread, which costs twice a call. So a daemon that has just served a request
// waits for the next one itself, for at most Settings::linger, and goes back to Tcl for a round after twice that, so
// that timers, file events and idle callbacks keep their share. When nothing comes, Tcl waits, as always.
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
    static void readable(ClientData data, int mask);
    static void enteringLoop(ClientData data, int flags);
    void serve();

    Interpreter& interpreter_;
    Comm& comm_;
    int epoll_;
};

}  // namespace sorma
