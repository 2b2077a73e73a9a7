// client.h -- a process that sends requests, as the objects it calls know it: identity, and what it holds.
//
// A client may hold things of an object: a lock, a semaphore's count, an item of a queue. Each is a lease: when the
// client has died, or stayed away longer than Settings::grace, COMM ends it, and what it held is given back.
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
    PrincipalPointer principal;         // whom it is charged to, and who writes its requests; null: the owner

    // Keep until released; lost() is called when the client ends before. Of a client that has ended: at once.
    Lease hold(std::function<void()> lost) {
        if (ended_) return lost(), 0;
        leases_.emplace(++last_, std::move(lost));
        return last_;
    }
    void release(Lease lease) { leases_.erase(lease); }
    bool ended() const { return ended_; }
    // What it holds is given back, the oldest first.
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
