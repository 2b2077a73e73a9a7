// calls.h -- the calls of this process to one daemon.
//
// There are two kinds. call() and collect() block. begin() returns, and the reactor sends the call and delivers the answer. Calls
// beyond what the daemon takes at a time wait here; CTRL and DBX go first, and some slots are kept free for them.
//
// When the connection breaks, the daemon that answers next says which one it is. If its boot number is the same, the kept bytes
// are sent again. If it is another daemon, the calls that were sent fail with COMM LOST, and only the others go to it. Before
// anything else it gets the state of its objects back: see restore.
//
// Threads:   belongs to the thread of its SORM.
// Callbacks: as connection.h says.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/reply.h"
#include "comm/link.h"
#include "comm/slots.h"

namespace sorma {

class Calls : public Pending::Carrier {
public:
    using Ticket = std::uint32_t;
    using Restored = std::function<void(const Message& reply, const Trail& failure)>;

    // update: called when calls were begun or answered, see underway().   resumed: called when other requests may be sent;
    // fresh: for the first time on this connection.
    Calls(Link& link, Link::User& user, const Settings& settings, std::shared_ptr<Reactor> reactor, std::shared_ptr<Mailbox> mailbox,
          std::function<void()> update, std::function<void(bool fresh)> resumed);

    // As Connection has them.
    void call(std::string_view name, Method method, Message& m, Deadline deadline, const PrincipalPointer& relayFor, std::int64_t now);
    Ticket submit(std::string_view name, Method method, const Message& m, Deadline deadline, std::int64_t now);
    void flush(Deadline deadline);
    void collect(Ticket ticket, Message& m);
    bool arrived(Ticket ticket) { return slots_[ticket].state == Slot::State::done; }
    void begin(const PendingPointer& pending, const std::string& name, Method method);
    void restore(const void* owner, std::string name, Method method, std::vector<std::string> words, PrincipalPointer relayFor, Restored done);
    void cancelRestore(const void* owner);
    void end();                                         // forget what is under way; nobody is told
    bool background = false;                            // as Connection::inBackground

    // Block until there is a connection and the daemon has the state of its objects (restored), or until the slot that waits for
    // this has failed. Throws as Connection::call.
    void connect(Deadline deadline, const Slot* waiting = nullptr, bool restored = true);
    // Begin to connect, and wait a moment for it: so a request is on its way although no event loop runs.
    void connectSoon();
    void lookIfIdle(std::int64_t now) {
        if (link_.live() && link_.quiet(now) && !slots_.awaited()) link_.look();
    }
    void lookNow();
    bool ready() const { return link_.live() && !held_; }       // may requests be sent?
    void proceed();                                     // restore state; when that is done, send what waits for it
    void tellLater();                                   // deliver answers from the mailbox, if any have come
    bool underway() const { return pendings_ > 0; }
    std::uint64_t count() const { return slots_.calls(); }
    std::size_t taken() const { return slots_.taken(); }
    std::size_t inFlight() const { return slots_.inFlight(); }
    const wire::Times& lastTimes() const { return times_; }

    // ---- as Link::User ----
    std::string whom() const;
    void connected(bool other) {
        slots_.forgetAnswers();
        held_ = fresh_ = true;
        if (other && link_.boots() > 1) restoring_.clear();
    }
    void replied(XdrReader& r, std::uint32_t xid);
    void wrote(Link::Tag tag) { slots_.sent(tag); }
    void ended();
    void unanswered(const Link::Verdict& verdict);
    void failed(const Error& why, bool final) {
        if (final) failWaiting([&](const Pending&) { return why.trail; });
        tellLater();
    }
    void turned(bool blocking) {
        if (held_) [[unlikely]] proceed();
        if (!blocking && !arrived_.empty()) deliver();
    }

private:
    // A call that waits for a slot, or for the connection.
    struct Waiting {
        PendingPointer pending;
        std::string name;
        Method method;
    };
    struct Arrived {
        PendingPointer pending;
        Trail failure;
        void tell() {
            if (failure.empty()) pending->answer();
            else pending->answer(std::move(failure));
        }
    };
    // A request of restore(). The first one is on its way when restoringSlot_ says so.
    struct Restoring {
        const void* owner;
        std::string name;
        Method method;
        Message request;
        PrincipalPointer relayFor;
        Restored done;
    };

    void drive(Pending& pending, Deadline deadline) override;
    void cancelled(Pending& pending) override;
    int descriptor() const override { return link_.descriptor(); }
    Trail overdue(Pending& pending) override;
    std::string fullName(const Slot& slot) const { return link_.fullName(slot.name); }
    std::uint32_t acquire(std::string_view name, Deadline deadline);    // throws COMM LIMIT when there is no slot
    void renew(Deadline deadline);
    void freeSlot(std::uint32_t index);
    void await(std::uint32_t index, std::int64_t left);                 // block until the call is done; throws at its deadline
    void tellCancel(std::uint32_t index);
    bool over(const Slot* waiting) const { return (waiting && waiting->failed) || (driven_ && hasArrived(*driven_)); }
    [[noreturn]] void failHopeless(const Error& why, const Slot* waiting, const std::string& whom);
    [[noreturn]] void failTimeout(const Slot* waiting, const std::string& whom, const std::string& problem);
    void checkGivenUp(const Slot* waiting, const std::string& whom);
    void sendWaiting();
    void sweepWaiting();
    void failWaiting(const std::function<Trail(const Pending&)>& why);
    // The answer of a begun call goes from takeAnswer() to arrived_. From there deliver() brings it to its Pending: in the reactor's
    // turn, or from the mailbox when a blocking call has read it.
    void takeAnswer(std::uint32_t index);
    void arrive(PendingPointer pending, Trail failure);
    bool hasArrived(const Pending& pending) const;
    void deliver();
    void deliverOne(Pending& pending);
    void countAnswered(std::size_t calls);
    std::optional<std::uint32_t> abandon(Pending& pending);
    void resend();
    bool sendRestoring();
    void finishRestoring(const Message& reply, const Trail& failure);
    void restoringOverdue();

    Link& link_;
    Link::User& user_;
    const Settings& settings_;
    std::shared_ptr<Reactor> reactor_;
    std::shared_ptr<Mailbox> mailbox_;
    const std::function<void()> update_;
    const std::function<void(bool fresh)> resumed_;
    Slots slots_;
    wire::Times times_;
    // Blocking calls.
    std::vector<std::uint32_t> unsent_;     // submitted, not yet handed to the link
    Buffer batch_;                          // their bytes, for one write
    const std::string* blocked_ = nullptr;  // the name in messages, while connect() blocks
    // Calls that were begun.
    std::size_t pendings_ = 0;              // not answered
    std::size_t stale_ = 0;                 // of waiting_ and urgent_: cancelled since the last sweepWaiting()
    std::deque<Waiting> waiting_, urgent_;  // EXEC; CTRL and DBX, which go first
    std::vector<Arrived> arrived_;          // answers whose Pending has not been told yet
    bool delivering_ = false;               // deliver() is in the mailbox
    const Pending* driven_ = nullptr;       // the call for which drive() blocks
    // State that goes before all else.
    std::deque<Restoring> restoring_;       // in the order of restore()
    std::uint32_t restoringSlot_ = kNoTicket;       // of the first one; kNoTicket: it is not sent
    Deadline restoringUntil_;               // of the one that is sent
    Timer restoringTimer_;                  // goes off then
    bool held_ = false;                     // requests wait until restoring_ is empty
    bool fresh_ = false;                    // nothing has been sent again on this connection yet
};

}  // namespace sorma
