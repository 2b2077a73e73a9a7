// serverParts.h -- the parts of a server: peers, sessions with their slots, subscriptions. Only server.cpp, peer.cpp and
// subscription.cpp include it.
//
//     Peer          one connection, from accept to close
//     Session       one client that said HELLO; it outlives a connection that breaks
//     Slot          one call of a session at a time, and its last reply
//     Subscription  one subscription of a session, and the events that wait for it
//     Frame         one turn of a peer, on the stack
//
// Threads:  everything here is used with the ServerLock held, by the SORM's thread; Peer::peek also by the health
// responder's.
// Re-entry: while a request is executed the lock is released, and the service may run the event loop. Afterwards the peer
//           may be closed and the session removed. So code looks them up again (Server::findSlot, findPeer), or checks
//           open().
// Owner:    the server owns peers and sessions, a session its slots and subscriptions.
#pragma once

#include <sys/epoll.h>

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/budget.h"
#include "bus/client.h"
#include "bus/stream.h"
#include "comm/clock.h"
#include "comm/server.h"

namespace sorma {

// [bytes]; kBatch: requests
inline constexpr std::size_t kReadSize = 64 * 1024;     // of one read
inline constexpr std::size_t kMostGrowth = 8 << 20;     // of a long request that are read in one turn, at most
inline constexpr int kBatch = 64;                       // requests of one peer in one turn, at most
inline constexpr std::size_t kQueueLimit = 1 << 20;     // of unread replies; with more we read no requests of the peer
inline constexpr std::size_t kEventWindow = 64 * 1024;  // of events that are written to a peer's queue at a time
inline constexpr std::size_t kHold = 4096;              // of replies that wait for the next turn of a peer that has sent more
inline constexpr std::size_t kFlushAt = 256 * 1024;     // of replies that are written before they are sent
inline constexpr std::size_t kKeepBuffer = 4096;        // a peer's own buffers may stay this large when empty
inline constexpr std::size_t kKeepSpare = 4 << 20;      // the shared buffer may stay this large, for the next long message

// Buffers for one turn; turns that are nested on the stack have one each.
struct Server::Scratch {
    char in[kReadSize];
    Buffer out;
    Message message;
};

// One peer's turn, on the stack. When a service runs the event loop, the turns below move the requests that they have not
// served to their peers' buffers (spill). So the inner loop can serve them, in order.
struct Server::Frame {
    Peer* peer;
    const char* at;             // requests that are not served yet: from here
    const char* end;            // to here
    const char* scanned;        // CANCELs were looked for up to here
    bool inPeer;                // at and end point into the peer's own buffer
    bool spilled = false;       // the rest is in the peer's buffer now: do not use at and end
    Frame* outer;
    int served = 0;             // calls executed in this turn
};

struct Server::Slot {
    static constexpr std::size_t kSmall = 256;              // [bytes] of reply for which a slot is charged from the beginning
    // done: the reply is kept. tooLarge: the call was executed, but its reply was too large to keep.
    enum class State : std::uint8_t { empty, running, done, tooLarge };
    std::uint32_t sequence = 0; // of its last call
    State state = State::empty;
    Session* of = nullptr;      // the session that owns it
    bool asked = false;         // the client sent the call again while it runs: the reply goes to its new connection
    std::uint32_t askedXid = 0; // and has this xid there
    std::size_t size = 0;       // of a reply that was too large
    Buffer reply;               // the record as it was sent
    std::size_t charged() const { return reply.capacity() > kSmall ? reply.capacity() : 0; }     // [bytes] beyond kSmall
    CallContext* call = nullptr;    // of a running call that is on the stack
    PendingPointer pending;     // of a running call that the service answers later
};

// A client's subscription to one object. It belongs to the session, so that the events which the client misses while its
// connection is broken are counted.
class Server::Subscription : public Subscriber {
public:
    // Makes the object when need be, which runs its class's code without the lock. Throws Error: COMM DENIED without the
    // right to inspect the object, SERVICE GONE when wanted.existing and there is none, or what making it throws. author:
    // whose rights count; null: the owner's.
    Subscription(Server& server, Session& session, const wire::Subscription& wanted, const PrincipalPointer& author);
    ~Subscription() override;
    void event(const Event& event) override;    // called when the object publishes one
    void gone() override;                       // called when the object is removed; the client gets sorma.gone
    std::string who() const override;
    void replay();                              // queue the latest events that were published before, if keep is 1

    // Append events that wait to out, until it has kEventWindow bytes. True when some are left.
    bool pump(Peer& peer, Buffer& out);
    bool waiting() const { return !items_.empty(); }
    void stopKeeping();                     // the connection broke: events are counted from now on, and not kept
    std::uint64_t takeLost() { return std::exchange(lost_, 0); }
    std::uint64_t number() const { return number_; }        // of the last event
    const std::uint32_t id;                 // chosen by the client
    bool scheduled = false;                 // it is in its peer's list events_

private:
    struct Item {
        std::shared_ptr<const Buffer> body;     // shared by all subscriptions that get the event
        std::uint64_t number, lost;
    };
    void push(std::shared_ptr<const Buffer> body);
    void end(const char* event, std::string why);
    bool mayListen();                       // check the right again after the policy has changed
    static std::size_t sizeOf(const Item& item) { return sizeof(Item) + item.body->size(); }
    bool charge();                          // charge the budget for the events that wait; false: it is exceeded
    void dropOldest();

    Server& server_;
    Session& session_;
    std::size_t own_, waits_ = 0;           // [bytes] of itself, of items_
    Charge charge_;
    const PrincipalPointer author_;
    std::uint32_t epoch_ = 0;               // of the policy by which the right was checked
    const std::string pattern_;
    Reference object_;                      // empty once it was removed or the right was lost
    std::size_t keep_;                      // events kept, at most
    std::deque<Item> items_;                // events that wait for the peer
    std::uint64_t number_ = 0, lost_ = 0;   // of the last event; events lost since the last that was sent
};

// A client that said HELLO, by the number that it has chosen.
struct Server::Session {
    ClientPointer client;                   // what services know of the client, and hold for it
    SessionKey key;
    Peer* peer = nullptr;                   // null: the connection broke, the client may come back. Only Server::link changes it
    std::int64_t lastSeen = 0;              // [ns]
    Timer graceTimer;                       // runs while there is no peer, for Settings::grace
    std::vector<Slot> slots;
    Charge held;                            // for itself, the slots, and the replies kept in them
    std::map<std::uint32_t, std::unique_ptr<Subscription>> subscriptions;      // by id

    bool running() const {
        return std::any_of(slots.begin(), slots.end(), [](auto& slot) { return slot.state == Slot::State::running; });
    }
};

// A listening socket. Owns its descriptor.
class Server::Listener : public Reactor::Watcher {
public:
    Listener(Server& server, int fd, bool tcp);
    ~Listener() override;
    void ready(std::uint32_t) override;
    int descriptor() const { return fd_; }
    bool tcp() const { return tcp_; }

private:
    Server& server_;
    int fd_;
    bool tcp_;
};

// The daemon's side of one connection. It serves requests in order: several in one turn when they came together.
class Server::Peer : public Reactor::Watcher {
public:
    // fd: connected and non-blocking; the peer owns it.   user: SessionKey::user.
    Peer(Server& server, int fd, ClientPointer who, std::int64_t user);
    ~Peer() override { closeSocket(); }

    void ready(std::uint32_t events) override;          // one turn: sends, reads and serves. May run services and the event loop
    void push(const char* data, std::size_t size);      // send now, or queue what the socket does not take. May close the peer
    void closeSocket();                        // close the socket; Server::closePeer does the rest
    bool onStack() const;               // is one of its requests being executed?
    void closeAfterReply(const std::string& reason) { closing_ = reason, interest(); }    // close it after the reply to that request
    bool open() const { return fd_ >= 0; }
    std::size_t queued() const { return out_.size() - sent_; }      // [bytes] that the socket has not taken
    void spill(Frame& frame);           // see Frame
    void schedule(Subscription& subscription);          // it has events for this peer
    void unschedule(Subscription& subscription);            // it has none any more
    // For the health responder's thread, while the SORM's thread is elsewhere: answers what needs no service. It looks at
    // the bytes in the socket and leaves them there; answered_ says which requests are not to be answered again.
    void peek();
    bool unserved() const {
        if (!in_.empty()) return true;
        for (Frame* f = server_.frames_; f; f = f->outer)
            if (f->peer == this && f->at < f->end) return true;
        return false;
    }

    // Why this peer has been slow for too long; empty when it has not.
    std::string tooSlow(std::int64_t now) const;
    // Does it owe nothing and get nothing? Then it may be closed to make room.
    bool idle() const { return in_.empty() && fragments_.size() == 0 && queued() == 0 && owed_.empty() && !(session && session->running()); }
    std::int64_t lastHeard() const { return arrived_ != 0 ? arrived_ : since; }     // [ns]
    bool slow() const { return halfSince_ != 0 || queued() > 0; }       // to be watched: see tooSlow

    // The last turn of the reactor in which it was served, and its requests in that turn. For Server::share.
    std::uint64_t turn = 0;
    int inTurn = 0;

private:
    // Reading and serving.
    void receive();                     // read once, and serve what is complete
    std::size_t appetite() const;       // [bytes] to read now
    std::size_t firstSize() const;
    std::size_t unread() const { return in_.size() - taken_; }      // [bytes] of in_ that are not served
    bool complete() const { return unread() >= std::max(firstSize(), wire::kMarkSize + 1); }
    void charge(std::size_t request, bool half);
    void serve(Frame& frame, Scratch& scratch);         // the complete requests of a turn
    bool skip(Frame& frame, Scratch& scratch, std::size_t length, const Error& why);
    Error tooLong(std::size_t length) const;
    Error overBudget(std::string_view object, Account::Use use, std::size_t bytes) const;
    bool crowded();
    void handle(std::string_view record, Scratch& scratch, Frame& frame);       // one record, by its procedure
    // One function for each procedure. Each appends its answer to the scratch buffer; flush() sends it.
    void hello(XdrReader& r, std::uint32_t xid, Buffer& out, std::int64_t now);
    std::size_t scan(const char* at, const char* end);
    void lookAhead(Frame& frame);
    // Has its caller cancelled it before it was started?
    bool cancelledBefore(std::uint32_t slot, std::uint32_t sequence) { return !cancels_.empty() && takeCancel(slot, sequence); }
    bool takeCancel(std::uint32_t slot, std::uint32_t sequence);
    void cancel(XdrReader& r);
    void subscribe(XdrReader& r, const wire::CallHeader& header, Scratch& scratch);
    // Whose rights count for a request: nobody's when it is relayed.
    const PrincipalPointer& authorOf(const wire::Behalf& behalf) const { return behalf.relayed ? Principal::nobody() : principal_; }
    struct Words;
    void call(XdrReader& r, const wire::CallHeader& header, std::string_view record, Scratch& scratch, Frame& frame);
    void oneway(XdrReader& r, const wire::CallHeader& header, Scratch& scratch, Frame& frame);
    // Call the service, without the lock. m becomes the reply, also when the service throws. True: it answers later, by
    // m.later.
    bool execute(const wire::Request& request, const wire::CallHeader& header, std::string_view record, Message& m, wire::Times& times, Slot* slot,
                 Scratch& scratch, Frame& frame);
    // Writing.
    void reply(std::uint32_t xid, const wire::Times& times, std::string_view name, Message& m, Slot* slot, Buffer& out);
    void flush(Scratch& scratch);       // send the answers of this turn
    void hold(Scratch& scratch);        // keep them for the next turn, which comes soon
    void drain();                       // send what is queued, as far as the socket takes it
    void pump();                        // write events while the queue is empty
    void interest();                    // tell the reactor what to wait for
    void refuse(std::uint32_t xid, Buffer& out, const Error& error);

    Server& server_;
    int fd_;
    const PrincipalPointer principal_;  // who is at the other end; null: the owner
    const AccountPointer account_;      // the principal's budget
    Charge request_, queue_;            // for the bytes of a request that have come, and for out_
    const std::int64_t user_;           // by Unix socket: the user, else SessionKey::kByNumber
    std::optional<std::string> closing_;    // reason to close it after the reply to the request that is being executed
    bool greeted_ = false;              // HELLO has come; a second one closes the connection
    Buffer in_;                         // requests that have come and are not served, the last one perhaps in part
    std::size_t taken_ = 0;             // [bytes] of in_ that were served. They are removed when more is read, not in each turn
    Buffer fragments_;                  // fragments of a record whose last one has not come
    int empties_ = 0;                   // so many of them were empty
    Buffer out_;                        // replies that the socket has not taken
    std::size_t sent_ = 0;              // [bytes] of out_ that were sent
    Buffer held_;                       // replies that are sent with those of its next turn
    std::size_t skip_ = 0;              // bytes of an oversized record that are still to come
    std::size_t scanned_ = 0;           // [bytes] of in_, beyond taken_, in which CANCELs were looked for
    std::vector<wire::Cancel> cancels_; // found ahead of their turn: their calls are not to be started
    PeerClock clock_;
    bool ownClock_ = false;             // its deadlines are times of its own clock
    bool peerClosed_ = false;                 // it has closed the connection; requests that it sent before may still be here
    bool dwelt_ = false;                // the last request took long: look ahead for CANCELs
    std::int64_t looked_ = 0;           // [ns] when we last did
    // [ns] since when a part of a request is here, since when the socket takes nothing, when something last came; 0: not so
    std::int64_t halfSince_ = 0, stuckSince_ = 0, arrived_ = 0;
    std::uint32_t interest_ = EPOLLIN | EPOLLRDHUP;     // what the reactor waits for
    std::uint32_t maxReply_ = UINT32_MAX;       // [bytes] longest record that the client takes
    std::deque<Subscription*> events_;  // subscriptions with events for this peer
    // Calls without a slot that are answered later: they are cancelled with the connection. One-way requests that still run.
    std::vector<std::weak_ptr<Pending>> owed_, oneway_;
    std::vector<std::uint32_t> answered_;       // xids that the health responder has answered; not to be answered again

    friend class Server;

public:
    ClientPointer client;
    Session* session = nullptr;         // null before HELLO; only Server::link changes it
    std::int64_t since;                 // [ns] when it connected
    std::uint64_t calls = 0;
    const std::uint64_t number;         // unique, while the address of a deleted peer may be used again
};

}  // namespace sorma
