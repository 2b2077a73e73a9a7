// client.h -- a process that sends requests, as objects know it: its identity, and what it holds.
//
// A client may hold things of an object: a lock, a semaphore's count, an item of a queue. Each is a lease. When the client
// has died, or has been disconnected for longer than Settings::grace, COMM calls end(); when the policy has changed, judge().
// Then the objects concerned are told, and take their things back.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bus/access.h"
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
    bool checksAhead = false;           // it has asked for what bus/ahead.h needs, and is told when that changes

    // Hold something of an object until release(). If the client ends before that, lost() is called; at once if it has ended
    // already. A change of the policy that takes the right from it does the same. lost() must not throw. It may hold and release
    // leases.   object: its own name.
    Lease hold(std::string object, std::function<void()> lost, Right right = Right::call) {
        if (ended_) return lost(), 0;
        leases_.emplace(++last_, Held{std::move(object), right, std::move(lost)});
        return last_;
    }
    void release(Lease lease) { leases_.erase(lease); }
    bool ended() const { return ended_; }
    // The client has ended: call lost() of each lease, the oldest first.
    void end() {
        ended_ = true;
        while (!leases_.empty()) {
            auto lost = std::move(leases_.begin()->second.lost);
            leases_.erase(leases_.begin());
            lost();
        }
    }

    // The policy has changed: call lost() of each lease that it does not allow any more.
    void judge(const Access& access) {
        if (!principal) return;
        std::vector<Lease> all;
        for (auto& [lease, held] : leases_) all.push_back(lease);
        for (Lease lease : all) {
            auto at = leases_.find(lease);
            if (at == leases_.end() || (access.rights(principal, at->second.object) & Rights(at->second.right))) continue;
            auto lost = std::move(at->second.lost);
            leases_.erase(at);
            lost();
        }
    }

private:
    struct Held {
        std::string object;
        Right right;
        std::function<void()> lost;
    };
    std::map<Lease, Held> leases_;
    Lease last_ = 0;
    bool ended_ = false;
};

using ClientPointer = std::shared_ptr<Client>;

}  // namespace sorma
