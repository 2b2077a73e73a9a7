// client.h -- a process that sends requests, as objects know it: its identity, and what it holds.
//
// A client may hold things of an object: a lock, a semaphore's count, an item of a queue. Each is a lease. When the client
// has died, or has been disconnected for longer than Settings::grace, COMM calls end(): each object is told, and takes its
// thing back.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>

#include "bus/call.h"

namespace sorma {

class Client {
public:
    using Lease = std::uint64_t;
    explicit Client(Caller who, PrincipalPointer as = nullptr) : caller(std::move(who)), principal(std::move(as)) {}
    ~Client() { end(); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    Caller caller;
    PrincipalPointer principal;         // who is charged for it, and is the author of its requests; null: the owner

    // Hold something until release(). lost() is called if the client ends before that; at once if it has ended already.
    // lost() must not throw; it may hold and release leases.
    Lease hold(std::function<void()> lost) {
        if (ended_) return lost(), 0;
        leases_.emplace(++last_, std::move(lost));
        return last_;
    }
    void release(Lease lease) { leases_.erase(lease); }
    bool ended() const { return ended_; }
    // The client has ended: call lost() of each lease, the oldest first.
    void end() {
        ended_ = true;
        while (!leases_.empty()) {
            auto lost = std::move(leases_.begin()->second);
            leases_.erase(leases_.begin());
            lost();
        }
    }

private:
    std::map<Lease, std::function<void()>> leases_;
    Lease last_ = 0;
    bool ended_ = false;
};

using ClientPointer = std::shared_ptr<Client>;

}  // namespace sorma
