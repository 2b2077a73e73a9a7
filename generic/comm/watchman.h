// watchman.h -- answers for a daemon whose thread is busy.
//
// While a service computes for seconds in the interpreter's thread, nobody reads the daemon's sockets. The watchman, a
// thread of its own, notices that the reactor stands still, and answers what needs no service: pings, health, newcomers,
// and word that a call is not wanted any more. It sleeps while the daemon is idle, and looks twenty times a second while
// it is not; a call pays for it with a few atomic operations.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "comm/gate.h"
#include "comm/reactor.h"

namespace sorma {

class Watchman {
public:
    // look(): called inside the gate, with the descriptors' watchers that wait; must be quick. True: a request is being
    // executed, or waits.
    using Look = std::function<bool(const std::vector<void*>& waiting)>;
    Watchman(Reactor& reactor, Gate& gate, Look look);
    ~Watchman();

private:
    void watch();

    Reactor& reactor_;
    Gate& gate_;
    Look look_;
    int bell_;                  // eventfd: look up, there is something to watch, or to end
    std::atomic<bool> ended_{false};
    std::thread thread_;
};

}  // namespace sorma
