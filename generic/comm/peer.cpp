// A daemon's side of one connection.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/monitor.h"
#include "bus/requestText.h"
#include "bus/statistics.h"
#include "comm/errors.h"
#include "comm/serverParts.h"

namespace sorma {

namespace {

constexpr int kPieces = 8;                              // fragments that cost as much as a request
constexpr std::size_t kManyWords = 4096;
constexpr int kMostEmpty = 64;                          // empty fragments in one record
constexpr std::int64_t kQuick = 20'000;                 // [ns] a call this short does not hold up replies before it
constexpr std::int64_t kLong = 1'000'000;               // [ns] in which callers may have given up
constexpr std::int64_t kLookAgain = 10'000'000;         // [ns] between looks at what more than a turn's bytes says
constexpr std::size_t kLookSize = 256 * 1024;
constexpr std::uint32_t kReading = EPOLLIN | EPOLLRDHUP;

const Prototype kHelloFirst{Severity::error, "COMM PROTOCOL", 0, "{} needs a session: say HELLO first"};
const Prototype kSlots{Severity::error, "COMM LIMIT", 0,
    "slot {} is beyond the {} calls in flight that this daemon takes from one client; raise it there: sorma::configure -inflight N"};
const Prototype kCalls{Severity::error, "COMM LIMIT", 1,
    "{}: {} calls of this connection are under way, as many as this daemon takes from one client; raise it there: sorma::configure -inflight N"};
const Prototype kDropped{Severity::warning, "COMM LIMIT", 1, "{}: a one-way request of {} was dropped: {}"};
const Prototype kNoRoom{Severity::error, "COMM TOO_BIG", 1,
    "{}: the request was executed, but its reply of {} bytes cannot wait for the client: {} may make this daemon keep {} bytes and has {}; "
    "raise it there: sorma::configure -budget BYTES"};
const Prototype kBehalf{Severity::error, "COMM PROTOCOL", 0, "the credentials do not say on whose behalf the call is made"};
const Prototype kNotBegun{Severity::error, "COMM CANCELLED", 1, "{}: the call was cancelled by its caller before it was started; it was not executed"};
const Prototype kStopped{Severity::error, "COMM CANCELLED", 1, "{}: the call was cancelled by its caller; it may have run"};

std::uint32_t microseconds(std::int64_t nanoseconds) {
    std::int64_t us = nanoseconds / 1000;
    return us > UINT32_MAX ? UINT32_MAX : static_cast<std::uint32_t>(us);
}

// For bytes that are there already the limit is a quarter higher. So a peer that begins to exceed it gets refusals first,
// and is cut off later.
bool stretch(Charge& charge, std::size_t bytes) {
    if (charge.set(bytes)) return true;
    const Account& account = *charge.account();
    if (account.used() + bytes > account.limit() + account.limit() / 4 + charge.bytes()) return false;
    charge.force(bytes);
    return true;
}

}  // namespace

// Charges the memory of the words of a long request, since millions of empty ones fit into a record. Exists while it is
// executed.
struct Server::Peer::Words {
    std::size_t size = 0;
    bool fit = true;

    Words(Peer& peer, Message& m, const XdrReader& r, std::size_t record) {
        if (record > 4 * kManyWords) [[unlikely]] long_.emplace(peer, m), fit = long_->charge.set(size = wire::wordsSize(r));
    }

private:
    struct Long {
        Message& m;
        Charge charge;
        Long(Peer& peer, Message& m) : m(m), charge(peer.account_, Account::Use::requests) {}
        ~Long() {
            if (m.words.capacity() > kManyWords) std::vector<std::string>().swap(m.words);
        }
    };
    std::optional<Long> long_;
};

Server::Peer::Peer(Server& server, int fd, ClientPointer who, std::int64_t user)
    : server_(server), fd_(fd), principal_(who->principal), account_(server.sorm_.budget.of(principal_)),
      request_(account_, Account::Use::requests), queue_(account_, Account::Use::queues), user_(user), client(std::move(who)), since(monotonicNow()),
      number(++server.peersSeen_) {
    server_.reactor_.add(fd_, kReading, this);
    ++account_->connections;
}

bool Server::Peer::onStack() const {
    for (Frame* f = server_.frames_; f; f = f->outer)
        if (f->peer == this) return true;
    return false;
}

void Server::Peer::closeSocket() {
    if (fd_ < 0) return;
    --account_->connections;
    request_.clear();
    queue_.clear();
    server_.reactor_.remove(fd_, this);
    close(fd_);
    fd_ = -1;
}

// ---- a peer's turn ----

void Server::Peer::ready(std::uint32_t events) {
    ServerLock::Held held(server_.lock_);
    if (events & EPOLLOUT) drain();
    if (open() && !events_.empty()) pump();
    if (events & (EPOLLRDHUP | EPOLLHUP)) peerClosed_ = true;
    if (open() && (events & (EPOLLIN | EPOLLHUP | EPOLLERR) || (events == 0 && !in_.empty()))) receive();
}

void Server::Peer::spill(Frame& frame) {
    if (frame.spilled) return;
    frame.spilled = true;
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (frame.inPeer) {
        for (auto* a = server_.activity_; a; a = a->outer)          // its request goes, and it is still under way
            if (a->kept.empty() && a->name.data() >= in_.data() && a->name.data() < frame.end) a->name = a->kept = a->name;
        in_.drop(in_.size() - left);
        taken_ = 0;
    } else {
        in_.append(frame.at, left);
    }
    scanned_ = static_cast<std::size_t>(std::max<std::ptrdiff_t>(frame.scanned - frame.at, 0));
    if (left > 0 && open()) server_.reactor_.again(this);      // it may have been retired while its request was executed
}

// How much to read beyond what is here. A request that is not complete may grow with what really came; of those behind it
// only so much is taken that a CANCEL among them is seen, and the rest waits at the client.
std::size_t Server::Peer::appetite() const {
    const std::size_t here = unread(), first = firstSize();
    if (here >= first) return here < kReadSize / 2 ? kReadSize - here : 0;
    return std::min(first - here + kReadSize, std::clamp(here, kReadSize, kMostGrowth));
}

// Of the first record, or piece of one, with its mark.
std::size_t Server::Peer::firstSize() const {
    if (unread() < wire::kMarkSize) return wire::kMarkSize;
    return wire::kMarkSize + (XdrReader(in_.data() + taken_, wire::kMarkSize).u32() & ~wire::kLastFragment);
}

void Server::Peer::receive() {
    if (closing_) return;
    if (server_.depth_ == 0) server_.closedPeers_.clear();
    else server_.handBack();
    if (server_.scratch_.size() <= server_.depth_) server_.scratch_.push_back(std::make_unique<Scratch>());
    Scratch& scratch = *server_.scratch_[server_.depth_];

    // Requests that a turn before left here are served before more is read.
    bool inPeer = !in_.empty();
    char* room = scratch.in;
    std::size_t before = in_.size(), size = kReadSize;
    if (inPeer) {
        size = appetite();
        if (size > 0 && taken_ > 0) {
            in_.drop(std::exchange(taken_, 0));
            before = in_.size();
        }
        if (in_.capacity() < before + size && server_.spare_.capacity() >= before + size) {
            server_.spare_.clear();
            server_.spare_.append(in_.data(), before);
            std::swap(in_, server_.spare_);
        }
        room = in_.extend(size);
    }
    errno = EAGAIN;
    ssize_t n = size > 0 ? recv(fd_, room, size, MSG_DONTWAIT) : -1;
    if (inPeer) in_.resize(before + (n > 0 ? static_cast<std::size_t>(n) : 0));
    if (n < 0 && errno != EAGAIN && errno != EINTR) return server_.closePeer(this, {}, false);
    bool ended = n == 0;
    if (n <= 0 && !inPeer) {
        if (ended) server_.closePeer(this, {}, false);
        return;
    }
    arrived_ = monotonicNow();
    server_.reactor_.seen(arrived_);
    const char* begin = inPeer ? in_.data() + taken_ : scratch.in;
    Frame frame{this, begin, begin + (inPeer ? unread() : static_cast<std::size_t>(n)), begin + (inPeer ? scanned_ : 0), inPeer, false,
                server_.frames_};
    const bool all = size > 0 && n < static_cast<ssize_t>(size);     // that the socket had
    dwelt_ = !all && arrived_ - looked_ > kLookAgain;
    server_.frames_ = &frame;
    ++server_.depth_;
    struct Leave {
        Server& server;
        Frame& frame;
        ~Leave() {
            server.frames_ = frame.outer;
            if (--server.depth_ == 0) server.closedPeers_.clear();
        }
    } leave{server_, frame};
    serve(frame, scratch);
    // One-way requests are executed although their sender has closed the connection.
    if (ended && open() && !complete()) server_.closePeer(this, {}, false);
}

void Server::Peer::serve(Frame& frame, Scratch& scratch) {
    int served = 0, pieces = 0;
    std::size_t coming = 0;                 // length of the request of which only a part is here
    const int share = server_.share(this);
    bool more = false;
    if (skip_ == 0 && frame.at < frame.end) frame.scanned += scan(frame.scanned, frame.end);
    while (open() && !frame.spilled && !closing_) {
        if (dwelt_) [[unlikely]] lookAhead(frame);
        std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
        if (skip_ > 0) {
            std::size_t n = std::min(skip_, left);
            skip_ -= n;
            frame.at += n;
            left -= n;
        }
        if (left < wire::kMarkSize) break;
        XdrReader marks(frame.at, wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        bool last = mark & wire::kLastFragment;
        if (length + fragments_.size() > static_cast<std::size_t>(server_.settings_.maxMessage)) {
            if (!skip(frame, scratch, length, tooLong(length))) break;
            continue;
        }
        if (left < wire::kMarkSize + length) {
            if (length > kReadSize && !request_.set(fragments_.size() + length)) [[unlikely]] {
                if (!skip(frame, scratch, length, overBudget(server_.name_, Account::Use::requests, length))) break;
                continue;
            }
            coming = length;
            break;
        }
        if (served >= share || queued() > kQueueLimit) {
            more = queued() <= kQueueLimit;
            break;
        }
        std::string_view record(frame.at + wire::kMarkSize, length);
        frame.at += wire::kMarkSize + length;
        if (!last || !fragments_.empty()) {
            fragments_.append(record.data(), record.size());
            if (fragments_.size() > kReadSize && !request_.set(fragments_.capacity())) {
                flush(scratch);
                server_.closePeer(this, overBudget(server_.name_, Account::Use::requests, fragments_.size()).what(), true);
                break;
            }
            if (!last) {
                if (length == 0 && ++empties_ > kMostEmpty) {
                    flush(scratch);
                    server_.closePeer(this, "a request came in too many empty fragments", true);
                    break;
                }
                if (++pieces % kPieces == 0) ++served;
                continue;
            }
            empties_ = 0;
            Buffer whole;
            std::swap(whole, fragments_);
            handle({whole.data(), whole.size()}, scratch, frame);
        } else {
            handle(record, scratch, frame);
        }
        ++served;
        if (scratch.out.size() > kFlushAt) flush(scratch);
    }
    server_.took(this, served, more);
    if (more && held_.size() + scratch.out.size() < kHold) hold(scratch);
    else flush(scratch);
    if (open() && closing_) return server_.closePeer(this, *closing_, true);
    if (!open() || frame.spilled) return;
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (!frame.inPeer) in_.append(frame.at, left);
    else if (left > 0) taken_ = in_.size() - left;
    else in_.clear(), taken_ = 0;
    scanned_ = static_cast<std::size_t>(std::max<std::ptrdiff_t>(frame.scanned - frame.at, 0));
    if (in_.empty() && in_.capacity() > kKeepBuffer) server_.giveBack(in_);
    if (more) server_.reactor_.again(this);
    bool half = !more && (left > 0 || skip_ > 0 || fragments_.size() > 0) && queued() <= kQueueLimit;
    if (!half) halfSince_ = 0;
    else if (halfSince_ == 0 || served > 0) halfSince_ = arrived_;
    if (slow()) server_.watchSlow(this);
    if (std::size_t held = std::max(fragments_.size() + coming, fragments_.size() + unread()); held != request_.bytes()) charge(held, half);
    interest();
}

// Which calls are cancelled by whole records that have come and wait for their turn. Returns the size of those.
std::size_t Server::Peer::scan(const char* at, const char* end) {
    const char* const begin = at;
    while (end - at >= std::ptrdiff_t(wire::kMarkSize)) {
        XdrReader marks(at, wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        if (static_cast<std::size_t>(end - at) - wire::kMarkSize < length) break;
        std::string_view record(at + wire::kMarkSize, length);
        at += wire::kMarkSize + length;
        if (!wire::isCancel(record)) continue;
        XdrReader r(record);
        auto envelope = wire::readEnvelope(r);
        wire::readCallHeader(r, envelope.xid);
        wire::Cancel cancel;
        if (session && wire::readCancel(r, cancel) && cancels_.size() < static_cast<std::size_t>(server_.settings_.inFlight)) cancels_.push_back(cancel);
    }
    return static_cast<std::size_t>(at - begin);
}

// While we were elsewhere callers may have cancelled their calls, or ended: look for that in the socket.
void Server::Peer::lookAhead(Frame& frame) {
    dwelt_ = false;
    looked_ = monotonicNow();
    if (skip_ > 0) return;              // in the middle of a record
    frame.scanned = std::max(frame.scanned, frame.at);
    pollfd state{fd_, POLLRDHUP, 0};
    if (poll(&state, 1, 0) > 0) peerClosed_ = true;
    Buffer& seen = server_.peeked_;
    seen.clear();
    seen.append(frame.scanned, static_cast<std::size_t>(frame.end - frame.scanned));
    ssize_t n = recv(fd_, seen.extend(kLookSize), kLookSize, MSG_PEEK | MSG_DONTWAIT);
    if (n > 0) scan(seen.data(), seen.data() + seen.size() - kLookSize + n);
}

bool Server::Peer::takeCancel(std::uint32_t slot, std::uint32_t sequence) {
    return std::erase_if(cancels_, [&](auto& c) { return c.slot == slot && c.sequence == sequence; }) > 0;
}

// For what is here, and for the rest of a long request. What will soon be served is charged in any case.
void Server::Peer::charge(std::size_t request, bool half) {
    if (!half) return request_.force(request);
    if (stretch(request_, request)) return;
    server_.closePeer(this, overBudget(server_.name_, Account::Use::requests, request).what(), true);
}

Error Server::Peer::tooLong(std::size_t length) const {
    return Error(makeEntry(errors::kTooBig, {MessageArg::of(server_.name_), MessageArg::of("request"), MessageArg::of(length),
                                             MessageArg::of("daemon " + server_.name_), MessageArg::of(server_.settings_.maxMessage)}));
}

Error Server::Peer::overBudget(std::string_view object, Account::Use use, std::size_t bytes) const {
    return Error(account_->refusal(std::string(object), use, bytes));
}

// A record that is too long. Its beginning says whether to refuse the call and skip it, or to end the connection.
// False: wait for more of it.
bool Server::Peer::skip(Frame& frame, Scratch& scratch, std::size_t length, const Error& why) {
    constexpr std::size_t kNeeded = wire::kMarkSize + 24;           // up to the procedure
    if (static_cast<std::size_t>(frame.end - frame.at) < kNeeded) return false;
    XdrReader r(frame.at + wire::kMarkSize, kNeeded - wire::kMarkSize);
    auto envelope = wire::readEnvelope(r);
    std::uint32_t rpcVersion = r.u32();
    bool call = fragments_.empty() && r.good() && envelope.kind == 0 && rpcVersion == 2;
    if (!call) {
        flush(scratch);
        server_.closePeer(this, "what came is not a record of ONC RPC, or it is longer than -maxmessage " +
                                 std::to_string(server_.settings_.maxMessage) + " bytes", true);
        return false;
    }
    refuse(envelope.xid, scratch.out, why);
    frame.at += wire::kMarkSize;
    skip_ = length;
    return true;
}

void Server::Peer::handle(std::string_view record, Scratch& scratch, Frame& frame) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    if (!r.good()) return server_.closePeer(this, "what came is not a message of ONC RPC", true);
    if (envelope.kind != 0) return;                 // a reply: we have asked nothing
    auto header = wire::readCallHeader(r, envelope.xid);
    if (!r.good()) return wire::writeRefusal(scratch.out, envelope.xid, wire::Refusal::garbage);
    if (header.rpcVersion != 2) return wire::writeRpcMismatch(scratch.out, header.xid);
    bool ours = header.program == wire::kProgram ||
                (server_.program_ != 0 && header.program == wire::kProgramBase + server_.program_);
    if (!ours) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programUnavailable);
    if (header.version != wire::kVersion) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::programMismatch);
    if (!answered_.empty() && std::erase(answered_, header.xid) > 0) return;       // by the health responder
    switch (header.procedure) {
        case wire::kNull: return wire::writeEmptyReply(scratch.out, header.xid);
        case wire::kCall: return call(r, header, record, scratch, frame);
        case wire::kHello: return hello(r, header.xid, scratch.out, arrived_);
        case wire::kOneway: return oneway(r, header, scratch, frame);
        case wire::kCancel: return cancel(r);
        case wire::kClock:
            if (std::int64_t sent; wire::readClock(r, sent)) clock_.sample(sent, arrived_);
            return;
        case wire::kHealth: return wire::writeHealth(scratch.out, header.xid, server_.health(false));
        case wire::kSubscribe: return subscribe(r, header, scratch);
        case wire::kUnsubscribe:
            if (session) session->subscriptions.erase(r.u32());
            return;
        default: return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::procedureUnavailable);
    }
}

void Server::Peer::refuse(std::uint32_t xid, Buffer& out, const Error& error) {
    Message m;
    m.code = -1;
    m.trail = error.trail;
    for (auto& e : m.trail.entries()) e.daemon = server_.name_;
    wire::writeReply(out, xid, {}, m);
}

void Server::Peer::hello(XdrReader& r, std::uint32_t xid, Buffer& out, std::int64_t now) {
    wire::Hello hello;
    if (!wire::readHello(r, hello)) return wire::writeRefusal(out, xid, wire::Refusal::garbage);
    if (std::exchange(greeted_, true)) return server_.closePeer(this, "HELLO was said twice on one connection", true);
    bool known = false;
    session = &server_.session(*this, hello, known);
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
}

void Server::Peer::cancel(XdrReader& r) {
    wire::Cancel wanted;
    if (!wire::readCancel(r, wanted) || !session || wanted.slot >= session->slots.size()) return;
    cancelledBefore(wanted.slot, wanted.sequence);
    Slot& slot = session->slots[wanted.slot];
    if (slot.state != Slot::State::running || slot.sequence != wanted.sequence) return;     // it is over
    if (slot.call) {
        CallContext& call = *slot.call;
        ServerLock::Released released(server_.lock_);
        call.cancel();
    }
    if (auto pending = slot.pending) {
        ServerLock::Released released(server_.lock_);
        pending->cancel(Trail(makeEntry(kStopped, {MessageArg::of(pending->who)})));
    }
}

void Server::Peer::subscribe(XdrReader& r, const wire::CallHeader& header, Scratch& scratch) {
    wire::Subscription wanted;
    wire::Behalf behalf;
    const std::uint32_t xid = header.xid;
    if (!wire::readSubscription(r, wanted) || (!header.behalf.empty() && !wire::readBehalf(header.behalf, behalf)))
        return wire::writeRefusal(scratch.out, xid, wire::Refusal::garbage);
    if (!session) return refuse(xid, scratch.out, Error(makeEntry(kHelloFirst, {MessageArg::of("a subscription")})));
    Message m;
    try {
        auto known = session->subscriptions.find(wanted.id);
        bool goesOn = known != session->subscriptions.end();
        if (!goesOn) {
            if (Name::isElsewhere(wanted.name)) fail(errors::kRelay, wanted.name);
            ClientPointer who = client;
            CallContext context(who, {}, behalf.request, behalf.callers);
            const SessionKey mine = session->key;
            auto fresh = std::make_unique<Subscription>(server_, *session, wanted, authorOf(behalf));
            // Making the object may have run the event loop: the session may have been removed.
            if (!session || session->key != mine) return;
            known = session->subscriptions.emplace(wanted.id, std::move(fresh)).first;
        }
        m.ints = {std::int64_t(known->second->number()), std::int64_t(known->second->takeLost()), goesOn};
        wire::writeReply(scratch.out, xid, {}, m);
        if (!goesOn) known->second->replay();
    } catch (...) {
        Trail trail = trailOfCurrentException(wanted.name);
        refuse(xid, scratch.out, Error(std::move(trail)));
    }
}

void Server::Peer::call(XdrReader& r, const wire::CallHeader& header, std::string_view record, Scratch& scratch,
                        Frame& frame) {
    wire::Request request;
    Message& m = scratch.message;
    Words words(*this, m, r, record.size());
    if (!words.fit) [[unlikely]] return refuse(header.xid, scratch.out, overBudget(server_.name_, Account::Use::requests, words.size));
    if (!wire::readRequest(r, request, m)) return wire::writeRefusal(scratch.out, header.xid, wire::Refusal::garbage);
    Slot* slot = nullptr;
    Session* mine = session;
    if (request.slot != wire::kNoSlot) {
        if (!mine) return refuse(header.xid, scratch.out, Error(makeEntry(kHelloFirst, {MessageArg::of("a call with a slot")})));
        if (request.slot >= static_cast<std::uint64_t>(server_.settings_.inFlight))
            return refuse(header.xid, scratch.out,
                          Error(makeEntry(kSlots, {MessageArg::of(request.slot), MessageArg::of(server_.settings_.inFlight)})));
        if (mine->slots.size() <= request.slot) {
            std::size_t more = (request.slot + 1 - mine->slots.size()) * (sizeof(Slot) + Slot::kSmall);
            if (!mine->held.set(mine->held.bytes() + more))
                return refuse(header.xid, scratch.out, overBudget(request.name, Account::Use::replies, more));
            while (mine->slots.size() <= request.slot) mine->slots.emplace_back().of = mine;
        }
        slot = &mine->slots[request.slot];
        if (slot->state != Slot::State::empty && request.sequence == slot->sequence) {      // it asks again
            if (slot->state == Slot::State::running) {
                slot->asked = true;
                slot->askedXid = header.xid;
            } else if (slot->state == Slot::State::tooLarge) {
                refuse(header.xid, scratch.out, Error(makeEntry(errors::kReplyGone, {MessageArg::of(request.name),
                       MessageArg::of(slot->size), MessageArg::of("daemon " + server_.name_)})));
            } else {
                char* at = scratch.out.extend(slot->reply.size());
                std::memcpy(at, slot->reply.data(), slot->reply.size());
                XdrWriter::put(at + wire::kMarkSize, header.xid);
            }
            return;
        }
        // A number may be missing: its request was cancelled by the client, or refused before it had a slot.
        bool follows = std::int32_t(request.sequence - slot->sequence) > 0;
        if (slot->state == Slot::State::running || (slot->state != Slot::State::empty && !follows))
            return refuse(header.xid, scratch.out, Error(makeEntry(errors::kSequence, {MessageArg::of(request.name),
                          MessageArg::of(request.sequence), MessageArg::of(request.slot), MessageArg::of(slot->sequence)})));
        if (peerClosed_) return;              // nobody waits for it; a client that comes back sends it again
        if (account_->over()) [[unlikely]]
            return refuse(header.xid, scratch.out, overBudget(request.name, Account::Use::requests, record.size()));
        slot->sequence = request.sequence;
        slot->state = Slot::State::running;
        slot->asked = false;
    } else if (account_->over()) [[unlikely]] {
        return refuse(header.xid, scratch.out, overBudget(request.name, Account::Use::requests, record.size()));
    } else if (crowded()) [[unlikely]] {
        return refuse(header.xid, scratch.out,
                      Error(makeEntry(kCalls, {MessageArg::of(request.name), MessageArg::of(server_.settings_.inFlight)})));
    }
    ++calls;
    wire::Times times;
    const SessionKey key = mine ? mine->key : SessionKey();
    auto later = [&] { return Later{this, number, key, request.slot, request.sequence, header.xid, record.size() + words.size, 0}; };
    bool pending = execute(request, header, record, m, times, slot, scratch, frame);
    // A service may have run the event loop: the session may have another connection now, or may have been removed.
    if (slot && frame.spilled) [[unlikely]] slot = server_.findSlot(later());
    if (slot) slot->call = nullptr;
    if (pending) return server_.replyLater(later(), times, std::exchange(m.later, nullptr));
    // The name points into the record, which does not exist any more when the frame was spilled.
    reply(header.xid, times, frame.inPeer && frame.spilled ? std::string_view(server_.name_) : request.name, m, slot, scratch.out);
    if (slot && slot->asked) server_.replyAgain(later(), *slot, this);
}

void Server::Peer::oneway(XdrReader& r, const wire::CallHeader& header, Scratch& scratch, Frame& frame) {
    wire::Request request;
    Message& m = scratch.message;
    const std::size_t bytes = r.left();
    Words words(*this, m, r, bytes);
    if (words.fit && !wire::readRequest(r, request, m)) return;
    if (!words.fit || account_->over() || crowded()) [[unlikely]] {
        // There is no answer to send: count it, and publish it.
        ++server_.dropped_;
        std::string_view name = words.fit ? request.name : std::string_view(server_.name_);
        Error why = words.fit && !account_->over()
                        ? Error(makeEntry(kCalls, {MessageArg::of(name), MessageArg::of(server_.settings_.inFlight)}))
                        : overBudget(name, Account::Use::requests, bytes + words.size);
        Trail trail = Trail(makeEntry(kDropped, {MessageArg::of(name), MessageArg::of(client->caller.toText()), MessageArg::of(why.what())}));
        server_.sorm_.mailbox()->post([&sorm = server_.sorm_, trail] { sorm.announce(trail); });
        return;
    }
    ++calls;
    wire::Times times;
    if (!execute(request, header, {}, m, times, nullptr, scratch, frame)) return;
    auto pending = std::exchange(m.later, nullptr);
    if (pending->answered()) return;
    pending->charge = Charge(account_, Account::Use::requests);
    pending->charge.force(sizeof(Pending) + bytes + words.size);
    oneway_.push_back(pending);
}

// Are as many calls without a slot under way as there may be?
bool Server::Peer::crowded() {
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

bool Server::Peer::execute(const wire::Request& request, const wire::CallHeader& header, std::string_view record, Message& m,
                           wire::Times& times, Slot* slot, Scratch& scratch, Frame& frame) {
    // Of requests that came together only the first starts when they came.
    std::int64_t start = frame.served++ == 0 ? arrived_ : monotonicNow();
    std::int64_t waited = start - arrived_;
    times.waited = microseconds(waited);
    Deadline deadline;
    if (ownClock_) deadline = clock_.deadline(request.deadline, arrived_);
    else if (request.deadline > 0) deadline = Deadline::at(arrived_ + std::int64_t{request.deadline} * 1'000'000);
    ClientPointer who = client;                         // stays while the service runs, whatever becomes of this peer
    wire::Behalf behalf;
    const bool sound = header.behalf.empty() || wire::readBehalf(header.behalf, behalf);
    CallContext context(who, deadline, behalf.request, behalf.callers);
    if (slot) slot->call = &context;
    Method method = request.method;
    Passing passing(server_.sorm_, ++server_.served_, request.name, method, m);
    try {
        if (!sound) fail(kBehalf);
        const PrincipalPointer& author = authorOf(behalf);
        if (!deadline.none() && start >= deadline.when()) fail(errors::kTimeoutLate, request.name);
        if (slot && cancelledBefore(request.slot, request.sequence)) [[unlikely]] fail(kNotBegun, request.name);
        // Only objects of this process are served: whoever may call us may not call others in our name.
        if (Name::isElsewhere(request.name)) [[unlikely]] fail(errors::kRelay, request.name);
        Service* known = server_.sorm_.find(request.name);
        // Replies to the requests before this one must not wait for it, unless it is known to be quick.
        if (!(scratch.out.empty() && held_.empty()) && (!known || known->lastRun > kQuick)) flush(scratch);
        Reference service;
        bool later;
        {
            Activity activity(server_, request.name, method, who->caller, start);
            ServerLock::Released released(server_.lock_);
            service = known && !author ? Reference(known) : server_.sorm_.get(request.name, author);
            if (author || m.author) m.author = author;      // the one before may have left its own
            later = service->start(method, m);
        }
        std::int64_t ran = monotonicNow() - start;
        service->lastRun = ran;
        dwelt_ = dwelt_ || ran > kLong;
        times.ran = microseconds(ran);
        if (later) return passing.later(m.later), true;
    } catch (...) {
        Trail trail = trailOfCurrentException({});
        // The request is shown from its bytes, since EXEC may have changed the message; they are gone when the rest
        // of the peer's buffer has been handed back meanwhile.
        std::string text;
        Message again;
        wire::Request as;
        XdrReader r(record);
        if (!(frame.inPeer && frame.spilled)) {
            auto envelope = wire::readEnvelope(r);
            wire::readCallHeader(r, envelope.xid);
            if (record.size() <= 4096 && wire::readRequest(r, as, again)) appendRequest(text, as.name, as.method, again);
        }
        server_.mark(trail, text);
        m.reset();
        m.code = -1;
        m.trail = std::move(trail);
        times.ran = microseconds(monotonicNow() - start);
        dwelt_ = dwelt_ || times.ran > kLong / 1000;
        times.sub = context.waitedForOthers();
        if (times.sub > 0) server_.passOn(m.trail, request.name, times);
        server_.sorm_.setLastTrail(m.trail);
    }
    times.sub = context.waitedForOthers();
    if (!m.trail.empty()) server_.mark(m.trail, {});
    passing.done(m, times.ran);
    return false;
}

void Server::Peer::reply(std::uint32_t xid, const wire::Times& times, std::string_view name, Message& m, Slot* slot, Buffer& out) {
    if (request_.bytes() > 4 * kReadSize) request_.clear();     // it has been executed, and makes room for its reply
    std::size_t start = out.size();
    wire::writeReply(out, xid, times, m);
    std::size_t size = out.size() - start;
    if (size > maxReply_) {
        out.resize(start);
        refuse(xid, out, Error(makeEntry(errors::kTooBig, {MessageArg::of(server_.name_), MessageArg::of("reply"),
               MessageArg::of(size), MessageArg::of("the client"), MessageArg::of(maxReply_)})));
        size = out.size() - start;
    } else if (size > kReadSize && !account_->fits(out.size())) [[unlikely]] {
        out.resize(start);
        refuse(xid, out, Error(makeEntry(kNoRoom, {MessageArg::of(name), MessageArg::of(size), MessageArg::of(account_->name()),
                                                   MessageArg::of(account_->limit()), MessageArg::of(account_->used())})));
        size = out.size() - start;
    }
    if (slot) server_.keepReply(*slot, out.data() + start, size);
}

void Server::Peer::flush(Scratch& scratch) {
    if (!(scratch.out.empty() && held_.empty()) && open()) push(scratch.out.data(), scratch.out.size());
    scratch.out.clear();
    if (scratch.out.capacity() > kKeepSpare) scratch.out.release();
}

// Few requests of a peer that floods are served in a turn. If each turn called send, the others would pay for it.
void Server::Peer::hold(Scratch& scratch) {
    held_.append(scratch.out.data(), scratch.out.size());
    scratch.out.clear();
}

void Server::Peer::push(const char* data, std::size_t size) {
    if (!held_.empty()) {
        Buffer all = std::move(held_);
        all.append(data, size);
        push(all.data(), all.size());
        all.clear();
        held_ = std::move(all);
        return;
    }
    if (queued() == 0) {
        while (size > 0) {
            ssize_t n = send(fd_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
            if (n < 0 && errno == EINTR) continue;
            if (n < 0 && errno != EAGAIN) return server_.closePeer(this, {}, false);
            if (n < 0) break;
            data += n;
            size -= static_cast<std::size_t>(n);
        }
        if (size == 0) return;
        stuckSince_ = monotonicNow();
        if (server_.spare_.capacity() >= size) {
            std::swap(out_, server_.spare_);
            out_.clear();
        }
    }
    out_.append(data, size);
    if (!stretch(queue_, out_.size())) return server_.closePeer(this, {}, false);
    server_.watchSlow(this);
    interest();
}

void Server::Peer::drain() {
    bool moved = false;
    while (queued() > 0) {
        ssize_t n = send(fd_, out_.data() + sent_, queued(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno == EAGAIN) break;
        if (n < 0) return server_.closePeer(this, {}, false);
        sent_ += static_cast<std::size_t>(n);
        moved = true;
    }
    if (moved) {
        stuckSince_ = monotonicNow();
        server_.reactor_.seen(stuckSince_);
    }
    if (queued() == 0) {
        out_.clear();
        if (!events_.empty()) server_.reactor_.again(this);
        if (out_.capacity() > kKeepBuffer) server_.giveBack(out_);
        queue_.clear();
        sent_ = 0;
        stuckSince_ = 0;
    } else if (sent_ > kQueueLimit) {
        out_.drop(sent_);
        queue_.force(out_.size());
        sent_ = 0;
    }
    if (queued() <= kQueueLimit && !in_.empty()) server_.reactor_.again(this);
    interest();
}

// Read while the peer takes its replies; ask to write while it has any to take.
void Server::Peer::interest() {
    if (!open()) return;
    std::uint32_t wanted = (queued() <= kQueueLimit && !closing_ ? kReading : 0u) | (queued() > 0 ? std::uint32_t{EPOLLOUT} : 0u);
    if (wanted == interest_) return;
    interest_ = wanted;
    server_.reactor_.change(fd_, wanted, this);
}

std::string Server::Peer::tooSlow(std::int64_t now) const {
    auto& s = server_.settings_;
    if (halfSince_ != 0 && now - halfSince_ > s.requestTime * 1'000'000)
        return "half a request had come and the rest did not follow in " + std::to_string(s.requestTime) + " ms (-requesttime)";
    if (queued() > 0 && stuckSince_ != 0 && now - stuckSince_ > s.replyTime * 1'000'000)
        return std::to_string(queued()) + " bytes of replies were not taken in " + std::to_string(s.replyTime) + " ms (-replytime)";
    return {};
}

// ---- events: written when the peer has room for them ----

void Server::Peer::schedule(Subscription& subscription) {
    if (events_.empty()) server_.reactor_.again(this);
    events_.push_back(&subscription);
    subscription.scheduled = true;
}

void Server::Peer::unschedule(Subscription& subscription) { std::erase(events_, &subscription); }

void Server::Peer::pump() {
    Buffer& out = server_.events_;
    while (open() && !events_.empty() && queued() == 0) {
        out.clear();
        while (!events_.empty() && out.size() < kEventWindow) {
            Subscription* next = events_.front();
            events_.pop_front();
            next->scheduled = next->pump(*this, out);
            if (next->scheduled) events_.push_back(next);
        }
        push(out.data(), out.size());
    }
}

// ---- the health responder's look ----

// Look at the bytes that were read and not served, then at those in the socket, so records in the order in which they came.
void Server::Peer::peek() {
    if (!open() || queued() > kQueueLimit) return;
    const char* begin = in_.data() + taken_;
    const char* end = in_.data() + in_.size();
    for (Frame* f = server_.frames_; f; f = f->outer)
        if (f->peer == this && !f->spilled) begin = f->at, end = f->end;
    std::size_t unserved = static_cast<std::size_t>(end - begin);
    if (unserved > kLookSize) return;
    Buffer& seen = server_.peeked_;
    seen.clear();
    seen.append(begin, unserved);
    ssize_t n = recv(fd_, seen.extend(kLookSize), kLookSize, MSG_PEEK | MSG_DONTWAIT);
    std::size_t size = unserved + (n > 0 ? static_cast<std::size_t>(n) : 0), at = skip_;
    Buffer out;
    while (at < size && size - at >= wire::kMarkSize) {
        XdrReader marks(seen.data() + at, wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        if (!(mark & wire::kLastFragment) || size - at - wire::kMarkSize < length) break;
        XdrReader r(seen.data() + at + wire::kMarkSize, length);
        at += wire::kMarkSize + length;
        auto envelope = wire::readEnvelope(r);
        if (!r.good() || envelope.kind != 0) break;
        auto header = wire::readCallHeader(r, envelope.xid);
        if (!r.good() || header.rpcVersion != 2 || header.version != wire::kVersion) break;
        if (std::find(answered_.begin(), answered_.end(), header.xid) != answered_.end()) continue;
        std::size_t before = out.size();
        switch (header.procedure) {
            case wire::kNull: wire::writeEmptyReply(out, header.xid); break;
            case wire::kHealth: wire::writeHealth(out, header.xid, server_.health(true)); break;
            case wire::kHello:
                // HELLO changes who the client is, which a service may be looking at that executes a request of his.
                if (!greeted_ && calls == 0 && server_.newcomer(*this, r)) hello(r, header.xid, out, monotonicNow());
                break;
            case wire::kCancel: {
                wire::Cancel wanted;
                if (!wire::readCancel(r, wanted) || !session || wanted.slot >= session->slots.size()) break;
                Slot& slot = session->slots[wanted.slot];
                if (slot.call && slot.sequence == wanted.sequence) slot.call->cancelled.store(true, std::memory_order_relaxed);
                break;                          // and the SORM's thread will see it, too
            }
            default: break;
        }
        if (out.size() > before) answered_.push_back(header.xid);
    }
    // Queue what the socket does not take now: these requests are not answered again.
    std::size_t sent = 0;
    if (!out.empty() && queued() == 0) sent = static_cast<std::size_t>(std::max(send(fd_, out.data(), out.size(), MSG_DONTWAIT | MSG_NOSIGNAL), ssize_t{0}));
    if (sent == out.size()) return;
    if (queued() == 0) stuckSince_ = monotonicNow();
    out_.append(out.data() + sent, out.size() - sent);
    queue_.force(out_.size());
    interest();
    // The timer of those who take nothing is the SORM's thread's.
    server_.sorm_.mailbox()->post([self = std::weak_ptr(server_.self_), peer = this, number = number] {
        auto server = self.lock();
        if (!server) return;
        auto found = (*server)->peers_.find(peer);
        if (found != (*server)->peers_.end() && peer->number == number) (*server)->watchSlow(peer);
    });
}

}  // namespace sorma
