// connection.h -- the connection of this process to one daemon.
//
// All proxies share it whose names resolve to the same address by the same rule (see resolve in bus/name.h): the rule
// decides which address a reconnect uses.
//
// A call takes a free slot, gets a number and is sent. Its bytes are kept until the reply has come. When the connection
// breaks, the address is resolved again, and the daemon that answers there says who it is. If its boot number is the same,
// the kept bytes are sent again, and the daemon executes nothing twice. If it is another daemon, the calls that were sent
// fail with COMM LOST, and only those that were not sent go to it.
//
// There are two kinds of calls. call() and collect() block. begin() returns, and the reactor sends the call, reconnects
// without blocking, and delivers the answer. Calls beyond what the daemon takes at a time wait here. Subscriptions use the
// same socket.
//
// Threads:   belongs to the thread of its SORM.
// Blocking:  a blocking call never enters an event loop. What arrives for others meanwhile is delivered later, from
//            the loop.
// Callbacks: they come from the reactor's turn or from the mailbox. A blocking call runs no callbacks but those of the
//            answer that it waits for, onRestart and whenDropped. A callback may begin calls; it must not block while
//            inEvents() is true.
// Owner:     proxies share it. It also keeps itself alive while begun calls or one-way requests are under way.
//
// Sources: connection.cpp has the blocking calls and what both kinds share, connectionEvents.cpp what the reactor drives.
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
    // Connects at the first call, not here. who: the name of the daemon in messages, the text after @.   locate: returns the
    // address that the dictionary has now; it is called for each attempt to connect and may throw Error.
    Connection(std::string who, std::function<Address()> locate, std::shared_ptr<const Settings> settings, std::shared_ptr<Reactor> reactor,
               std::shared_ptr<Mailbox> mailbox);
    ~Connection() override;
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    // Call a service of the daemon. m is the request and becomes the reply. Blocks until the reply or the deadline, connects
    // when need be. Throws Error: the daemon's trail, or an error of errors.h. name: of the object, as the daemon knows
    // it.   relayed: somebody other than the owner of this process chose the name. now: the time from which the deadline was
    // computed [ns, monotonic]; 0: the clock is read.
    void call(std::string_view name, Method method, Message& m, Deadline deadline, bool relayed = false, std::int64_t now = 0);

    // The same in two steps, so that many calls can be in flight. A ticket is good for one collect, whose message receives
    // the reply. Calls are sent at flush, at collect, or when 32 kB have gathered. submit may block to connect and throws as
    // call does.
    using Ticket = std::uint32_t;
    Ticket submit(std::string_view name, Method method, const Message& m, Deadline deadline);
    void flush(Deadline deadline);
    void collect(Ticket ticket, Message& m);
    // Would collect return at once? Looks at what has been read, never at the socket.
    bool arrived(Ticket ticket) const { return slots_[ticket]->state == Slot::State::done; }

    // Begin a call. The message of pending is the request; pending is answered when the call is over, from the loop. Never
    // throws, failures are answers too. May block for 10 ms while it connects, and longer while a host's name is looked up;
    // inBackground() avoids the 10 ms. The connection lives as long as there are such calls.
    void begin(const PendingPointer& pending, const std::string& name, Method method);
    // Send a request that gets no reply. If the connection is broken, the request waits for the next one; a request that is
    // never sent is reported to whenDropped. The call may block: before the first connection until there is one
    // (Settings::timeout, 25 s), later while more than Settings::onewayQueue bytes wait (Settings::onewayWait, 1 s; never
    // inside the reactor's turn). If there is no room then, it throws COMM LIMIT, and the request is not sent.
    void oneway(const std::string& name, Method method, const Message& m, bool relayed = false);
    // At the end of the program: send the one-way requests that wait. Blocks until then or the deadline. Returns a sentence
    // about those that were not sent; empty: all were sent.
    std::string finish(Deadline deadline);
    // Subscribe to events of an object of the daemon. Blocks until the daemon has agreed. Throws the daemon's refusal, or as
    // call does. keep: events that are kept while the listener does not run; then the oldest are lost and counted. The
    // listener is called from the loop, until the result is deleted. The result keeps the connection alive.
    std::unique_ptr<Listening> listen(std::string name, std::string pattern, std::size_t keep, Listener listener, Deadline deadline,
                                      bool relayed = false);
    // The state of the daemon; it answers while it is busy, too. Blocks. Throws as call does.
    wire::Health health(Deadline deadline);

    // ---- for observers, which must never wait ----

    // From now on begin() does not block for the 10 ms that it otherwise waits for a connection.
    void inBackground() { background_ = true; }
    // Called from the loop after the connection was made or lost. May be empty.
    std::function<void()> changed;
    // Ask for the state. told is called from the loop; never, when there is no connection or it breaks.
    void askHealth(std::function<void(const wire::Health&)> told);
    // As listen, without waiting. Call it while connected; it subscribes again on each later connection. The listener gets a
    // refusal as the event sorma.refused. existing: do not make the object if the daemon does not have it.
    std::unique_ptr<Listening> listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing);
    // Is this inside the reactor's turn for this connection? Then nothing may block.
    bool inEvents() const { return inEvents_; }

    void connect(Deadline deadline);                    // now rather than at the first call; blocks, throws as call does
    void ping(Deadline deadline);                       // a call that does nothing; blocks, throws as call does
    void close(const std::string& reason);              // returns at once; calls that were sent fail with COMM LOST
    void end();                                         // removes what is under way; no caller and no listener is told

    // Called at once, from inside the function that found out, for one-way requests that will never be sent. May be empty;
    // must not call the connection.
    std::function<void(Trail)> whenDropped;

    // callback: called when another daemon than before has answered, before anything else is sent to it. It may make calls;
    // what it throws is ignored. Returns a number for cancelRestart; cancel it before what the callback uses is deleted.
    std::uint64_t onRestart(std::function<void()> callback);
    void cancelRestart(std::uint64_t number);

    const std::string& who() const { return who_; }
    bool connected() const { return fd_ >= 0; }
    const wire::Welcome& daemon() const { return daemon_; }     // who answered last; boot 0: nobody yet
    std::uint64_t boots() const { return boots_; }      // daemons seen so far: changes when another one answers
    std::string facts() const;                          // for people, a line for each fact
    std::string row() const;                            // a list, see sorm DBX -inventory connections
    const wire::Times& lastTimes() const { return times_; }     // of the last reply

private:
    struct Slot {
        enum class State : std::uint8_t { free, unsent, sent, done, unwanted };
        State state = State::free;
        std::uint32_t sequence = 0;
        std::string name;
        Deadline deadline;
        std::int64_t budget = 0;        // [ns] time left to the deadline when it was written
        Buffer request;                 // the record, kept until the reply has come
        Message* into = nullptr;        // where a blocking caller wants the reply; null: in result
        Message result;
        Trail failure;                  // when failed: why, on this side of the wire
        bool failed = false;
        bool orphan = false;            // cancelled, but it still has to be sent since a part of it was
        bool cut = false;               // a part of it was sent on a connection that broke
        bool unsure = false;            // failed, though its daemon may still execute it: see failSent
        PendingPointer pending;         // of a call that was begun: it gets the reply
    };
    // A call that waits for a slot, or for the connection.
    struct Waiting {
        PendingPointer pending;
        std::string name;
        Method method;
    };
    // What the socket has not taken yet, or only in part.
    struct Outgoing {
        std::uint32_t slot;             // the call; kControl: bytes, and no call
        Buffer bytes;
        bool oneway = false;            // the bytes are records of one-way requests
    };
    struct Arrived {
        PendingPointer pending;
        Trail failure;
    };
    struct Opening;                     // a connection that the reactor is making
    class Remote;                       // a subscription
    struct Due {
        std::int64_t when;
        std::weak_ptr<Pending> pending;
        bool operator>(const Due& o) const { return when > o.when; }
    };
    // Gets the answer to a record that is no call. objection: what the daemon refused, empty when it did not.
    using Control = std::function<void(XdrReader& reply, const std::string& objection)>;
    // Why calls that were sent will get no reply.
    struct Verdict {
        std::string why, hint;          // "the daemon has ended"; what to do
        bool ended = true;              // the daemon is known to have ended, so its slots are free
    };

    // Find a free slot; throws COMM LIMIT when there is none.
    std::uint32_t acquire(std::string_view name, Deadline deadline);
    bool exhausted() const;
    void renewSlots(Deadline deadline);
    // Encode a call into its slot. Throws COMM TOO_BIG.
    void write(std::uint32_t slot, Method method, const Message& m, std::int64_t now, const wire::Behalf* behalf);
    // Send all of it, blocking. False: the connection is lost. taken: counts what the socket has taken.
    bool transmit(const char* data, std::size_t size, Deadline deadline, std::size_t* taken = nullptr);
    void tellCancel(std::uint32_t slot);
    // Block until the call is done; throws at its deadline. left: time to the deadline [ns], when it is known; < 0: compute
    // it.
    void await(std::uint32_t slot, std::int64_t left = -1);
    bool receive(Deadline deadline) { return receive(deadline, deadline.left()); }
    // Block for some bytes, and handle the records in them. False: the deadline has passed. left: time to it [ns]
    bool receive(Deadline deadline, std::int64_t left);
    ssize_t read(int flags);                            // once; as recv(2)
    bool takeRecords();                                 // handle the complete ones; false: they are no records, we disconnected
    void take(std::string_view record);
    void fail(std::uint32_t slot, Trail trail);         // the call of the slot is done, with this error
    void release(std::uint32_t slot);                   // the caller needs it no more; free as soon as no reply can come
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
    void watch();                                       // tell the reactor which events we need
    void sendWaiting();                                 // as many begun calls as there are free slots
    void sweepWaiting();
    bool beingSent(std::uint32_t index) const;
    void sendSlot(std::uint32_t index);
    void sendBytes(Buffer bytes, bool oneway = false);  // queue them, and send what the socket takes now
    // One-way requests: those that wait stand in outgoing_ while connected, in oneways_ otherwise.
    std::size_t backlog() const;                        // [bytes] that wait to be sent, calls not counted
    void makeRoom(std::size_t most, Deadline deadline); // block until the backlog is no more than that, or the deadline
    void keepOneways();
    void keepOneway(const char* records, std::size_t size);
    void dropped(std::size_t count, const std::string& why);
    void dropOneways(const std::string& why);
    void continueSending();                             // as much of outgoing_ as the socket takes; never blocks
    template <class Enough> void sendUntil(Deadline deadline, Enough enough);
    bool drain(Deadline deadline);                      // send all of outgoing_, blocking; false: the connection is lost
    void sent(std::uint32_t index);
    // The answer of a begun call goes from settle() to arrived_, and from there to its Pending: by deliver() in the
    // reactor's turn, by deliverLater() through the mailbox when a blocking call has read it.
    void settle(std::uint32_t index);
    void arrived(PendingPointer pending, Trail failure);
    bool hasArrived(const Pending& pending) const;
    void deliver();
    void deliverOne(Pending& pending);
    void deliverLater();
    void tellChange();                                  // calls changed, through the mailbox
    void countAnswered(std::size_t calls);                     // so many begun calls are answered
    void releaseSelf();                                       // of the own reference, when nothing is under way
    void addDeadline(const PendingPointer& pending);
    void passDeadlines();
    std::string whom() const;
    // Connecting in the reactor's turns: startOpening, then advance for each event, until welcomed or openFailed.
    void startOpening();
    void advance(std::uint32_t events);
    void closeOpening();
    void finishOpening(Deadline deadline);              // block until it is over, one way or the other
    void openFailed(const Error& error);
    void retry();                                       // start again after a pause
    void failWaiting(const Trail& trail);
    std::uint32_t control(Control handler);             // expect an answer that is no reply to a call; returns the xid for it
    void resubscribe();
    void takeEvent(XdrReader& r);

    // whom: the name that messages have
    void welcomed(const std::string& whom, const std::string& record);
    void open(const std::string& whom, Deadline deadline);      // connect and say HELLO, blocking; throws
    void greet(const std::string& whom, Deadline deadline);
    std::string readWhole(Deadline deadline, std::string& record);
    void lost(const std::string& how);                  // the connection broke: disconnect, and reconnect if need be
    void recover(Deadline deadline, const Slot* waiting);       // reconnect, blocking; throws
    void resend(Deadline deadline);
    bool sayHello(int fd);
    bool absent(const Error& e) const;                  // e says that nothing listens at the address
    bool mayCome(const Error& e) const;                 // after e: is it worth trying again?
    void conclude(const Error& e);                      // fail the calls that were sent, if e proves that no reply will come
    void failSent(const Verdict& verdict);
    std::string fullName(const Slot& slot) const { return slot.name + "@" + who_; }
    [[noreturn]] void failTimeout(const Slot* waiting, const std::string& whom, const std::string& lastError);
    std::string age() const;
    void disconnect();                                        // close the socket and clear what belongs to it

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
    bool wait_ = false;                     // the address says -wait: the daemon may come later
    std::int64_t absentSince_ = 0;          // [ns] nothing has listened there since; 0: something does, or did a moment ago
    bool otherClock_ = false;               // the daemon has another clock than we
    std::int64_t clockSaid_ = 0;            // [ns] when we last sent it the time of our clock
    std::string how_;                       // why the connection was lost
    bool answered_ = false;                 // a call was answered on this connection
    std::int64_t since_ = 0, lastHeard_ = 0;    // [ns] when it was made, when the last record came
    std::int64_t callTime_ = 0;             // [ns] when the blocking call that is under way was made; 0: there is none
    std::uint64_t calls_ = 0, reconnects_ = 0;
    std::uint32_t program_ = wire::kProgram;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::vector<std::uint32_t> free_;
    std::vector<std::uint32_t> unsent_;     // submitted, not yet handed to the socket
    std::size_t inFlight_ = 0;              // calls that were sent and whose reply has not come, wanted or not
    Buffer in_;                             // bytes that have come
    std::size_t inAt_ = 0;                  // of in_: what has been handled
    Buffer batch_;                          // submitted requests, for one send
    wire::Times times_;
    bool hungUp_ = false;                   // the last attempt was accepted, then closed before the welcome
    std::map<std::uint64_t, std::function<void()>> restarted_;      // as onRestart
    std::uint64_t nextRestart_ = 1;
    std::string unread_;                    // beginning of what came and is no record, for the error message

    std::shared_ptr<Reactor> reactor_;
    std::shared_ptr<Mailbox> mailbox_;
    std::shared_ptr<Connection> keep_;      // the own reference, while something is under way
    std::size_t pendings_ = 0;              // calls that were begun and are not answered
    std::size_t stale_ = 0;                 // of waiting_ and urgent_: cancelled since the last sweepWaiting()
    std::deque<Waiting> waiting_, urgent_;  // EXEC; CTRL and DBX, which go first
    std::deque<Outgoing> outgoing_;         // sent in this order
    std::size_t outgoingAt_ = 0;            // of the first one: bytes that the socket has taken
    Buffer oneways_;                        // one-way requests that wait for the next connection
    std::int64_t onewaysSince_ = 0;         // [ns] since when the first of them waits
    std::uint64_t dropped_ = 0;             // one-way requests that were never sent
    std::string whyDropped_;
    std::vector<Arrived> arrived_;          // answers whose Pending has not been told yet
    bool delivering_ = false;               // deliver() is in the mailbox
    const Pending* driven_ = nullptr;       // the call for which drive() blocks
    std::unique_ptr<Opening> opening_;      // null: none is being made
    std::int64_t pause_ = 0;                // [ns] before the next attempt
    Timer retryTimer_, deadlineTimer_;
    std::int64_t deadlineAt_ = 0;           // [ns] for which deadlineTimer_ is set
    std::priority_queue<Due, std::vector<Due>, std::greater<>> due_;    // deadlines of begun calls, the next one first
    bool watched_ = false, inEvents_ = false, background_ = false;
    std::uint32_t interest_ = 0;
    std::map<std::uint32_t, Control> controls_;         // by xid
    std::uint32_t lastControl_ = 0, lastSubscription_ = 0;
    std::map<std::uint32_t, Remote*> subscriptions_;
};

}  // namespace sorma
