// requests.h -- what a client says on one connection to a daemon, and what it is answered: HELLO, calls, one-way requests,
// CANCEL, subscriptions, HEALTH. Only the files of the server include it.
//
// Threads:  with the ServerLock held, by the SORM's thread; answerBusy by the health responder's. The lock is released while a service
//           runs.
// Errors:   nothing throws. A request that is refused is answered with the reason; one that makes no sense closes the connection.
// Owner:    its peer.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "bus/budget.h"
#include "bus/client.h"
#include "comm/clock.h"
#include "comm/server.h"

namespace sorma {

class Server::Requests {
public:
    Requests(Server& server, Peer& peer, ClientPointer who, std::int64_t user);

    // Deal with one record, which has so many bytes on the wire. Immediate answers are appended to scratch.out. May run a service, and so the
    // event loop.   record: empty when not all of it is there, see comm/apart.h.
    void handle(XdrReader& r, std::string_view record, std::size_t size, Scratch& scratch, Frame& frame);
    // Answer what needs no service, while the SORM's thread is elsewhere. handle() then skips it. False: it is no request.
    bool answerBusy(std::string_view record, Buffer& out);
    // Note which calls are cancelled by whole records that have come and wait for their turn. Returns the size of those.
    std::size_t scan(const char* at, const char* end);
    // Append an answer.   lent: as XdrWriter's; null: all of it is to be in out.
    void refuse(std::uint32_t xid, Buffer& out, const Error& error);
    void reply(std::uint32_t xid, const wire::Times& times, std::string_view name, Message& m, ReplySlot* slot, Buffer& out, const SpanPointer& span = nullptr,
               record::Lent* lent = nullptr);
    // A call without a slot is answered later: it is cancelled with the connection.
    void owe(const PendingPointer& pending);
    void closed();                      // the connection is
    bool idle() const;                  // is nothing under way?
    Error overBudget(std::string_view object, std::size_t bytes) const;

    // Only before the first request: it has become known who is at the other end.
    void become(ClientPointer who, std::int64_t as);

    PrincipalPointer principal;         // who is at the other end; null: the owner
    AccountPointer account;             // the principal's budget
    std::int64_t user;                  // SessionKey::user
    ClientPointer client;
    Session* session = nullptr;         // null before HELLO; only Sessions::link changes it
    std::uint64_t calls = 0;
    bool greeted = false;               // HELLO has come; a second one closes the connection

private:
    // One function for each procedure. Each appends its answer to the scratch buffer, or throws why it refuses.
    void dispatch(XdrReader& r, const wire::CallHeader& header, std::string_view record, std::size_t size, Scratch& scratch, Frame& frame);
    void hello(XdrReader& r, std::uint32_t xid, Buffer& out, std::int64_t now);
    void cancel(XdrReader& r);
    void subscribe(XdrReader& r, const wire::CallHeader& header, Buffer& out);
    void call(XdrReader& r, const wire::CallHeader& header, std::string_view record, std::size_t size, Scratch& scratch, Frame& frame);
    void oneway(XdrReader& r, const wire::CallHeader& header, std::size_t size, Scratch& scratch, Frame& frame);
    // Call the service, without the lock. m becomes the reply, also when the service throws. True: it answers later, by
    // m.later.
    bool execute(const wire::Request& request, const wire::CallHeader& header, std::string_view record, Message& m, wire::Times& times, ReplySlot* slot,
                 Scratch& scratch, Frame& frame);
    void failed(const wire::Request& request, std::string_view record, Message& m, bool reached);
    // Has its caller cancelled it before it was started?
    bool cancelledBefore(std::uint32_t slot, std::uint32_t sequence) { return !cancels_.empty() && takeCancel(slot, sequence); }
    bool takeCancel(std::uint32_t slot, std::uint32_t sequence);
    ReplySlot* running(const wire::Cancel& wanted) const;
    // Says whose rights count for a request: the peer's, and for a relayed one also its author's. The author is anyone unless
    // the peer has the right to relay to that object.
    PrincipalPointer authorOf(const wire::Behalf& behalf, std::string_view object) const {
        return behalf.relayed ? relayed(behalf, object) : principal;
    }
    PrincipalPointer relayed(const wire::Behalf& behalf, std::string_view object) const;
    std::size_t wordsOf(const XdrReader& r, std::size_t record) const;
    void needShort(const char* what, std::size_t size) const;
    void needRoom(std::string_view name, std::size_t bytes, bool slot);
    bool crowded();
    bool wrongCredentials(const wire::CallHeader& header, Buffer& out) const;
    void writeTraced(std::uint32_t xid, const wire::Times& times, const Message& m, const Span& span, Buffer& out, std::size_t start,
                     record::Lent* lent);

    Server& server_;
    Peer& peer_;
    std::vector<wire::Cancel> cancels_; // found ahead of their turn: their calls are not to be started
    PeerClock clock_;
    bool ownClock_ = false;             // its deadlines are times of its own clock
    std::uint32_t maxReply_ = UINT32_MAX;       // [bytes] longest record that the client takes
    std::vector<std::weak_ptr<Pending>> owed_, oneway_;         // see owe(); one-way requests that still run
    std::vector<std::uint32_t> answered_;       // xids that the health responder has answered; not to be answered again
};

}  // namespace sorma
