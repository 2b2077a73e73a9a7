#include "comm/requests.h"

#include <algorithm>

#include "bus/kept.h"
#include "bus/lateSpans.h"
#include "bus/request.h"
#include "bus/requestText.h"
#include "bus/statistics.h"
#include "comm/errors.h"
#include "comm/peer.h"
#include "comm/subscription.h"
#include "comm/wireSpan.h"

namespace sorma {

namespace {

constexpr std::size_t kWordy = 16 * 1024;               // [bytes] of a record that is too short to have too many words
constexpr std::int64_t kQuick = 20'000;                 // [ns] a call this short does not hold up replies before it

const Prototype kHelloFirst{Severity::error, "COMM PROTOCOL", 0, "{} needs a session: say HELLO first"};
const Prototype kCalls{Severity::error, "COMM LIMIT", 1,
    "{}: {} calls of this connection are under way, as many as this daemon takes from one client; raise it there: sorma::configure -inflight N"};
const Prototype kDropped{Severity::warning, "COMM LIMIT", 1, "{}: a one-way request of {} was dropped: {}"};
const Prototype kNoRoom{Severity::error, "COMM TOO_BIG", 1,
    "{}: the request was executed, but its reply of {} bytes cannot wait for the client: {} may make this daemon keep {} bytes and has {}; "
    "raise it there: sorma::configure -budget BYTES"};
const Prototype kBehalf{Severity::error, "COMM PROTOCOL", 0, "the credentials do not say on whose behalf the call is made"};
const Prototype kLongName{Severity::error, "COMM LIMIT", 1, "{}: a request came whose {} has {} bytes; it may have {}"};
const Prototype kManyWords{Severity::error, "COMM LIMIT", 1,
    "{}: a request came with {} words of {} bytes in all; it may have {} words of {} bytes: put what is long into TMSG, FMSG, IMSG or AMSG"};
const Prototype kNotBegun{Severity::error, "COMM CANCELLED", 1, "{}: the call was cancelled by its caller before it was started; it was not executed"};

std::uint32_t microseconds(std::int64_t nanoseconds) { return static_cast<std::uint32_t>(std::min<std::int64_t>(nanoseconds / 1000, UINT32_MAX)); }

}  // namespace

Server::Requests::Requests(Server& server, Peer& peer, ClientPointer who, std::int64_t user)
    : principal(who->principal), account(server.sorm_.budget.of(principal)), user(user), client(std::move(who)), server_(server), peer_(peer) {}

void Server::Requests::become(ClientPointer who, std::int64_t as) {
    principal = who->principal;
    account = server_.sorm_.budget.of(principal);
    user = as;
    client = std::move(who);
}

PrincipalPointer Server::Requests::relayed(const wire::Behalf& behalf, std::string_view object) const {
    Sorm& sorm = server_.sorm_;
    PrincipalPointer author = Principal::nobody();
    const bool may = !principal || (sorm.access.rights(principal, sorm.canonical(object)) & Rights(Right::relay));
    // Users of another host are not ours.
    const bool ofHere = !principal || principal->kind() == Principal::Kind::user || principal->kind() == Principal::Kind::local;
    const bool certified = principal && principal->kind() == Principal::Kind::cert && behalf.author.starts_with("cert ");
    if (may && (ofHere || certified || behalf.author.starts_with("host "))) author = Principal::parse(behalf.author);
    return Principal::both(principal, author);
}

// The memory that the words of a request will need. Throws when there is too much in names and words.
std::size_t Server::Requests::wordsOf(const XdrReader& r, std::size_t record) const {
    if (record <= kWordy) [[likely]] return 0;
    const wire::Extent extent = wire::extentOf(r);
    needShort("name", extent.name);
    if (extent.words > wire::kMost.words || extent.bytes > wire::kMost.bytes)
        fail(kManyWords, server_.name_, extent.words, extent.bytes, wire::kMost.words, wire::kMost.bytes);
    return extent.memory();
}

void Server::Requests::needShort(const char* what, std::size_t size) const {
    if (size > wire::kMost.name) fail(kLongName, server_.name_, what, size, wire::kMost.name);
}

// May its principal have one more request under way?
void Server::Requests::needRoom(std::string_view name, std::size_t bytes, bool slot) {
    if (account->over()) [[unlikely]] throw overBudget(name, bytes);
    if (!slot && crowded()) [[unlikely]] fail(kCalls, name, server_.settings_.inFlight);
}

Error Server::Requests::overBudget(std::string_view object, std::size_t bytes) const {
    return Error(account->refusal(std::string(object), Account::Use::requests, bytes));
}

// ---- what it is ----

[[gnu::always_inline]] inline void Server::Requests::dispatch(XdrReader& r, const wire::CallHeader& header, std::string_view record, std::size_t size,
                                                                  Scratch& scratch, Frame& frame) {
    switch (header.procedure) {
        case wire::kNull: return wire::writeEmptyReply(scratch.out, header.xid);
        case wire::kCall: return call(r, header, record, size, scratch, frame);
        case wire::kHello: return hello(r, header.xid, scratch.out, peer_.arrived());
        case wire::kOneway: return oneway(r, header, size, scratch, frame);
        case wire::kCancel: return cancel(r);
        case wire::kClock:
            if (std::int64_t sent; wire::readClock(r, sent)) clock_.sample(sent, peer_.arrived());
            return;
        case wire::kHealth: return wire::writeHealth(scratch.out, header.xid, server_.health(false, *this));
        case wire::kSubscribe: return subscribe(r, header, scratch.out);
        case wire::kUnsubscribe:
            if (session) session->subscriptions.erase(r.u32());
            return;
        default: return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::procedureUnavailable);
    }
}

void Server::Requests::handle(XdrReader& r, std::string_view record, std::size_t size, Scratch& scratch, Frame& frame) {
    auto envelope = wire::readEnvelope(r);
    if (!r.good()) return server_.closePeer(&peer_, "what came is not a message of ONC RPC", true);
    if (envelope.kind != 0) return;                 // a reply: we have asked nothing
    auto header = wire::readCallHeader(r, envelope.xid);
    if (!r.good()) return wire::writeRefusal(scratch.out, envelope.xid, wire::Refusal::garbage);
    if (header.rpcVersion != 2) return wire::writeRpcMismatch(scratch.out, header.xid);
    if (wrongCredentials(header, scratch.out)) [[unlikely]] return;
    bool ours = header.program == wire::kProgram ||
                (server_.program_ != 0 && header.program == wire::kProgramBase + server_.program_);
    if (!ours) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programUnavailable);
    if (header.version != wire::kVersion) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programMismatch);
    if (!answered_.empty() && std::erase(answered_, header.xid) > 0) return;       // by the health responder
    try {
        dispatch(r, header, record, size, scratch, frame);
    } catch (const Error& e) {
        refuse(header.xid, scratch.out, e);
    }
}

// RFC 9289: the probe belongs to NULL, and before TLS. Answers it when it does not, or when TLS is missing.
bool Server::Requests::wrongCredentials(const wire::CallHeader& header, Buffer& out) const {
    if (header.probe && (header.procedure != wire::kNull || peer_.secure())) return wire::writeAuthError(out, header.xid, wire::kBadCredentials), true;
    if (header.procedure == wire::kNull || !peer_.tooWeak()) return false;
    return wire::writeAuthError(out, header.xid, wire::kTooWeak), true;
}

bool Server::Requests::answerBusy(std::string_view record, Buffer& out) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    if (!r.good() || envelope.kind != 0) return false;
    auto header = wire::readCallHeader(r, envelope.xid);
    if (!r.good() || header.rpcVersion != 2 || header.version != wire::kVersion || header.probe || peer_.tooWeak()) return false;
    if (std::find(answered_.begin(), answered_.end(), header.xid) != answered_.end()) return true;
    const std::size_t before = out.size();
    wire::Cancel wanted;
    wire::Hello said;
    switch (header.procedure) {
        case wire::kNull: wire::writeEmptyReply(out, header.xid); break;
        case wire::kHealth: wire::writeHealth(out, header.xid, server_.health(true, *this)); break;
        case wire::kHello:
            // HELLO changes who the client is. A service that executes a request of his may be looking at that.
            if (XdrReader copy = r; !greeted && calls == 0 && wire::readHello(copy, said) && !server_.sessions_->knows({user, said.client}))
                hello(r, header.xid, out, monotonicNow());
            break;
        case wire::kCancel:                     // the SORM's thread will see it, too
            if (ReplySlot* slot = wire::readCancel(r, wanted) ? running(wanted) : nullptr; slot && slot->call)
                slot->call->cancelled.store(true, std::memory_order_relaxed);
            break;
        default: break;
    }
    if (out.size() > before) answered_.push_back(header.xid);
    return true;
}

void Server::Requests::refuse(std::uint32_t xid, Buffer& out, const Error& error) {
    Message m;
    m.code = -1;
    m.trail = error.trail;
    for (auto& e : m.trail.entries()) e.daemon = server_.name_;
    wire::writeReply(out, xid, {}, m);
}

void Server::Requests::hello(XdrReader& r, std::uint32_t xid, Buffer& out, std::int64_t now) {
    wire::Hello hello;
    if (!wire::readHello(r, hello)) return wire::writeRefusal(out, xid, wire::Refusal::garbage);
    if (std::exchange(greeted, true)) return server_.closePeer(&peer_, "HELLO was said twice on one connection", true);
    if (hello.tooLong)
        return server_.closePeer(&peer_, std::string("the ") + hello.tooLong + " in HELLO has " + std::to_string(hello.bytes) +
                                 " bytes; a text there has at most " + std::to_string(kKeptName), true);
    bool known = false;
    session = &server_.sessions_->greet(peer_, hello, known);
    maxReply_ = hello.maxMessage > 0 ? hello.maxMessage : UINT32_MAX;
    ownClock_ = !hello.clock.empty();
    if (ownClock_ && hello.clock == clockSeen()) clock_.same();
    else if (ownClock_) clock_.sample(hello.sent, now);
    auto& self = Caller::self();
    wire::Welcome w{server_.boot_, server_.name_, self.user, self.host, self.program, self.process, server_.started_,
                    static_cast<std::uint32_t>(server_.settings_.maxMessage),
                    static_cast<std::uint32_t>(server_.settings_.inFlight), known};
    w.clocks = hello.clocks;
    w.clock = clockSeen().empty() ? "unknown" : clockSeen();
    w.processes = processesSeen();
    wire::writeWelcome(out, xid, w);
    peer_.greeted();
}

// The slot in which that call runs; null: it is over.
Server::ReplySlot* Server::Requests::running(const wire::Cancel& wanted) const {
    if (!session || wanted.slot >= session->slots.size()) return nullptr;
    ReplySlot& slot = session->slots[wanted.slot];
    return slot.state == ReplySlot::State::running && slot.sequence == wanted.sequence ? &slot : nullptr;
}

void Server::Requests::cancel(XdrReader& r) {
    wire::Cancel wanted;
    if (!wire::readCancel(r, wanted)) return;
    cancelledBefore(wanted.slot, wanted.sequence);
    ReplySlot* slot = running(wanted);
    if (!slot) return;
    // Services run when the lock is released, and the slot may be deleted then. A context is on the stack below, and stays.
    CallContext* const call = slot->call;
    const PendingPointer pending = slot->pending;
    ServerLock::Released released(server_.lock_);
    if (call) call->cancel();
    if (pending) pending->cancel(errors::trailOf(errors::kStopped, pending->who));
}

std::size_t Server::Requests::scan(const char* at, const char* end) {
    const char* const begin = at;
    for (record::Piece piece; (piece = record::front(at, end)).whole;) {
        const std::string_view record = piece.text();
        at += piece.size();
        if (!wire::isCancel(record)) continue;
        XdrReader r(record);
        auto envelope = wire::readEnvelope(r);
        wire::readCallHeader(r, envelope.xid);
        wire::Cancel cancel;
        if (session && wire::readCancel(r, cancel) && cancels_.size() < static_cast<std::size_t>(server_.settings_.inFlight)) cancels_.push_back(cancel);
    }
    return static_cast<std::size_t>(at - begin);
}

bool Server::Requests::takeCancel(std::uint32_t slot, std::uint32_t sequence) {
    return std::erase_if(cancels_, [&](auto& c) { return c.slot == slot && c.sequence == sequence; }) > 0;
}

void Server::Requests::subscribe(XdrReader& r, const wire::CallHeader& header, Buffer& out) {
    wire::Subscription wanted;
    wire::Behalf behalf;
    if (!wire::readSubscription(r, wanted) || (!header.behalf.empty() && !wire::readBehalf(header.behalf, behalf)))
        return wire::writeRefusal(out, header.xid, wire::Refusal::garbage);
    if (!session) fail(kHelloFirst, "a subscription");
    needShort("name", wanted.name.size());
    needShort("pattern", wanted.pattern.size());
    Message m;
    try {
        auto known = session->subscriptions.find(wanted.id);
        bool goesOn = known != session->subscriptions.end();
        if (!goesOn) {
            if (Name::isElsewhere(wanted.name)) fail(errors::kRelay, wanted.name);
            ClientPointer who = client;
            CallContext context(who, {}, behalf.request, behalf.callers);
            const SessionKey mine = session->key;
            auto fresh = std::make_unique<Subscription>(server_, *session, wanted, authorOf(behalf, wanted.name));
            // Making the object may have run the event loop: the session may have been removed.
            if (!session || session->key != mine) return;
            known = session->subscriptions.emplace(wanted.id, std::move(fresh)).first;
        }
        m.ints = {std::int64_t(known->second->number()), std::int64_t(known->second->takeLost()), goesOn};
        wire::writeReply(out, header.xid, {}, m);
        if (!goesOn) known->second->replay();
    } catch (...) {
        throw Error(trailOfCurrentException(wanted.name));
    }
}

// ---- calls ----

void Server::Requests::call(XdrReader& r, const wire::CallHeader& header, std::string_view record, std::size_t size, Scratch& scratch, Frame& frame) {
    wire::Request request;
    Message& m = scratch.message;
    const std::size_t words = wordsOf(r, size);
    if (!wire::readRequest(r, request, m)) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::garbage);
    ReplySlot* slot = nullptr;
    SessionKey key;
    if (request.slot != wire::kNoSlot) {
        if (!session) fail(kHelloFirst, "a call with a slot");
        key = session->key;
        slot = &server_.sessions_->slot(*session, request);
        if (!slot->begins(request.sequence)) return server_.sessions_->repeat(*slot, request, header.xid, scratch.out);
        if (peer_.ended()) return;              // nobody waits for it; a client that comes back sends it again
    }
    needRoom(request.name, size, slot);
    if (slot) {
        slot->sequence = request.sequence;
        slot->state = ReplySlot::State::running;
        slot->asked = false;
    }
    ++calls;
    wire::Times times;
    auto later = [&] { return Later{&peer_, peer_.number, key, request.slot, request.sequence, header.xid, size + words, 0, frame.span}; };
    bool pending = execute(request, header, record, m, times, slot, scratch, frame);
    // A service may have run the event loop: the session may have another connection now, or may have been removed.
    if (slot && frame.spilled) [[unlikely]] slot = server_.sessions_->find(later());
    if (slot) slot->call = nullptr;
    if (pending) return server_.replyLater(later(), times, std::exchange(m.later, nullptr));
    reply(header.xid, times, request.name, m, slot, scratch.out, frame.span, &scratch.lent);
    if (slot) server_.sessions_->replyAgain(*slot, &peer_);
}

void Server::Requests::oneway(XdrReader& r, const wire::CallHeader& header, std::size_t bytes, Scratch& scratch, Frame& frame) {
    wire::Request request;
    Message& m = scratch.message;
    std::size_t words = 0;                      // [bytes] of their memory
    try {
        words = wordsOf(r, bytes);
        if (!wire::readRequest(r, request, m)) return;
        needRoom(request.name, bytes + words, false);
    } catch (const Error& e) {
        // There is no answer to send: count it, and publish it.
        ++server_.dropped_;
        Trail trail = errors::trailOf(kDropped, request.name.empty() ? std::string_view(server_.name_) : request.name, client->caller.toText(), e.what());
        server_.sorm_.mailbox()->post([&sorm = server_.sorm_, trail] { sorm.announce(trail); });
        return;
    }
    ++calls;
    wire::Times times;
    const bool pends = execute(request, header, {}, m, times, nullptr, scratch, frame);
    if (frame.span && !pends) frame.span->finish(m.code < 0 ? &m.trail : nullptr);
    if (!pends) return;
    auto pending = std::exchange(m.later, nullptr);
    if (pending->answered()) return;
    pending->charge = Charge(account, Account::Use::requests);
    pending->charge.force(sizeof(Pending) + bytes + words);
    oneway_.push_back(pending);
}

void Server::Requests::owe(const PendingPointer& pending) {
    std::erase_if(owed_, [](auto& weak) { return weak.expired(); });
    owed_.push_back(pending);
}

void Server::Requests::closed() {
    if (session) server_.sessions_->suspend(*session);
    else if (!greeted) server_.sorm_.mailbox()->post([client = client] { client->end(); });       // of no session: it will not come back
    for (auto& owed : std::exchange(owed_, {}))
        server_.sorm_.mailbox()->post([owed] {
            if (auto p = owed.lock()) p->cancel(errors::trailOf(errors::kClientGone, p->who));
        });
}

bool Server::Requests::idle() const { return owed_.empty() && !(session && session->running()); }

// Are as many calls without a slot under way as there may be?
bool Server::Requests::crowded() {
    const std::size_t most = std::size_t(server_.settings_.inFlight);
    if (owed_.size() + oneway_.size() < most) return false;
    auto over = [](auto& weak) {
        auto p = weak.lock();
        return !p || p->answered();
    };
    std::erase_if(owed_, over);
    std::erase_if(oneway_, over);
    return owed_.size() + oneway_.size() >= most;
}

bool Server::Requests::execute(const wire::Request& request, const wire::CallHeader& header, std::string_view record, Message& m,
                           wire::Times& times, ReplySlot* slot, Scratch& scratch, Frame& frame) {
    const std::int64_t arrived = peer_.arrived(), start = std::max(frame.since, arrived);
    times.waited = microseconds(start - arrived);
    Deadline deadline;
    if (ownClock_) deadline = clock_.deadline(request.deadline, arrived);
    else if (request.deadline > 0) deadline = Deadline::at(arrived + std::int64_t{request.deadline} * 1'000'000);
    if (frame.client != client) frame.client = client;
    const ClientPointer& who = frame.client;
    wire::Behalf behalf;
    const bool sound = header.behalf.empty() || wire::readBehalf(header.behalf, behalf);
    Method method = request.method;
    CallContext context(who, deadline, behalf.request, behalf.callers);
    const bool answered = header.procedure != wire::kOneway;
    if (!behalf.trace.number) [[likely]] frame.span = nullptr;
    else if (answered) frame.span = Span::root(behalf.trace.number, server_.sorm_, std::string(request.name), method, arrived);
    else frame.span = behalf.trace ? server_.sorm_.lateSpans().begin(behalf.trace, std::string(request.name), method, arrived) : nullptr;
    if (frame.span) [[unlikely]] {
        frame.span->door = true;
        context.span = frame.span;
    }
    if (server_.fence_ != 0) [[unlikely]] context.heard = {server_.fence_, behalf.epoch};
    if (slot) slot->call = &context;
    ++server_.served_;
    bool reached = false;                               // the object: then it has told the observers
    try {
        if (!sound) fail(kBehalf);
        const PrincipalPointer author = authorOf(behalf, request.name);
        if (!deadline.none() && start >= deadline.when()) fail(errors::kTimeoutLate, request.name);
        if (slot && cancelledBefore(request.slot, request.sequence)) [[unlikely]] fail(kNotBegun, request.name);
        // Only objects of this process are served: whoever may call us may not call others in our name.
        if (Name::isElsewhere(request.name)) [[unlikely]] fail(errors::kRelay, request.name);
        Service* known = server_.sorm_.find(request.name);
        // Replies to the requests before this one must not wait for it, unless it is known to be quick.
        if (!known || known->lastRun > kQuick) peer_.flush(scratch);
        Reference service;
        bool later;
        {
            Activity activity(server_, request.name, method, who->caller, start);
            ServerLock::Released released(server_.lock_);
            service = known && !author ? Reference(known) : server_.sorm_.get(request.name, author);
            if (author || m.author) m.author = author;      // the one before may have left its own
            reached = true;
            later = service->start(method, m);
        }
        frame.ran = monotonicNow();
        const std::int64_t ran = frame.ran - start;
        service->lastRun = ran;
        peer_.took(ran);
        times.ran = microseconds(ran);
        if (later) return true;
    } catch (...) {
        failed(request, record, m, reached);
        // It looks the name up again, after the answer.
        if (context.elsewhere) [[unlikely]] peer_.closeAfterReply(m.trail.cause() ? m.trail.cause()->text : std::string());
        times.ran = microseconds(monotonicNow() - start);
        peer_.took(monotonicNow() - start);
        times.sub = context.waitedForOthers();
        if (times.sub > 0) server_.passOn(m.trail, request.name, times);
        server_.sorm_.setLastTrail(m.trail);
    }
    times.sub = context.waitedForOthers();
    if (!m.trail.empty()) server_.mark(m.trail, {});
    return false;
}

// The exception under way becomes the reply.
void Server::Requests::failed(const wire::Request& request, std::string_view record, Message& m, bool reached) {
    Trail trail = trailOfCurrentException({});
    // The request is shown from its bytes, since EXEC may have changed the message.
    std::string text;
    Message again;
    wire::Request as;
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    wire::readCallHeader(r, envelope.xid);
    if (record.size() <= 4096 && wire::readRequest(r, as, again)) appendRequest(text, as.name, as.method, again);
    server_.mark(trail, text);
    if (!reached) [[unlikely]] server_.sorm_.observers.refused(request.name, request.method, m, trail);
    m.reset();
    m.code = -1;
    m.trail = std::move(trail);
}

// With its spans, when there is room for them.
void Server::Requests::writeTraced(std::uint32_t xid, const wire::Times& times, const Message& m, const Span& span, Buffer& out, std::size_t start, record::Lent* lent) {
    auto shown = [this](const std::string& name) { return bool(server_.sorm_.access.rights(principal, name) & Rights(Right::inspect)); };
    const Buffer spans = wire::spansOf(span, shown, !principal);
    if (out.size() - start + (lent ? lent->size() : 0) + spans.size() + 8 > maxReply_) return;
    out.resize(start);
    if (lent) *lent = {};
    wire::writeReply(out, xid, times, m, &spans, lent);
}

void Server::Requests::reply(std::uint32_t xid, const wire::Times& times, std::string_view name, Message& m, ReplySlot* slot, Buffer& out, const SpanPointer& span,
                             record::Lent* lent) {
    peer_.executed();
    const std::size_t numbers = 8 * (m.floats.size() + m.ints.size());
    if (numbers < record::kLong || (slot && numbers <= static_cast<std::size_t>(server_.settings_.keepReply))) lent = nullptr;     // all of it is kept
    std::size_t start = out.size();
    wire::writeReply(out, xid, times, m, nullptr, lent);
    if (span) [[unlikely]] writeTraced(xid, times, m, *span, out, start, lent);
    std::size_t size = out.size() - start + (lent ? lent->size() : 0);
    auto instead = [&](const Error& why) {
        out.resize(start);
        if (lent) *lent = {};
        refuse(xid, out, why);
        size = out.size() - start;
    };
    if (size > maxReply_) [[unlikely]]
        instead(errors::errorOf(errors::kTooBig, server_.name_, "reply", size, "the client", maxReply_));
    else if (size > kReadSize && !account->fits(start + size)) [[unlikely]]
        instead(errors::errorOf(kNoRoom, name, size, account->name(), account->limit(), account->used()));
    if (slot) server_.sessions_->keep(*slot, lent && lent->data ? nullptr : out.data() + start, size);
}

}  // namespace sorma
