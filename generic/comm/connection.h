// connection.h -- this process's line to one daemon: shared by all its proxies whose names have the same address by the same
// rule (see resolve in bus/name.h), since the rule decides where the line leads when it is made anew.
//
// A call is put into a free slot, numbered, sent, and its bytes are kept until the reply is there. When the connection
// breaks, the address is resolved anew and the daemon asked who it is: the same one (its boot number) is sent the
// kept bytes again and executes nothing twice; another one has lost what was sent (COMM LOST) and gets what was not.
//
// Calls may also be begun and left to themselves (begin): then the reactor brings them forward, reconnects without
// blocking, and answers. More calls than the daemon takes at a time wait here. Subscriptions share the connection.
//
// Threads: belongs to the thread of its SORM. Blocking calls never enter an event loop; what comes for others meanwhile
// is kept for it.
//
// Source: connection.cpp has the calls that block and what both share, connectionEvents.cpp what the reactor drives.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <queue>
#include <string>
#include <string_view>
#include <sys/types.h>
#include <vector>

#include "bus/deadline.h"
#include "bus/message.h"
#include "bus/name.h"
#include "bus/reply.h"
#include "bus/stream.h"
#include "comm/reactor.h"
#include "comm/settings.h"
#include "comm/wire.h"

namespace sorma {

class Connection : public Pending::Carrier, public Reactor::Watcher, public std::enable_shared_from_this<Connection> {
public:
    // who: whom messages name, the text after @. locate: the address as the dictionary says now.
    Connection(std::string who, std::function<Address()> locate, std::shared_ptr<const Settings> settings, std::shared_ptr<Reactor> reactor,
               std::shared_ptr<Mailbox> mailbox);
    ~Connection() override;
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    // Call a service of the daemon, in place; blocks until the reply or the deadline. Throws Error: the daemon's own
    // trail, or one of COMM's (errors.h). name: as known at the daemon.
    // relayed: the name was chosen by somebody else than the owner of this process. now: the time [ns] of which the deadline
    // was made; 0: the clock is read.
    void call(std::string_view name, Method method, Message& m, Deadline deadline, bool relayed = false, std::int64_t now = 0);

    // The same in two steps, so that many calls can be in flight. A ticket is good for one collect; the message
    // given to collect receives the result. Calls are sent at flush, at collect, or when much has gathered.
    using Ticket = std::uint32_t;
    Ticket submit(std::string_view name, Method method, const Message& m, Deadline deadline);
    void flush(Deadline deadline);
    void collect(Ticket ticket, Message& m);
    // Would collect return at once? Looks at what has been read, never at the socket.
    bool arrived(Ticket ticket) const { return slots_[ticket]->state == Slot::State::done; }

    // Begin a call: pending's message is the request, its answer the end. Never throws, never blocks but to look up a
    // host's name. The connection lives as long as there are such calls.
    void begin(const PendingPointer& pending, const std::string& name, Method method);
    // Without a reply: sent when it can be, on the next connection if need be; what cannot be sent is told (whenDropped). Waits for
    // room when too many are still to be sent (Settings::onewayQueue), where it may block; fails with COMM LIMIT when there is none.
    void oneway(const std::string& name, Method method, const Message& m, bool relayed = false);
    // Send what still waits, and block for that, at the end. Returns what could not be sent, in words; empty: nothing is left.
    std::string finish(Deadline deadline);
    // Listen to an object of the daemon. Blocks until the daemon has agreed; throws what it objects to.
    std::unique_ptr<Listening> listen(std::string name, std::string pattern, std::size_t keep, Listener listener, Deadline deadline,
                                      bool relayed = false);
    // How the daemon is; also while it is busy. Throws as call does.
    wire::Health health(Deadline deadline);
    // For those who only look on: begin() never waits for a moment, and what has to be known comes as a call from the loop.
    void inBackground() { background_ = true; }
    std::function<void()> changed;                      // it is connected, or lost
    void askHealth(std::function<void(const wire::Health&)> told);      // never told when there is no connection, or it breaks
    // Listen while connected. An objection comes as the event sorma.refused.
    std::unique_ptr<Listening> listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing);
    // Is the reactor at work, so that nothing may block?
    bool inEvents() const { return inEvents_; }

    void connect(Deadline deadline);                    // now rather than at the first call
    void ping(Deadline deadline);
    void close(const std::string& reason);              // calls in flight fail with LOST
    void end();                                         // for good, with everything: nobody hears of it

    // Called for one-way requests that will never be sent, or null.
    std::function<void(Trail)> whenDropped;

    // Called after another daemon than before has answered, before anything else is sent to it.
    std::uint64_t onRestart(std::function<void()> callback);
    void cancelRestart(std::uint64_t number);

    const std::string& who() const { return who_; }
    bool connected() const { return fd_ >= 0; }
    const wire::Welcome& daemon() const { return daemon_; }
    std::uint64_t boots() const { return boots_; }      // daemons seen so far: changes when another one answers
    std::string facts() const;                          // clear text, a line for each fact
    const wire::Times& lastTimes() const { return times_; }

private:
    struct Slot {
        enum class State : std::uint8_t { free, unsent, sent, done, abandoned };
        State state = State::free;
        std::uint32_t sequence = 0;
        std::string name;
        Deadline deadline;
        std::int64_t budget = 0;        // [ns] that were left when it was written
        Buffer request;                 // the record, kept until the reply has come
        Message* into = nullptr;        // where a blocking caller wants the result, else result
        Message result;
        Trail failure;                  // not empty: failed on our side of the wire
        bool failed = false;
        bool orphan = false;            // nobody wants its reply, though it is still to be sent
        bool cut = false;               // a part of it was sent on a connection that is gone
        bool unsure = false;            // given up, while its daemon may still be there: see failSent
        PendingPointer pending;         // whom the reply is for, when it was begun
    };
    // A call that waits for a slot, or for the connection.
    struct Waiting {
        PendingPointer pending;
        std::string name;
        Method method;
    };
    struct Outgoing {                   // on its way, taken by the socket in part or not at all
        std::uint32_t slot;             // kControl: no call, but bytes
        Buffer bytes;
        bool oneway = false;            // records of one-way requests
    };
    struct Arrived {
        PendingPointer pending;
        Trail failure;
    };
    struct Opening;                     // a connection that is being made by the reactor
    class Remote;                       // a subscription
    struct Due {
        std::int64_t when;
        std::weak_ptr<Pending> pending;
        bool operator>(const Due& o) const { return when > o.when; }
    };
    using Control = std::function<void(XdrReader& reply, const std::string& objection)>;
    // What becomes of what was sent, when nobody can say whether it ran.
    struct Verdict {
        std::string why, hint;          // "the daemon has ended"; what to do
        bool ended = true;              // it is known to be gone, and its slots with it
    };

    std::uint32_t acquire(std::string_view name, Deadline deadline);
    bool exhausted() const;
    void renewSlots(Deadline deadline);
    void write(std::uint32_t slot, Method method, const Message& m, std::int64_t now, const wire::Behalf* behalf);
    bool transmit(const char* data, std::size_t size, Deadline deadline, std::size_t* taken = nullptr);   // false: the connection is lost
    void tellCancel(std::uint32_t slot);
    // Until it is done, or throws on its deadline. left: what was left of it just now [ns]; < 0: to be found out
    void await(std::uint32_t slot, std::int64_t left = -1);
    bool receive(Deadline deadline) { return receive(deadline, deadline.left()); }
    bool receive(Deadline deadline, std::int64_t left);     // some bytes; false when the deadline has passed. left: [ns] of it
    ssize_t read(int flags);                            // once; as recv(2)
    bool takeRecords();                                 // those that are complete; false: what came makes no sense
    void take(std::string_view record);
    void fail(std::uint32_t slot, Trail trail);
    void release(std::uint32_t slot);
    void probe(std::uint32_t slot);
    bool toResend(std::uint32_t slot);
    void checkIdle(std::int64_t now);

    // ---- connectionEvents.cpp ----
    void ready(std::uint32_t events) override;
    void drive(Pending& pending, Deadline deadline) override;
    void cancelled(Pending& pending) override;
    int descriptor() const override { return fd_; }
    Trail overdue(Pending& pending) override;
    bool wanted() const { return pendings_ > 0 || !subscriptions_.empty() || !oneways_.empty(); }
    void watch();                                       // what the reactor is to tell us
    void sendWaiting();
    void sweepWaiting();
    bool beingSent(std::uint32_t index) const;
    void sendSlot(std::uint32_t index);
    void sendBytes(Buffer bytes, bool oneway = false);
    std::size_t backlog() const;                        // [bytes] that wait to be sent, and are no calls
    void makeRoom(std::size_t most, Deadline deadline); // block until there is no more than that, or the deadline
    void keepOneways();
    void keepOneway(const char* records, std::size_t size);
    void dropped(std::size_t count, const std::string& why);
    void dropOneways(const std::string& why);
    void continueSending();
    template <class Enough> void sendUntil(Deadline deadline, Enough enough);
    bool drain(Deadline deadline);                      // what is on its way, blocking; false: the connection is lost
    void sent(std::uint32_t index);
    void settle(std::uint32_t index);
    void arrived(PendingPointer pending, Trail failure);
    bool hasArrived(const Pending& pending) const;
    void deliver();
    void deliverOne(Pending& pending);
    void deliverLater();
    void tellChange();
    void forget(std::size_t calls);                     // so many are answered
    void letGo();                                       // of the connection, when nobody needs it any more
    void addDeadline(const PendingPointer& pending);
    void passDeadlines();
    std::string whom() const;
    void startOpening();
    void advance(std::uint32_t events);
    void closeOpening();
    void finishOpening(Deadline deadline);
    void openFailed(const Error& error);
    void retry();
    void failWaiting(const Trail& trail);
    std::uint32_t control(Control handler);             // its xid
    void resubscribe();
    void takeEvent(XdrReader& r);

    void welcomed(const std::string& whom, const std::string& record);
    void open(const std::string& whom, Deadline deadline);      // connect and say HELLO; throws
    void greet(const std::string& whom, Deadline deadline);
    std::string readWhole(Deadline deadline, std::string& record);
    void lost(const std::string& how);                  // the connection is gone: sort out what was in flight
    void recover(Deadline deadline, const Slot* waiting);
    void resend(Deadline deadline);
    bool sayHello(int fd);
    bool absent(const Error& e) const;
    bool mayCome(const Error& e) const;
    void conclude(const Error& e);
    void failSent(const Verdict& verdict);
    std::string fullName(const Slot& slot) const { return slot.name + "@" + who_; }
    [[noreturn]] void failTimeout(const Slot* waiting, const std::string& whom, const std::string& lastError);
    std::string age() const;
    void drop();

    std::string who_;
    std::function<Address()> locate_;
    const std::shared_ptr<const Settings> shared_;
    const Settings& settings_ = *shared_;
    int fd_ = -1;
    std::int64_t receiveTimeout_ = 0;       // [ns] as set on the socket
    std::uint64_t client_;
    wire::Welcome daemon_;
    std::uint64_t boots_ = 0;
    std::string address_;                   // where it was last reached
    std::string lastWords_;                 // reason of a GOODBYE
    bool wait_ = false;                     // as the address says
    std::int64_t absentSince_ = 0;          // [ns] nothing has listened there since; 0: something does, or did a moment ago
    bool otherClock_ = false;               // it does not see our clock
    std::int64_t clockSaid_ = 0;            // [ns] when the daemon was last told what our clock says
    std::string how_;                       // why the connection was lost
    bool answered_ = false;                 // a call, on this connection
    std::int64_t since_ = 0, lastHeard_ = 0;
    std::int64_t callTime_ = 0;             // [ns] when the blocking call that is under way was made; 0: none is
    std::uint64_t calls_ = 0, reconnects_ = 0;
    std::uint32_t program_ = wire::kProgram;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::vector<std::uint32_t> free_;
    std::vector<std::uint32_t> unsent_;     // submitted, not yet handed to the socket
    std::size_t inFlight_ = 0;              // slots sent, also abandoned ones
    Buffer in_;
    std::size_t inAt_ = 0;                  // of in_: what has been taken
    Buffer batch_;                          // submitted requests on their way to one send
    wire::Times times_;
    bool hungUp_ = false;                   // the last attempt was accepted and closed without a word
    std::map<std::uint64_t, std::function<void()>> restarted_;
    std::uint64_t nextRestart_ = 1;
    std::string unread_;                    // beginning of what a stranger said, for the error message

    std::shared_ptr<Reactor> reactor_;
    std::shared_ptr<Mailbox> mailbox_;
    std::shared_ptr<Connection> keep_;      // while calls are under way that nobody else holds us for
    std::size_t pendings_ = 0;              // begun, and not answered
    std::size_t stale_ = 0;                 // cancelled since waiting_ and urgent_ were swept
    std::deque<Waiting> waiting_, urgent_;  // EXEC; CTRL and DBX, which go first
    std::deque<Outgoing> outgoing_;
    std::size_t outgoingAt_ = 0;            // of the first: what the socket has taken
    Buffer oneways_;                        // requests that wait for the next connection
    std::int64_t onewaysSince_ = 0;         // [ns] the first of them
    std::uint64_t dropped_ = 0;             // one-way requests that were never sent
    std::string whyDropped_;
    std::vector<Arrived> arrived_;          // answered by the daemon, their owners not told yet
    bool delivering_ = false;               // ... but soon
    const Pending* driven_ = nullptr;       // whom drive is for
    std::unique_ptr<Opening> opening_;
    std::int64_t pause_ = 0;                // [ns] before the next attempt
    Timer retryTimer_, deadlineTimer_;
    std::int64_t deadlineAt_ = 0;
    std::priority_queue<Due, std::vector<Due>, std::greater<>> due_;
    bool watched_ = false, inEvents_ = false, background_ = false;
    std::uint32_t interest_ = 0;
    std::map<std::uint32_t, Control> controls_;         // by xid
    std::uint32_t lastControl_ = 0, lastSubscription_ = 0;
    std::map<std::uint32_t, Remote*> subscriptions_;
};

}  // namespace sorma
