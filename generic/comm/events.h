// events.h -- the subscriptions of this process at one daemon, and the other questions to it that are no calls.
//
// A subscription lasts over broken connections. The same daemon then knows how many events it could not send; another one knows
// nothing, and the listener is told so: event sorma.reconnected.
//
// Threads: belongs to the thread of its SORM. Listeners are called from the mailbox.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "bus/stream.h"
#include "comm/calls.h"

namespace sorma {

class Events {
public:
    Events(Link& link, Calls& calls, Link::User& user, std::shared_ptr<Mailbox> mailbox)
        : link_(link), calls_(calls), user_(user), mailbox_(std::move(mailbox)) {}

    // As Connection has them.
    std::unique_ptr<Listening> listen(std::string name, std::string pattern, std::size_t keep, Listener listener, Deadline deadline,
                                      const PrincipalPointer& relayFor);
    std::unique_ptr<Listening> listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing,
                                           const PrincipalPointer& relayFor);
    wire::Health health(Deadline deadline);
    void askHealth(std::function<void(const wire::Health&)> told);
    bool askFacts(std::string_view name, const PrincipalPointer& relayFor, std::function<void(Message& answer)> told);

    bool any() const { return !subscriptions_.empty(); }
    void resume();                                      // on a new connection: subscribe again
    void ended() { controls_.clear(); }                 // the connection is lost
    void replied(XdrReader& r, std::uint32_t xid);      // to a question of ours, which has Slots::kControl in its xid
    void event(XdrReader& r);
    void traced(XdrReader& r);                          // the event that comes next

private:
    class Remote;                                       // a subscription
    // Gets the answer to a record that is no call. objection: what the daemon refused, empty when it did not.
    using Control = std::function<void(XdrReader& reply, const std::string& objection)>;
    std::uint32_t control(Control handler);             // expect an answer; returns the xid for it
    std::unique_ptr<Remote> make(std::string name, std::string pattern, std::size_t keep, Listener listener, const PrincipalPointer& relayFor,
                                 bool existing);

    Link& link_;
    Calls& calls_;
    Link::User& user_;
    std::shared_ptr<Mailbox> mailbox_;
    const std::shared_ptr<Inbox::Spares> spares_ = std::make_shared<Inbox::Spares>();
    wire::EventHeader next_;                            // of the event that is traced, if it is
    TraceOrigin origin_;
    std::map<std::uint32_t, Control> controls_;         // by xid
    std::map<std::uint32_t, Remote*> subscriptions_;    // by id
    std::uint32_t lastControl_ = 0, lastSubscription_ = 0;
};

}  // namespace sorma
