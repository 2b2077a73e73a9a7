#include "comm/sessions.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "comm/clock.h"
#include "comm/errors.h"
#include "comm/peer.h"
#include "comm/subscription.h"

namespace sorma {

namespace {

constexpr std::size_t kKeepBuffer = 4096;               // [bytes] a slot's reply that is not larger stays where it is
constexpr std::size_t kOrphans = 1000;                  // sessions without a connection that are remembered
constexpr std::int64_t kLook = 20'000'000;              // [ns] until the first look whether the process of a client has ended
constexpr std::int64_t kOrphanAge = 600'000'000'000;    // [ns]

const Prototype kSlots{Severity::error, "COMM LIMIT", 0,
    "slot {} is beyond the {} calls in flight that this daemon takes from one client; raise it there: sorma::configure -inflight N"};

}  // namespace

Server::Sessions::Sessions(Server& server) : server_(server) {}
Server::Sessions::~Sessions() = default;

std::int64_t Server::Sessions::numberOf(const Principal& certificate) {
    const std::string key = certificate.authority() + ' ' + certificate.certificate();
    return certificates_.emplace(key, SessionKey::kByNumber - 1 - std::int64_t(certificates_.size())).first->second;
}

// The only place where a session gets a peer, or loses it (null).
void Server::Sessions::link(Session& s, Peer* peer) {
    Peer* old = std::exchange(s.peer, peer);
    if (old && old != peer) old->requests.session = nullptr;
    if (peer) peer->requests.session = &s;
}

Server::Session& Server::Sessions::greet(Peer& peer, const wire::Hello& hello, bool& known) {
    Requests& requests = peer.requests;
    Caller who = requests.client->caller;
    if (requests.user == SessionKey::kByNumber) {
        who.user = hello.user;
        who.host = hello.host;
    }
    if (requests.user < 0) who.process = hello.process;         // nobody vouches for it
    who.program = hello.program;
    const SessionKey key{requests.user, hello.client};
    auto& mine = all_[key];
    known = mine != nullptr;
    if (!mine) {
        mine = std::make_unique<Session>();
        mine->key = key;
        mine->client = requests.client;
        mine->held = Charged<Session::Held>::forced(requests.account, Account::Use::replies, {});
    }
    Session& s = *mine;
    Peer* old = s.peer;
    if (old)                                            // as when its connection had broken: what waits there is lost
        for (auto& [id, subscription] : s.subscriptions) subscription->stopKeeping();
    link(s, &peer);
    if (old) server_.closePeer(old, "the same client has come by another connection", false);
    s.client->caller = std::move(who);
    s.client->principal = requests.principal;
    if (requests.client != s.client)                    // what the client held before its HELLO
        server_.sorm_.mailbox()->post([before = requests.client] { before->end(); });
    requests.client = s.client;
    s.direct = requests.user >= 0 && s.client->caller.process == hello.process;
    s.lastSeen = monotonicNow();
    server_.sorm_.mailbox()->post([&sorm = server_.sorm_, who = s.client->caller.toText()] { sorm.announce("connection.opened", who); });
    if (!server_.watched_) {
        s.graceTimer.cancel();
        removeOld();
    }
    return s;
}

void Server::Sessions::suspend(Session& s) {
    link(s, nullptr);
    s.lastSeen = monotonicNow();
    for (auto& [id, subscription] : s.subscriptions) subscription->stopKeeping();
    if (!s.graceTimer && !server_.stopping_) awaitReturn(s);
}

// For Settings::grace. A process that has ended does not come back. It closes its socket a little before its end, so look
// again, each time after twice as long.
void Server::Sessions::awaitReturn(Session& s) {
    const std::int64_t end = s.lastSeen + server_.settings_.grace * 1'000'000, now = monotonicNow();
    const std::int64_t next = s.direct ? std::min(end, now + std::max(kLook, now - s.lastSeen)) : end;
    s.graceTimer = server_.reactor_.after(next, [this, key = s.key, end] {
        ServerLock::Held held(server_.lock_);
        auto found = all_.find(key);
        if (found == all_.end() || found->second->peer) return;
        Session& s = *found->second;
        s.graceTimer.cancel();
        if (monotonicNow() < end && !hasEnded(s.client->caller.process, processesSeen())) return awaitReturn(s);
        leave(s);
    });
}

void Server::Sessions::judge() {
    std::vector<ClientPointer> clients;
    {
        ServerLock::Held held(server_.lock_);
        for (auto& [key, session] : all_) {
            for (auto& [id, subscription] : session->subscriptions) subscription->judge();
            clients.push_back(session->client);
        }
    }
    for (auto& client : clients) client->judge(server_.sorm_.access);
}

// One who has lost his connection asks again after the next HELLO.
void Server::Sessions::outdated() {
    Buffer record;
    wire::writeOutdated(record);
    std::vector<Peer*> peers;
    for (auto& [key, session] : all_)
        if (session->peer && std::exchange(session->client->checksAhead, false)) peers.push_back(session->peer);
    for (auto* peer : peers)
        if (peer->open()) peer->push(record.data(), record.size());
}

void Server::Sessions::end() {
    std::vector<PendingPointer> pending;
    {
        ServerLock::Held held(server_.lock_);
        for (auto& [key, session] : all_)
            for (auto& slot : session->slots)
                if (slot.pending) pending.push_back(std::move(slot.pending));
        underway_ = 0;
    }
    for (auto& p : pending) p->cancel(errors::trailOf(errors::kClientGone, p->who));
    std::vector<ClientPointer> clients;
    {
        ServerLock::Held held(server_.lock_);
        for (auto& [key, session] : all_) clients.push_back(session->client);
    }
    for (auto& client : clients) client->end();
    for (auto& [key, session] : all_) session->subscriptions.clear();
}

void Server::Sessions::leave(Session& s) {
    auto client = std::exchange(s.client, std::make_shared<Client>(s.client->caller, s.client->principal));
    std::vector<PendingPointer> pending;
    std::vector<CallContext*> running;      // on the stack below, and so it stays
    for (auto& slot : s.slots) {
        if (slot.pending) pending.push_back(slot.pending);
        if (slot.call) running.push_back(slot.call);
    }
    auto subscriptions = std::exchange(s.subscriptions, {});
    // Replies that it may still ask for must not use up the budget of other clients of the same principal.
    const Account& account = *s.held.account();
    for (auto& slot : s.slots) {
        if (account.used() <= account.limit() / 2) break;
        if (slot.state != ReplySlot::State::done || slot.reply.capacity() <= kKeepBuffer) continue;
        slot.state = ReplySlot::State::tooLarge;
        slot.size = slot.reply.size();
        freeReply(slot);
    }
    ServerLock::Released released(server_.lock_);
    subscriptions.clear();
    for (auto* call : running) call->cancel();
    for (auto& p : pending) p->cancel(errors::trailOf(errors::kClientGone, p->who));
    client->end();
}

void Server::Sessions::removeOld() {
    const std::size_t most = server_.peers_.size() + kOrphans;
    if (all_.size() <= most) return;
    std::int64_t now = monotonicNow();
    std::vector<std::pair<std::int64_t, SessionKey>> orphans;
    for (auto& [key, session] : all_)
        if (!session->peer && !session->running() && !session->graceTimer) orphans.emplace_back(session->lastSeen, key);
    std::sort(orphans.begin(), orphans.end(), [](auto& a, auto& b) { return a.first < b.first; });
    for (auto& [seen, key] : orphans) {
        if (now - seen <= kOrphanAge && all_.size() <= most) return;
        all_.erase(key);
    }
}

// ---- slots ----

Server::ReplySlot& Server::Sessions::addSlots(Session& s, const wire::Request& request) {
    if (request.slot >= static_cast<std::uint64_t>(server_.settings_.inFlight)) fail(kSlots, request.slot, server_.settings_.inFlight);
    const std::size_t more = (request.slot + 1 - s.slots.size()) * (sizeof(ReplySlot) + ReplySlot::kSmall);
    Account& account = *s.peer->requests.account;
    if (!account.fits(more)) throw Error(account.refusal(std::string(request.name), Account::Use::replies, more));
    s.held.edit([&](auto& held) { held.slots += more; });
    while (s.slots.size() <= request.slot) s.slots.emplace_back().of = &s;
    return s.slots[request.slot];
}

void Server::Sessions::repeat(ReplySlot& slot, const wire::Request& request, std::uint32_t xid, Buffer& out) {
    if (request.sequence != slot.sequence) fail(errors::kSequence, request.name, request.sequence, request.slot, slot.sequence);
    if (slot.state == ReplySlot::State::tooLarge) fail(errors::kReplyGone, request.name, slot.size, "daemon " + server_.name_);
    if (slot.state == ReplySlot::State::running) {
        slot.asked = true;
        slot.askedXid = xid;
    } else {
        const std::size_t at = out.size();
        out.append(slot.reply.data(), slot.reply.size());
        wire::setXid(out.data() + at, xid);
    }
}

Server::ReplySlot* Server::Sessions::find(const Later& later) {
    if (later.slot == wire::kNoSlot) return nullptr;
    auto found = all_.find(later.session);
    if (found == all_.end() || later.slot >= found->second->slots.size()) return nullptr;
    ReplySlot& slot = found->second->slots[later.slot];
    return slot.state == ReplySlot::State::running && slot.sequence == later.sequence ? &slot : nullptr;
}

void Server::Sessions::answerLater(ReplySlot& slot, PendingPointer pending) {
    if (bool(pending) == bool(slot.pending)) return;
    pending ? ++underway_ : --underway_;
    slot.pending = std::move(pending);
}

// The memory is charged. It stays from one reply to the next, so replies of the same size cost nothing more.
void Server::Sessions::keep(ReplySlot& slot, const char* record, std::size_t size) {
    if (slot.reply.capacity() > kKeepBuffer && size <= kKeepBuffer) freeReply(slot);
    if (size > slot.reply.capacity() || !record) {
        freeReply(slot);
        // Some room stays for requests, without which kept replies are of no use.
        auto& held = slot.of->held;
        const Account& account = *held.account();
        bool fits = size <= ReplySlot::kSmall ||
                    (record && size <= static_cast<std::size_t>(server_.settings_.keepReply) &&
                     account.used() + size <= account.limit() - account.limit() / 4 && account.fits(size));
        if (!fits) {
            slot.state = ReplySlot::State::tooLarge;
            slot.size = size;
            return;
        }
        if (size > ReplySlot::kSmall) held.edit([&](auto& h) { h.replies += size; });
    }
    slot.state = ReplySlot::State::done;
    slot.reply.resize(size);                            // exactly, when it is new
    std::memcpy(slot.reply.data(), record, size);
}

void Server::Sessions::freeReply(ReplySlot& slot) {
    slot.of->held.edit([&](auto& h) { h.replies -= slot.charged(); });
    slot.reply.release();
}

void Server::Sessions::replyAgain(ReplySlot& slot, const Peer* answered) {
    if (!std::exchange(slot.asked, false)) return;
    Peer* now = slot.of->peer;
    if (!now || now == answered || slot.state != ReplySlot::State::done) return;
    wire::setXid(slot.reply.data(), slot.askedXid);
    now->push(slot.reply.data(), slot.reply.size());
}

}  // namespace sorma
