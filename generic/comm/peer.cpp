#include "comm/peer.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>

#include "bus/atEnd.h"
#include "comm/errors.h"
#include "comm/sessions.h"
#include "comm/subscription.h"

namespace sorma {

namespace {

constexpr int kBatch = 64;                              // requests of one peer in one turn, at most; see Shares
constexpr int kPieces = 8;                              // fragments that cost as much as a request
constexpr std::size_t kMostGrowth = 8 << 20;            // [bytes] of a long request that are read in one turn, at most
constexpr std::size_t kQueueLimit = 1 << 20;            // [bytes] of unread replies; with more we read no requests of the peer
constexpr std::size_t kHold = 4096;                     // [bytes] of replies that wait for the next turn of a peer that has sent more
constexpr std::size_t kFlushAt = 256 * 1024;            // [bytes] of replies that are written before they are sent
constexpr std::size_t kKeepBuffer = 4096;               // [bytes] a peer's own buffers may stay this large when empty
constexpr std::size_t kShort = 4096;                    // [bytes] of a reply whose writing takes no time worth reading the clock
constexpr std::int64_t kLong = 1'000'000;               // [ns] in which callers may have given up
constexpr std::int64_t kLookAgain = 10'000'000;         // [ns] between looks at what more than a turn's bytes says
constexpr std::size_t kLookSize = 256 * 1024;
constexpr std::uint32_t kReading = EPOLLIN | EPOLLRDHUP;

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

Server::Peer::Peer(Server& server, Line line, ClientPointer who, std::int64_t user)
    : since(monotonicNow()), number(++server.peersSeen_), requests(server, *this, std::move(who), user), server_(server), line_(std::move(line)),
      request_(requests.account, Account::Use::requests), queue_(requests.account, Account::Use::queues), share_(server.shares_.of(requests.account)) {
    if (line_.row().upgrade) state_ = State::opening;
    server_.reactor_.add(line_.descriptor(), kReading, this);
    ++requests.account->connections;
}

bool Server::Peer::onStack() const {
    for (Frame* f = server_.frames_; f; f = f->outer)
        if (f->peer == this) return true;
    return false;
}

bool Server::Peer::unserved() const {
    if (!in_.empty()) return true;
    for (Frame* f = server_.frames_; f; f = f->outer)
        if (f->peer == this && f->at < f->end) return true;
    return false;
}

void Server::Peer::closeSocket() {
    if (!open()) return;
    --requests.account->connections;
    request_.clear();
    queue_.clear();
    server_.reactor_.remove(line_.descriptor(), this);
    line_ = {};
}

bool Server::Peer::reading() const { return queued() <= kQueueLimit && !closing_; }

void Server::Peer::took(std::int64_t nanoseconds) { dwelt_ = dwelt_ || nanoseconds > kLong; }

void Server::Peer::executed() {
    if (request_.bytes() > 4 * kReadSize) request_.clear();
}

// ---- a peer's turn ----

void Server::Peer::ready(std::uint32_t events) {
    ServerLock::Held held(server_.lock_);
    if (!open()) return;                // it was closed since the reactor has noted this
    const bool again = events == 0;
    if (!again && line_.row().wants) [[unlikely]] events = line_.means(events);
    if ((events & EPOLLOUT) && queued() > 0) drain();
    if (upgrading() && !upgrade()) [[unlikely]] return;
    pump();
    if (!open()) return;
    if (events & (EPOLLRDHUP | EPOLLHUP)) ended_ = true;
    const bool comes = again ? !in_.empty() || line_.pending() || line_.brought(false) : (events & EPOLLIN) && reading();
    if (comes || (events & (EPOLLHUP | EPOLLERR))) receive();
}

// Do what its transport needs before the first request, and after the WELCOME.
bool Server::Peer::upgrade() {
    try {
        const auto stage = state_ == State::opening ? Transport::Stage::connected : Transport::Stage::greeted;
        if (open() && queued() == 0 && line_.row().upgrade(line_, stage, requests.client->caller.toText())) {
            state_ = state_ == State::opening ? State::greeting : State::live;
            halfSince_ = 0;
            if (secure()) identify();
        } else if (state_ == State::opening && halfSince_ == 0) {       // as half a request
            halfSince_ = monotonicNow();
            server_.watchSlow(this);
        }
        interest();
    } catch (const Error& e) {
        server_.refuseLine(e);
        server_.closePeer(this, e.what(), true);
    }
    return open() && !upgrading();
}

void Server::Peer::identify() {
    Identity who = line_.row().identify(line_);
    if (who.gone) return server_.closePeer(this, {}, false);
    const std::int64_t user = server_.userOf(line_, who.principal);
    server_.sorm_.mailbox()->post([before = requests.client] { before->end(); });
    --requests.account->connections;
    requests.become(std::make_shared<Client>(std::move(who.caller), std::move(who.principal)), user);
    ++requests.account->connections;
    request_ = Charge(requests.account, Account::Use::requests);
    queue_ = Charge(requests.account, Account::Use::queues);
    share_ = server_.shares_.of(requests.account);
    if (!server_.judgeTimer_) server_.judgeLines();
}

void Server::Peer::spill(Frame& frame) {
    if (frame.spilled) return;
    frame.spilled = true;
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (frame.inPeer) {
        // The frame keeps the bytes of the request that is under way.
        frame.bytes.append(frame.at, left);
        std::swap(in_, frame.bytes);
        frame.charge = Charge(requests.account, Account::Use::requests);
        frame.charge.force(frame.bytes.capacity());
        taken_ = 0;
    } else {
        in_.append(frame.at, left);
    }
    scanned_ = static_cast<std::size_t>(std::max<std::ptrdiff_t>(frame.scanned - frame.at, 0));
    if (left > 0 && open()) server_.reactor_.again(this);      // it may have been retired while its request was executed
}

// How much to read beyond what is here. A request that is not complete may grow with what really came. The daemon takes of
// the requests behind it only enough to see a CANCEL among them; the rest waits at the client.
std::size_t Server::Peer::appetite() const {
    const std::size_t here = unread(), first = front().size();
    if (here >= first) return here < kReadSize / 2 ? kReadSize - here : 0;
    return std::min(first - here + kReadSize, std::clamp(here, kReadSize, kMostGrowth));
}

void Server::Peer::receive() {
    if (closing_) return;
    server_.shares_.enter(share_, server_.reactor_.turns(), server_.reactor_.seen());
    if (!server_.shares_.mayGoOn(share_) && complete()) return wait();
    if (server_.depth_ == 0) server_.closedPeers_.clear();
    else server_.handBack();
    if (server_.scratch_.size() <= server_.depth_) server_.scratch_.push_back(std::make_unique<Scratch>());
    Scratch& scratch = *server_.scratch_[server_.depth_];

    if (apart_ && apart_->filling()) [[unlikely]] {
        if (!receiveApart()) return server_.closePeer(this, {}, false);
        if (apart_->filling()) return;
    }

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
    const std::int64_t began = size > kReadSize ? monotonicNow() : 0;
    errno = EAGAIN;
    ssize_t n = size > 0 ? line_.read(room, size) : -1;
    if (inPeer) in_.resize(before + (n > 0 ? static_cast<std::size_t>(n) : 0));
    if (n < 0 && errno != EAGAIN) return server_.closePeer(this, {}, false);
    bool ended = n == 0;
    if (n <= 0 && !inPeer) {
        if (ended) server_.closePeer(this, {}, false);
        return interest();
    }
    const std::int64_t now = monotonicNow();
    if (n > 0) arrived_ = now;              // what has waited here came earlier
    if (line_.row().brought) server_.reactor_.stay(this);       // a service may run the event loop
    server_.reactor_.seen(now);
    const char* begin = inPeer ? in_.data() + taken_ : scratch.in;
    Frame frame{this, begin, begin + (inPeer ? unread() : static_cast<std::size_t>(n)), begin + (inPeer ? scanned_ : 0), inPeer, false,
                server_.frames_, began > 0 ? began : now};
    const bool all = size > 0 && n < static_cast<ssize_t>(size);     // that the socket had
    if (size > 0) fed_ = !all;
    dwelt_ = !all && now - looked_ > kLookAgain;
    server_.frames_ = &frame;
    ++server_.depth_;
    const AtEnd leave([&server = server_, &frame] {     // which may delete this
        server.frames_ = frame.outer;
        if (--server.depth_ == 0) server.closedPeers_.clear();
    });
    serve(frame, scratch);
    // One-way requests are executed although their sender has closed the connection.
    if (ended && !complete()) server_.closePeer(this, {}, false);
}

// Numbers of a long request go to where they belong. False: the line has ended.
bool Server::Peer::receiveApart() {
    const std::int64_t began = monotonicNow();
    ssize_t n = 1;
    for (std::size_t got = 0; n > 0 && apart_->filling() && got < kMostGrowth; got += std::size_t(n)) {
        std::size_t size = kReadSize;
        char* room = apart_->room(size);
        errno = EAGAIN;
        n = line_.read(room, size);
        if (n > 0) apart_->came(std::size_t(n));
    }
    if (n == 0 || (n < 0 && errno != EAGAIN)) return false;
    arrived_ = monotonicNow();
    server_.reactor_.seen(arrived_);
    server_.shares_.took(share_, arrived_ - began);
    server_.shares_.leave(share_, false);
    if (line_.pending()) server_.reactor_.again(this);
    interest();
    return true;
}

// The turn is over. What was not served stays, and is charged.   more: of it could have been served.
[[gnu::always_inline]] inline void Server::Peer::leave(Frame& frame, std::size_t coming, bool more, bool served) {
    std::size_t left = static_cast<std::size_t>(frame.end - frame.at);
    if (!frame.inPeer) in_.append(frame.at, left);
    else if (left > 0) taken_ = in_.size() - left;
    else in_.clear(), taken_ = 0;
    scanned_ = static_cast<std::size_t>(std::max<std::ptrdiff_t>(frame.scanned - frame.at, 0));
    if (in_.empty() && in_.capacity() > kKeepBuffer) server_.giveBack(in_);
    if (more || upgrading() || line_.pending()) server_.reactor_.again(this);
    bool half = !more && (left > 0 || pieces_.inside()) && queued() <= kQueueLimit;
    if (!half) halfSince_ = 0;
    else if (halfSince_ == 0 || served) halfSince_ = arrived_;
    if (slow()) server_.watchSlow(this);
    // For what is here, and for the rest of a long request. Requests that will soon be served are charged in any case.
    if (std::size_t held = begun() + std::max(coming, unread()); held != request_.bytes()) {
        if (!half) request_.force(held);
        else if (!stretch(request_, held)) server_.closePeer(this, requests.overBudget(server_.name_, held).what(), true);
    }
    if (coming >= record::kLong && open() && begun() == 0) beginApart();
    interest();
}

// The request that has begun may have long numbers. Its bytes are charged.
void Server::Peer::beginApart() {
    auto numbers = server_.spareApart_ ? std::move(server_.spareApart_) : std::make_unique<record::Apart>();
    if (numbers->begin(in_, taken_)) apart_ = std::move(numbers);
    else server_.spareApart_ = std::move(numbers);
}

void Server::Peer::handleLong(std::string_view record, Scratch& scratch, Frame& frame) {
    auto numbers = std::move(apart_);           // a service may run the event loop
    XdrReader r(record, *numbers);
    requests.handle(r, {}, record.size() + numbers->size(), scratch, frame);
    numbers->end();
    if (numbers->capacity() <= kKeepSpare) server_.spareApart_ = std::move(numbers);
}

void Server::Peer::serve(Frame& frame, Scratch& scratch) {
    int served = 0, count = 0;
    std::size_t coming = 0;                 // length of the request of which only a part is here
    bool more = false;
    if (pieces_.dropping() == 0 && frame.at < frame.end) frame.scanned += requests.scan(frame.scanned, frame.end);
    while (open() && !frame.spilled && !closing_ && !upgrading()) {
        if (dwelt_) [[unlikely]] lookAhead(frame);
        if (pieces_.dropping() > 0) [[unlikely]] pieces_.drop(frame.at, frame.end);
        const record::Piece piece = record::front(frame.at, frame.end);
        if (!piece.known) break;
        const std::size_t size = pieces_.size() + piece.length;        // of the record so far
        if (!requests.greeted && size > record::kMostBeforeHello) [[unlikely]] {
            end(scratch, "what came is not a record of ONC RPC, or it is longer than the " + std::to_string(record::kMostBeforeHello) +
                         " bytes that a record may have before HELLO");
            break;
        }
        if (size > static_cast<std::size_t>(server_.settings_.maxMessage)) {
            if (!skip(frame, scratch, piece.length, errors::errorOf(errors::kTooBig, server_.name_, "request", piece.length, "daemon " + server_.name_,
                                                                    server_.settings_.maxMessage))) break;
            continue;
        }
        if (!piece.whole) {
            if (piece.length > kReadSize && !apart_ && !request_.set(size)) [[unlikely]] {
                if (!skip(frame, scratch, piece.length, requests.overBudget(server_.name_, piece.length))) break;
                continue;
            }
            coming = piece.length;
            break;
        }
        if (served > 0) pay(frame);
        if (served >= kBatch || !server_.shares_.mayGoOn(share_) || queued() > kQueueLimit) {
            more = queued() <= kQueueLimit;
            break;
        }
        frame.at += piece.size();
        Buffer own;
        std::string_view record;
        const bool whole = pieces_.add(piece, own, record);
        if ((!whole || !own.empty()) && !mayKeep(size, whole ? own.capacity() : pieces_.capacity(), scratch)) [[unlikely]] break;
        if (whole || ++count % kPieces == 0) ++served;
        if (!whole) continue;
        const std::size_t before = scratch.out.size();
        if (!apart_) [[likely]] {
            XdrReader r(record);
            requests.handle(r, record, record.size(), scratch, frame);
        } else {
            handleLong(record, scratch, frame);
        }
        if (scratch.out.size() > before + kShort) frame.ran = 0;
        if (scratch.out.size() > kFlushAt || scratch.lent.data) flush(scratch);
    }
    if (heapOf(scratch.message) > kKeepSpare) freeMemory(scratch.message);
    if (more && held_.size() + scratch.out.size() < kHold) hold(scratch);
    else flush(scratch);
    frame.ran = 0;
    pay(frame);
    server_.shares_.leave(share_, more || (fed_ && served > 0));
    if (closing_) return server_.closePeer(this, *closing_, true);
    if (open() && !frame.spilled) leave(frame, coming, more, served > 0);
}

// A record of several pieces: may so much of it stay here?
bool Server::Peer::mayKeep(std::size_t size, std::size_t kept, Scratch& scratch) {
    if (size > kReadSize && !request_.set(kept)) end(scratch, requests.overBudget(server_.name_, kept).what());
    else if (pieces_.tooEmpty()) end(scratch, "a request came in too many empty fragments");
    else return true;
    return false;
}

// Close the connection after what was answered before.
void Server::Peer::end(Scratch& scratch, const std::string& reason) {
    flush(scratch);
    server_.closePeer(this, reason, true);
}

// Let others go first.
void Server::Peer::wait() {
    server_.shares_.leave(share_, true);
    if (!held_.empty()) push(nullptr, 0);
    if (open()) server_.reactor_.again(this);
}

// Charge the peer for the time since its last request. Not when the service has run the event loop: others had that time. The clock
// is read once for each request: its end is the beginning of the next one.
void Server::Peer::pay(Frame& frame) {
    if (frame.spilled) return;
    const std::int64_t known = std::exchange(frame.ran, 0), now = known != 0 ? known : monotonicNow();
    server_.shares_.took(share_, now - std::exchange(frame.since, now));
}

// While we were elsewhere callers may have cancelled their calls, or ended: look for that in the socket.
void Server::Peer::lookAhead(Frame& frame) {
    dwelt_ = false;
    looked_ = monotonicNow();
    if (pieces_.dropping() > 0 || (apart_ && apart_->filling())) return;        // in the middle of a record
    frame.scanned = std::max(frame.scanned, frame.at);
    pollfd state{line_.descriptor(), POLLRDHUP, 0};
    if (poll(&state, 1, 0) > 0) ended_ = true;
    // A long record of which the beginning is here is no CANCEL: only its rest is skipped, and its beginning not copied.
    std::size_t here = static_cast<std::size_t>(frame.end - frame.scanned), rest = 0;
    if (here > kLookSize) {
        rest = record::front(frame.scanned, frame.end).size() - here;
        here = 0;
    }
    if (rest >= kLookSize) return;
    Buffer& seen = server_.peeked_;
    seen.clear();
    seen.append(frame.scanned, here);
    const ssize_t n = line_.peek(seen.extend(kLookSize), kLookSize);
    if (n > static_cast<ssize_t>(rest)) requests.scan(seen.data() + rest, seen.data() + here + n);
}

// A record that is too long. Its beginning says whether to refuse the call and skip it, or to end the connection.
// False: wait for more of it.
bool Server::Peer::skip(Frame& frame, Scratch& scratch, std::size_t length, const Error& why) {
    constexpr std::size_t kNeeded = 24;                 // up to the procedure
    const char* const begin = frame.at + record::kMarkSize;
    if (frame.end - begin < std::ptrdiff_t(kNeeded)) return false;
    XdrReader r(begin, kNeeded);
    auto envelope = wire::readEnvelope(r);
    std::uint32_t rpcVersion = r.u32();
    bool call = pieces_.size() == 0 && r.good() && envelope.kind == 0 && rpcVersion == 2;
    if (!call) {
        end(scratch, "what came is not a record of ONC RPC, or it is longer than -maxmessage " + std::to_string(server_.settings_.maxMessage) + " bytes");
        return false;
    }
    requests.refuse(envelope.xid, scratch.out, why);
    frame.at = begin;
    pieces_.refuse(length);
    return true;
}

// ---- sending ----

void Server::Peer::flush(Scratch& scratch) {
    if (scratch.lent.data) [[unlikely]] {
        record::Source source(scratch.out, std::exchange(scratch.lent, {}));
        if (open()) push(source);
    } else if (!(scratch.out.empty() && held_.empty()) && open()) {
        push(scratch.out.data(), scratch.out.size());
    }
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
        if (!line_.writeMost(data, size)) return server_.closePeer(this, {}, false);
        if (size == 0) return;
    }
    queue(data, size);
    watchQueue();
}

void Server::Peer::push(record::Source& source) {
    if (!held_.empty()) push(nullptr, 0);
    while (open() && queued() == 0 && source.left() > 0) {
        const std::string_view piece = source.next();
        const char* at = piece.data();
        std::size_t left = piece.size();
        if (!line_.writeMost(at, left)) return server_.closePeer(this, {}, false);
        source.took(piece.size() - left);
        if (left > 0) break;
    }
    if (!open() || source.left() == 0) return;
    source.appendTo(roomToQueue(source.left()));
    interest();
    watchQueue();
}

void Server::Peer::watchQueue() {
    if (!stretch(queue_, out_.size())) return server_.closePeer(this, {}, false);
    server_.watchSlow(this);
}

// Keep it until the line takes more.
void Server::Peer::queue(const char* data, std::size_t size) {
    roomToQueue(size).append(data, size);
    interest();
}

Buffer& Server::Peer::roomToQueue(std::size_t size) {
    if (queued() > 0) return out_;
    stuckSince_ = monotonicNow();
    if (server_.spare_.capacity() >= size) {
        std::swap(out_, server_.spare_);
        out_.clear();
    }
    return out_;
}

void Server::Peer::drain() {
    const char* at = out_.data() + sent_;
    std::size_t left = queued();
    if (!line_.writeMost(at, left)) return server_.closePeer(this, {}, false);
    if (left < queued()) {
        stuckSince_ = monotonicNow();
        server_.reactor_.seen(stuckSince_);
    }
    sent_ = out_.size() - left;
    if (left == 0) {
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
    if (queued() <= kQueueLimit && (!in_.empty() || line_.pending())) server_.reactor_.again(this);
    interest();
}

// Read while the peer takes its replies; ask to write while it has any to take.
void Server::Peer::interest() {
    if (!open()) return;
    std::uint32_t wanted = line_.wants((reading() ? kReading : 0u) | (queued() > 0 ? std::uint32_t{EPOLLOUT} : 0u));
    if (line_.row().brought && reading()) server_.reactor_.stay(this);
    if (wanted == interest_) return;
    interest_ = wanted;
    server_.reactor_.change(line_.descriptor(), wanted, this);
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

void Server::Peer::pump() {
    Buffer& out = server_.events_;
    while (open() && !events_.empty() && queued() == 0) {
        out.clear();
        std::size_t served = 0;
        while (served < events_.size() && out.size() < kEventWindow) {
            Subscription* next = events_[served++];
            next->scheduled = next->pump(out);
            if (next->scheduled) events_.push_back(next);
        }
        events_.erase(events_.begin(), events_.begin() + std::ptrdiff_t(served));
        push(out.data(), out.size());
    }
}

// ---- the health responder's look ----

// Look at the bytes that were read and not served, then at those in the socket, so records in the order in which they came.
void Server::Peer::peek() {
    if (!open() || queued() > kQueueLimit || (upgrading() && !upgradeInClear())) return;
    const char* begin = in_.data() + taken_;
    const char* end = in_.data() + in_.size();
    for (Frame* f = server_.frames_; f; f = f->outer)
        if (f->peer == this && !f->spilled) begin = f->at, end = f->end;
    std::size_t unserved = static_cast<std::size_t>(end - begin);
    if (unserved > kLookSize) return;
    Buffer& seen = server_.peeked_;
    seen.clear();
    if (apart_ && apart_->filling()) return;            // behind a long request, which has not come
    seen.append(begin, unserved);
    ssize_t n = line_.peek(seen.extend(kLookSize), kLookSize);
    seen.resize(unserved + (n > 0 ? static_cast<std::size_t>(n) : 0));
    Buffer out;
    const std::size_t at = std::min(pieces_.dropping(), seen.size());
    std::string_view record;
    for (record::Reader records(seen.data() + at, seen.size() - at, SIZE_MAX); records.next(record) && requests.answerBusy(record, out);) {}
    // Queue what the socket does not take now: these requests are not answered again.
    if (line_.pending()) later([](Peer& peer) { peer.server_.reactor_.again(&peer); });
    const char* data = out.data();
    std::size_t left = out.size();
    if (queued() == 0) (void)line_.writeMost(data, left);
    if (left == 0) return;
    queue(data, left);
    queue_.force(out_.size());
    // The timer of those who take nothing is the SORM's thread's.
    later([](Peer& peer) { peer.server_.watchSlow(&peer); });
}

// A newcomer whose first bytes only say how it wants to speak. The reactor hears of it when the SORM's thread is back.
bool Server::Peer::upgradeInClear() {
    if (!line_.row().inClear || !line_.row().upgrade(line_, Transport::Stage::connected, {})) return false;
    state_ = State::greeting;
    later([](Peer& peer) { peer.interest(); });
    return true;
}

// From the health responder's thread: do that in the SORM's, if the peer is still there.
void Server::Peer::later(void (*what)(Peer&)) {
    server_.sorm_.mailbox()->post([self = std::weak_ptr(server_.self_), peer = this, number = number, what] {
        auto server = self.lock();
        if (!server) return;
        ServerLock::Held held((*server)->lock_);
        auto found = (*server)->peers_.find(peer);
        if (found != (*server)->peers_.end() && peer->number == number) what(*peer);
    });
}

}  // namespace sorma
