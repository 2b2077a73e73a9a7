// counted.h -- units that clients acquire and release; the common part of semaphore and mutex.
//
// Requests are served strictly in order: a request for many units is not overtaken by one for few. When a client ends, its
// units are released. This process is a client too (null); its units are not released by themselves.
//
// Threads: the SORM's.
#pragma once

#include <algorithm>
#include <map>
#include <string>

#include <sorma.h>

namespace counted {

using sorma::ClientPointer;
using sorma::Message;
using sorma::Reply;

inline const sorma::Prototype kEnded{sorma::Severity::error, "COMM CANCELLED", 1, "{}: the client that asked has ended"};
inline const sorma::Prototype kGone{sorma::Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

class Counted : public sorma::Service {
public:
    ~Counted() override { releaseHolders(); }

    void removing() override {
        releaseHolders();
        for (auto& [ticket, waiter] : std::exchange(waiters_, {})) refuse(waiter.reply, kGone);
    }

protected:
    struct Holder {
        ClientPointer client;               // null: this process
        sorma::Client::Lease lease = 0;
        std::int64_t count = 0;
        std::int64_t since = 0;             // [us] wall clock, of the first that it holds
        std::string who() const { return (client ? client->caller : sorma::Caller::self()).toText(); }
    };
    struct Waiter {
        Reply reply;
        std::int64_t n;
    };

    virtual std::int64_t total() const = 0;

    std::int64_t free() const { return total() - held_; }      // negative when the total was made smaller than what is held
    const std::map<const sorma::Client*, Holder>& holders() const { return holders_; }
    std::size_t waiting() const { return waiters_.size(); }

    // The units that the present client holds.
    std::int64_t held() const {
        auto found = holders_.find(sorma::CallContext::currentClient().get());
        return found == holders_.end() ? 0 : found->second.count;
    }

    // Acquire n units for the present client, if they are free and nobody waits. False: nothing has happened.
    bool acquire(std::int64_t n) {
        const ClientPointer client = sorma::CallContext::currentClient();
        if (client && client->ended()) fail(kEnded, name());
        if (!waiters_.empty() || n > free()) return false;
        take(client, n);
        return true;
    }

    // The same, waiting for its turn: m is answered later.
    void acquireLater(Message& m, std::int64_t n) {
        Reply reply = later(m);
        std::uint64_t ticket = ++tickets_;
        waiters_.emplace(ticket, Waiter{reply, n});
        reply.onCancel([this, ticket] {
            auto found = waiters_.find(ticket);
            if (found == waiters_.end()) return;
            found->second.reply.complete();
            waiters_.erase(found);
            grant();                        // requests for fewer units may have waited behind it
        });
    }

    // Release n units of the present client. False: it does not hold as many, and nothing has changed.
    bool release(std::int64_t n) {
        if (held() < n) return false;
        giveBack(sorma::CallContext::currentClient().get(), n);
        return true;
    }

    // Serve the requests that wait, as far as there are free units. Answers are only posted: nothing calls back from here.
    void grant() {
        while (!waiters_.empty()) {
            auto at = waiters_.begin();
            auto [reply, n] = at->second;
            const ClientPointer client = reply.client();
            if (client && client->ended()) {
                waiters_.erase(at);
                refuse(reply, kEnded);
                continue;
            }
            if (n > free()) return;
            waiters_.erase(at);
            take(client, n);
            // Until the answer is delivered the caller may still cancel: then it never had the units.
            reply.onCancel([this, client = client.get(), n = n] { giveBack(client, n); });
            reply.message().clear();
            reply.complete();
        }
    }

    // Refuse the requests for more than `most` units. They could never be served, and all others would wait behind them.
    void refuseMoreThan(std::int64_t most, const std::function<sorma::Error(std::int64_t n)>& why) {
        std::erase_if(waiters_, [&](auto& item) {
            if (item.second.n <= most) return false;
            item.second.reply.fail(why(item.second.n));
            return true;
        });
    }

private:
    void take(const ClientPointer& client, std::int64_t n) {
        auto& holder = holders_[client.get()];
        if (holder.count == 0) {
            holder.client = client;
            holder.since = sorma::wallNow();
            if (client)
                holder.lease = client->hold(name(), [this, client = client.get()] {
                    auto found = holders_.find(client);
                    if (found != holders_.end()) giveBack(client, found->second.count);
                });
        }
        holder.count += n;
        held_ += n;
    }

    void giveBack(const sorma::Client* client, std::int64_t n) {
        auto found = holders_.find(client);
        if (found == holders_.end()) return;
        Holder& holder = found->second;
        n = std::min(n, holder.count);
        holder.count -= n;
        held_ -= n;
        if (holder.count == 0) {
            auto [owner, lease] = std::pair(holder.client, holder.lease);
            holders_.erase(found);
            if (owner) owner->release(lease);
        }
        grant();
    }

    void refuse(const Reply& reply, const sorma::Prototype& why) {
        reply.fail(sorma::Error(sorma::makeEntry(why, {sorma::MessageArg::of(name())})));
    }

    // The object is removed: clients hold nothing of it any more.
    void releaseHolders() {
        for (auto& [key, holder] : std::exchange(holders_, {}))
            if (holder.client) holder.client->release(holder.lease);
        held_ = 0;
    }

    std::map<const sorma::Client*, Holder> holders_;        // counts are > 0
    std::int64_t held_ = 0;                                 // their sum
    std::map<std::uint64_t, Waiter> waiters_;               // by ticket: the first is next
    std::uint64_t tickets_ = 0;
};

}  // namespace counted
