// healthResponder.h -- answers for a daemon whose thread is busy.
//
// While a service computes for seconds in the interpreter's thread, nobody reads the daemon's sockets. The health responder
// is a thread of its own. When the reactor makes no turns, it answers what needs no service: pings, health, new clients, and
// CANCEL. It sleeps while the daemon is idle, and looks twenty times a second otherwise. Each call pays for it with a few
// atomic operations.
//
// Threads: construct and delete it in the thread of the SORM. The constructor starts the thread and throws std::system_error
//          when it cannot; the destructor waits for its end, at most for one look.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "comm/serverLock.h"
#include "comm/reactor.h"

namespace sorma {

class HealthResponder {
public:
    // Called in the health responder's thread, with the lock held, while the SORM's thread is busy elsewhere. It must be
    // quick, must not throw, and must not enter Tcl or a service. waiting: the watchers (Reactor::Watcher) whose descriptors
    // have events. Returns whether a request is being executed.
    using Look = std::function<bool(const std::vector<void*>& waiting)>;
    HealthResponder(Reactor& reactor, ServerLock& lock, Look look);
    ~HealthResponder();

private:
    void watch();

    Reactor& reactor_;
    ServerLock& lock_;
    Look look_;
    int bell_;                  // eventfd, written to wake the thread: the reactor makes turns again, or it is to end
    std::atomic<bool> ended_{false};
    std::thread thread_;
};

}  // namespace sorma
