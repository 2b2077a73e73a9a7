// subscription.h -- one subscription of a client to an object of this daemon, and the events that wait for it.
//
// Threads: with the ServerLock held, by the SORM's thread.
// Owner:   the session.
#pragma once

#include <deque>
#include <memory>
#include <string>

#include "bus/kept.h"
#include "bus/stream.h"
#include "comm/sessions.h"

namespace sorma {

// A client's subscription to one object. It belongs to the session, so that the events which the client misses while its
// connection is broken are counted.
class Server::Subscription : public Subscriber {
public:
    // Makes the object when need be, which runs its class's code without the lock. Throws what that throws, COMM DENIED without the
    // right to inspect the object, SERVICE GONE when wanted.existing and there is none.   author: whose rights count; null: the
    // owner's.
    Subscription(Server& server, Session& session, const wire::Subscription& wanted, const PrincipalPointer& author);
    ~Subscription() override;
    void event(const Event& event) override;    // called when the object publishes one
    void gone() override;                       // called when the object is removed; the client gets sorma.gone
    std::string who() const override;
    void judge();                               // the policy has changed: end it if it is not allowed any more
    void replay();                              // queue the latest events that were published before, if keep is 1

    // Append events that wait to out, until it has kEventWindow bytes. True when some are left.
    bool pump(Buffer& out);
    bool waiting() const { return !waiting_->items.empty(); }
    void stopKeeping();                     // the connection broke: events are counted from now on, and not kept
    std::uint64_t takeLost() { return std::exchange(lost_, 0); }
    std::uint64_t number() const { return number_; }        // of the last event
    const std::uint32_t id;                 // chosen by the client
    bool scheduled = false;                 // it is in its peer's list events_

private:
    // Shared by all subscriptions that get the event.
    using Item = std::shared_ptr<const wire::EncodedEvent>;
    // The client's account pays for these.
    struct Waiting {
        std::deque<Item> items;             // events that wait for the peer: the last ones, up to number_
        std::size_t own = 0, bytes = 0;     // of the subscription itself; of the items
        std::size_t heap() const { return own + charged(bytes); }
        // One or two small ones are on their way in a moment: they cost nothing. The others are charged in steps, since several
        // threads share an account.
        static std::size_t charged(std::size_t bytes) { return bytes > kStep ? (bytes + kStep - 1) / kStep * kStep : 0; }
        static constexpr std::size_t kStep = 1024;
    };
    bool fits(std::size_t more) const;      // may so many bytes of events wait in addition?
    void push(Item item);
    void end(const char* event, std::string why);
    bool mayListen();                       // check the right again after the policy has changed
    static std::size_t sizeOf(const Item& item) { return sizeof(Item) + item->body.size(); }
    void dropOldest(Waiting& w);

    Server& server_;
    Session& session_;
    Charged<Waiting> waiting_;
    const PrincipalPointer author_;
    std::uint32_t epoch_ = 0;               // of the policy by which the right was checked
    const std::string pattern_;
    Reference object_;                      // empty once it was removed or the right was lost
    std::size_t keep_;                      // events kept, at most
    std::uint64_t number_ = 0, lost_ = 0;   // of the last event; events lost before the first that waits
};

}  // namespace sorma
