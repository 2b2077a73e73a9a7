// sessions.h -- the clients of a daemon that said HELLO. Only the files of the server include it.
//
//     Session    one client; it outlives a connection that breaks
//     ReplySlot  one call of a session at a time, and its last reply
//     Later      a call that a service answers later: who gets the reply
//
//             HELLO           its connection is closed            grace is over
//     none ----------> linked -----------------------> suspended --------------> left ----------> none
//                        ^             HELLO              |                        |     when it is old
//                        +--------------------------------+------------------------+
//
// One that has left holds nothing and calls nothing any more. Its last replies are still kept, in case that it comes back.
//
// Threads:  with the ServerLock held, by the SORM's thread; the health responder's greets clients that are not known yet.
// Re-entry: while a request is executed the lock is released, and the service may run the event loop. Afterwards the session may
//           have another peer, or be removed: find() the slot again.
// Owner:    the server owns the sessions, a session its slots and subscriptions.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "bus/budget.h"
#include "bus/client.h"
#include "bus/kept.h"
#include "comm/server.h"

namespace sorma {

struct Server::ReplySlot {
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
    // Is a call with this number a new one? A number may be missing: its request was cancelled, or refused before it had a slot.
    bool begins(std::uint32_t number) const {
        return state == State::empty || (state != State::running && std::int32_t(number - sequence) > 0);
    }
    std::size_t charged() const { return reply.capacity() > kSmall ? reply.capacity() : 0; }     // [bytes] beyond kSmall
    CallContext* call = nullptr;    // of a running call that is on the stack
    PendingPointer pending;     // of a running call that the service answers later
};

// Identifies a session: its user and the number that the client has chosen. By Unix socket the user counts; with TLS the
// certificate, by its authority's key and its name; by TCP the number is a secret. So a client of one kind cannot take over a session of
// another kind, and nobody that of another certificate.
struct Server::SessionKey {
    std::int64_t user = kByNumber;
    std::uint64_t number = 0;
    static constexpr std::int64_t kByNumber = -1;          // less: the number of a certificate, as Sessions::numberOf
    bool operator==(const SessionKey&) const = default;
};

struct Server::Session {
    ClientPointer client;                   // what services know of the client, and hold for it
    SessionKey key;
    Peer* peer = nullptr;                   // null: the connection broke, the client may come back. Only Sessions::link changes it
    std::int64_t lastSeen = 0;              // [ns]
    Timer graceTimer;                       // runs while there is no peer, for Settings::grace
    bool direct = false;                    // by Unix socket, with no tunnel between: the peer is the process that it says it is
    std::vector<ReplySlot> slots;
    // Memory of itself, of the slots, and of the replies that are kept in them [bytes].
    struct Held {
        std::size_t slots = 0, replies = 0;
        std::size_t heap() const { return sizeof(Session) + 1024 + 4 * kKeptName + slots + replies; }
    };
    Charged<Held> held;
    std::map<std::uint32_t, std::unique_ptr<Subscription>> subscriptions;      // by id

    bool running() const {
        return std::any_of(slots.begin(), slots.end(), [](auto& slot) { return slot.state == ReplySlot::State::running; });
    }
};

// Says who gets a reply that comes later.
struct Server::Later {
    Peer* peer;                             // perhaps deleted: see Server::findPeer
    std::uint64_t peerNumber;
    SessionKey session;
    std::uint32_t slot, sequence, xid;
    std::size_t size;                       // of the request [bytes]
    std::int64_t started;                   // [ns]
    SpanPointer span = nullptr;             // when it is traced
};

class Server::Sessions {
public:
    explicit Sessions(Server& server);
    ~Sessions();

    // A client has said HELLO: make its session, or link the one that it has.
    Session& greet(Peer& peer, const wire::Hello& hello, bool& known);
    std::int64_t numberOf(const Principal& certificate);        // SessionKey::user
    bool knows(const SessionKey& key) const { return all_.contains(key); }
    // Its connection is closed. It may come back; what it holds, and its calls, stay for a while.
    void suspend(Session& session);
    void judge();                           // the policy has changed: take what it does not allow any more
    void outdated();                        // as Server::outdated
    void end();                             // the server stops: cancel calls, release what clients hold
    std::size_t size() const { return all_.size(); }
    std::size_t underway() const { return underway_; }      // calls that services answer later

    // The slot for a call. Throws COMM LIMIT when the client may not have so many.
    ReplySlot& slot(Session& session, const wire::Request& request) {
        return request.slot < session.slots.size() ? session.slots[request.slot] : addSlots(session, request);
    }
    // The client has sent it before: append what it is told to out. Throws COMM PROTOCOL, COMM LOST.
    void repeat(ReplySlot& slot, const wire::Request& request, std::uint32_t xid, Buffer& out);
    ReplySlot* find(const Later& later);         // of a call that is under way; null: it has none, or its session is no more
    void answerLater(ReplySlot& slot, PendingPointer pending);
    void keep(ReplySlot& slot, const char* record, std::size_t size);       // the reply, as it was sent. null: it is too long
    // A reply is there. Has the client asked again while the call ran? Then it goes where he is now, unless it went there already.
    void replyAgain(ReplySlot& slot, const Peer* answered);

private:
    struct Hash {
        std::size_t operator()(const SessionKey& k) const {
            return std::hash<std::uint64_t>{}(k.number ^ std::uint64_t(k.user) * 0x9e3779b97f4a7c15u);
        }
    };
    void link(Session& session, Peer* peer);
    ReplySlot& addSlots(Session& session, const wire::Request& request);
    void awaitReturn(Session& session);
    void leave(Session& session);           // it has not come back: cancel its calls, release what it holds
    void removeOld();
    void freeReply(ReplySlot& slot);

    Server& server_;
    std::unordered_map<SessionKey, std::unique_ptr<Session>, Hash> all_;
    std::size_t underway_ = 0;
    std::map<std::string, std::int64_t> certificates_;
};

}  // namespace sorma
