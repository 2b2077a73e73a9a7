// healthResponder.h -- answers for a daemon whose thread is busy.
//
// While a service computes for seconds in the interpreter's thread, nobody reads the daemon's sockets. The health responder, a
// thread of its own, notices that the reactor stands still, and answers what needs no service: pings, health, newcomers,
// and word that a call is not wanted any more. It sleeps while the daemon is idle, and looks twenty times a second while
// it is not; a call pays for it with a few atomic operations.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "comm/serverLock.h"
#include "comm/reactor.h"

namespace sorma {

class HealthResponder {
public:
    // look(): called with the lock held, with the descriptors' watchers that wait; must be quick. True: a request is being
    // executed, or waits.
    using Look = std::function<bool(const std::vector<void*>& waiting)>;
    HealthResponder(Reactor& reactor, ServerLock& lock, Look look);
    ~HealthResponder();

private:
    void watch();

    Reactor& reactor_;
    ServerLock& lock_;
    Look look_;
    int bell_;                  // eventfd: look up, there is something to watch, or to end
    std::atomic<bool> ended_{false};
    std::thread thread_;
};

}  // namespace sorma
