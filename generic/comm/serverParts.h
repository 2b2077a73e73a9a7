// serverParts.h -- what a server is made of: peers, sessions with their slots, subscriptions. Only server.cpp, peer.cpp,
// subscription.cpp and healthResponder.cpp include it. Everything here is touched with the lock held.
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

inline constexpr std::size_t kReadSize = 64 * 1024;
inline constexpr std::size_t kMostGrowth = 8 << 20;     // of a long request, in one turn
inline constexpr int kBatch = 64;                       // requests of one peer in one turn, at most
inline constexpr std::size_t kQueueLimit = 1 << 20;     // of replies not taken, before we stop reading a peer
inline constexpr std::size_t kEventWindow = 64 * 1024;  // of events that wait in a peer's queue
inline constexpr std::size_t kHold = 4096;              // of replies that wait for the next turn of a peer who has asked for more
inline constexpr std::size_t kFlushAt = 256 * 1024;     // of replies written, before they are sent
inline constexpr std::size_t kKeepBuffer = 4096;        // a peer's own buffers may stay this large when empty
inline constexpr std::size_t kKeepSpare = 4 << 20;      // buffers that all peers share, kept for the next long message

// Buffers of one depth of serving.
struct Server::Scratch {
    char in[kReadSize];
    Buffer out;
    Message message;
};

// One peer's turn, on the stack. When a service runs the event loop, the turns below hand what they have not served
// yet to their peers (spill), so that the inner loop can go on with them in order.
struct Server::Frame {
    Peer* peer;
    const char* at;
    const char* end;
    const char* scanned;        // up to here it is known what has been cancelled
    bool inPeer;                // at and end point into the peer's own buffer
    bool spilled = false;
    Frame* outer;
    int served = 0;             // calls executed in this turn
};

struct Server::Slot {
    static constexpr std::size_t kSmall = 256;              // reply that a slot is charged with from the beginning
    enum class State : std::uint8_t { empty, running, done, tooLarge };
    std::uint32_t sequence = 0;
    State state = State::empty;
    Session* of = nullptr;
    bool asked = false;         // the client asks again while the call runs: send the reply where it is now
    std::uint32_t askedXid = 0;
    std::size_t size = 0;
    Buffer reply;               // the record as it was sent
    std::size_t charged() const { return reply.capacity() > kSmall ? reply.capacity() : 0; }     // beyond that
    CallContext* call = nullptr;    // running, and on the stack
    PendingPointer pending;     // running, and taken over by the service
};

// One listener to one object, for one client. It stays with the session, so that what a client misses while its
// connection is broken is counted.
class Server::Subscription : public Subscriber {
public:
    // author: who named the object.
    Subscription(Server& server, Session& session, const wire::Subscription& wanted, const PrincipalPointer& author);
    ~Subscription() override;
    void event(const Event& event) override;
    void gone() override;
    void replay();                          // who wants the latest alone gets what has been published before

    // Write what waits, as far as the peer has room. True when something is left.
    bool pump(Peer& peer, Buffer& out);
    bool waiting() const { return !items_.empty(); }
    void stopKeeping();                     // the connection is gone: count, keep nothing
    std::uint64_t takeLost() { return std::exchange(lost_, 0); }
    std::uint64_t number() const { return number_; }
    const std::uint32_t id;
    bool scheduled = false;                 // in its peer's list

private:
    struct Item {
        std::shared_ptr<const Buffer> body;
        std::uint64_t number, lost;
    };
    void push(std::shared_ptr<const Buffer> body);
    void end(const char* event, std::string why);
    bool mayListen();
    static std::size_t sizeOf(const Item& item) { return sizeof(Item) + item.body->size(); }
    bool charge();                          // for what waits; false: too much
    void dropOldest();

    Server& server_;
    Session& session_;
    std::size_t own_, waits_ = 0;           // [bytes] of itself, of items_
    Charge charge_;
    const PrincipalPointer author_;
    std::uint32_t epoch_ = 0;               // of the policy that allows it
    const std::string pattern_;
    Reference object_;
    std::size_t keep_;
    std::deque<Item> items_;
    std::uint64_t number_ = 0, lost_ = 0;
};

struct Server::Session {
    ClientPointer client;
    SessionKey key;
    Peer* peer = nullptr;                   // null: the connection is gone, the client may come back. See Server::link
    std::int64_t lastSeen = 0;
    Timer graceTimer;
    std::vector<Slot> slots;
    Charge held;                            // for itself, the slots, and the replies kept in them
    std::map<std::uint32_t, std::unique_ptr<Subscription>> subscriptions;

    bool running() const {
        return std::any_of(slots.begin(), slots.end(), [](auto& slot) { return slot.state == Slot::State::running; });
    }
};

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

class Server::Peer : public Reactor::Watcher {
public:
    Peer(Server& server, int fd, ClientPointer who, std::int64_t user);
    ~Peer() override { shut(); }

    void ready(std::uint32_t events) override;
    void push(const char* data, std::size_t size);      // send now, or queue what the socket does not take
    void shut();
    bool onStack() const;               // is one of its requests executed?
    void leave(const std::string& reason) { leaving_ = reason, interest(); }    // when that has been answered
    bool open() const { return fd_ >= 0; }
    std::size_t queued() const { return out_.size() - sent_; }
    void spill(Frame& frame);
    void schedule(Subscription& subscription);          // it has something for this peer
    void forget(Subscription& subscription);
    // The health responder's look, while the SORM's thread is elsewhere: answers what needs no service. Reads without taking.
    void peek();
    bool unserved() const {
        if (!in_.empty()) return true;
        for (Frame* f = server_.frames_; f; f = f->outer)
            if (f->peer == this && f->at < f->end) return true;
        return false;
    }

    // Why this peer has been slow for too long; empty when it has not.
    std::string tooSlow(std::int64_t now) const;
    bool idle() const { return in_.empty() && fragments_.size() == 0 && queued() == 0 && owed_.empty() && !(session && session->running()); }
    std::int64_t lastHeard() const { return arrived_ != 0 ? arrived_ : since; }
    bool slow() const { return halfSince_ != 0 || queued() > 0; }

    // What it got in the last turn of the reactor that served it: the server's, for everybody's share.
    std::uint64_t turn = 0;
    int inTurn = 0;

private:
    void receive();
    std::size_t appetite() const;
    std::size_t firstSize() const;
    std::size_t unread() const { return in_.size() - taken_; }
    bool complete() const { return unread() >= std::max(firstSize(), wire::kMarkSize + 1); }
    void charge(std::size_t request, bool half);
    void serve(Frame& frame, Scratch& scratch);
    bool skip(Frame& frame, Scratch& scratch, std::size_t length, const Error& why);
    Error tooLong(std::size_t length) const;
    Error overBudget(std::string_view object, Account::Use use, std::size_t bytes) const;
    bool crowded();
    void handle(std::string_view record, Scratch& scratch, Frame& frame);
    void hello(XdrReader& r, std::uint32_t xid, Buffer& out, std::int64_t now);
    std::size_t scan(const char* at, const char* end);
    void lookAhead(Frame& frame);
    // Has its caller given it up already?
    bool forgotten(std::uint32_t slot, std::uint32_t sequence) { return !cancels_.empty() && takeCancel(slot, sequence); }
    bool takeCancel(std::uint32_t slot, std::uint32_t sequence);
    void cancel(XdrReader& r);
    void subscribe(XdrReader& r, const wire::CallHeader& header, Scratch& scratch);
    const PrincipalPointer& authorOf(const wire::Behalf& behalf) const { return behalf.relayed ? Principal::nobody() : principal_; }
    struct Words;
    void call(XdrReader& r, const wire::CallHeader& header, std::string_view record, Scratch& scratch, Frame& frame);
    void oneway(XdrReader& r, const wire::CallHeader& header, Scratch& scratch, Frame& frame);
    // True: the service answers later, m.later says.
    bool execute(const wire::Request& request, const wire::CallHeader& header, std::string_view record, Message& m, wire::Times& times, Slot* slot,
                 Scratch& scratch, Frame& frame);
    void reply(std::uint32_t xid, const wire::Times& times, std::string_view name, Message& m, Slot* slot, Buffer& out);
    void flush(Scratch& scratch);
    void hold(Scratch& scratch);
    void drain();
    void pump();
    void interest();
    void refuse(std::uint32_t xid, Buffer& out, const Error& error);

    Server& server_;
    int fd_;
    const PrincipalPointer principal_;  // who writes what comes here; null: the owner
    const AccountPointer account_;      // to which he is charged
    Charge request_, queue_;            // for what has come of a request, and for out_
    const std::int64_t user_;           // by Unix socket: the user, else SessionKey::kByNumber
    std::optional<std::string> leaving_;    // why it goes, when its request that is executed has been answered
    bool greeted_ = false;              // it has said HELLO, which may be said once
    Buffer in_;                         // what has come and waits for its turn: requests, the last one perhaps in part
    std::size_t taken_ = 0;             // of in_: served. Moved out of the way when more is read, not in each turn
    Buffer fragments_;                  // fragments of a record that came before its last one
    int empties_ = 0;                   // of which so many were empty
    Buffer out_;                        // replies that the socket has not taken
    std::size_t sent_ = 0;              // of out_
    Buffer held_;                       // replies that go with those of its next turn
    std::size_t skip_ = 0;              // bytes of an oversized record still to come
    std::size_t scanned_ = 0;           // of in_, beyond taken_: known what has been cancelled
    std::vector<wire::Cancel> cancels_; // that have come, and whose turn has not: what they are for is not begun
    PeerClock clock_;
    bool ownClock_ = false;             // its deadlines are times of its own clock
    bool gone_ = false;                 // it has closed the connection, though more of what it sent is there
    bool dwelt_ = false;                // the last request took long: look what has come meanwhile
    std::int64_t looked_ = 0;           // [ns] when we last did
    std::int64_t halfSince_ = 0, stuckSince_ = 0, arrived_ = 0;
    std::uint32_t interest_ = EPOLLIN | EPOLLRDHUP;
    std::uint32_t maxReply_ = UINT32_MAX;
    std::deque<Subscription*> events_;  // those with something for this peer
    // Calls without a slot that are answered later: they end with the connection. And those that nobody waits for.
    std::vector<std::weak_ptr<Pending>> owed_, oneway_;
    std::vector<std::uint32_t> answered_;       // by the health responder: xids that are not to be answered again

    friend class Server;

public:
    ClientPointer client;
    Session* session = nullptr;         // see Server::link
    std::int64_t since;
    std::uint64_t calls = 0;
    const std::uint64_t number;         // never used again, as an address may be
};

}  // namespace sorma
