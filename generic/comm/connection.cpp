#include "comm/connectionParts.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/listText.h"
#include "bus/requestText.h"
#include "bus/statistics.h"
#include "comm/clock.h"
#include "comm/endpoint.h"
#include "comm/errors.h"
#include "comm/random.h"

namespace sorma {

namespace {

constexpr std::size_t kReadSize = 64 * 1024;
constexpr std::size_t kKeepBuffer = 4 << 20;            // a longer message's memory is given back
constexpr std::size_t kBatchSize = 32 * 1024;           // of submitted requests, before they are sent unasked
constexpr std::int64_t kClockTold = 1'000'000'000;      // [ns] a daemon with another clock hears that often what ours says
constexpr std::int64_t kLook = 20'000'000;              // [ns] a request that waits for another looks whether it was cancelled
constexpr std::int64_t kIdle = 1'000'000;               // [ns] silence after which a connection may have died unnoticed

std::uint32_t xidOf(std::uint32_t slot, std::uint32_t sequence) { return sequence << kSlotBits | slot; }

std::string printable(std::string_view bytes) {
    std::string out;
    for (char c : bytes.substr(0, 40)) out += c >= 0x20 && c < 0x7f ? c : '.';
    return out;
}

void pause(std::int64_t nanoseconds) {
    timespec t{nanoseconds / 1'000'000'000, nanoseconds % 1'000'000'000};
    nanosleep(&t, nullptr);
}

}  // namespace

Connection::Connection(std::string who, std::function<Address()> locate, std::shared_ptr<const Settings> settings, std::shared_ptr<Reactor> reactor,
                       std::shared_ptr<Mailbox> mailbox)
    : who_(std::move(who)), locate_(std::move(locate)), shared_(std::move(settings)), client_(randomNumber()), reactor_(std::move(reactor)),
      mailbox_(std::move(mailbox)) {}

Connection::~Connection() {
    disconnect();
    closeOpening();
}

void Connection::disconnect() {
    if (watched_) reactor_->remove(fd_, this);
    watched_ = false;
    interest_ = 0;
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    keepOneways();
    outgoing_.clear();
    outgoingAt_ = 0;
    controls_.clear();
    in_.clear();
    inAt_ = 0;
}

// ---- calls ----

void Connection::call(std::string_view name, Method method, Message& m, Deadline deadline, bool relayed, std::int64_t now) {
    std::uint32_t index = acquire(name, deadline);
    Slot& slot = *slots_[index];
    struct Leave {
        Connection& c;
        std::uint32_t index;
        ~Leave() { c.release(index); }
    } leave{*this, index};
    // For a call that is answered at once the clock is read only once, by the code that made the deadline: each reading is a
    // hundredth of an empty call.
    if (now == 0) now = monotonicNow();
    if (fd_ >= 0) checkIdle(now);
    if (fd_ < 0) {
        recover(deadline, &slot);
        now = monotonicNow();
    }
    if (!batch_.empty()) flush(deadline);
    if (!outgoing_.empty()) [[unlikely]] drain(deadline);
    slot.into = &m;
    if (CallContext::current() || relayed) [[unlikely]] {
        wire::Behalf behalf{relayed, CallContext::currentRequest(), CallContext::currentCallers()};
        write(index, method, m, now, &behalf);
    } else {
        write(index, method, m, now, nullptr);
    }
    slot.state = Slot::State::unsent;
    // A call counts as sent when the kernel has taken its last byte: the daemon cannot execute a part of it.
    std::size_t taken = 0;
    if (fd_ >= 0 && transmit(slot.request.data(), slot.request.size(), deadline, &taken)) {
        slot.state = Slot::State::sent;
        ++inFlight_;
    } else {
        slot.cut = taken > 0;
    }
    std::int64_t outer = std::exchange(callTime_, now);
    struct Forget {
        std::int64_t& time;
        std::int64_t outer;
        ~Forget() { time = outer; }
    } forget{callTime_, outer};
    await(index, deadline.none() ? deadline.left() : slot.budget);
    if (!arrived_.empty()) [[unlikely]] deliverLater();
    if (slot.failed) throw Error(std::move(slot.failure));
    if (m.code < 0) {
        if (m.trail.empty()) sorma::fail(errors::kCode, fullName(slot), m.code);
        throw Error(m.trail);
    }
}

Connection::Ticket Connection::submit(std::string_view name, Method method, const Message& m, Deadline deadline) {
    std::uint32_t index = acquire(name, deadline);
    Slot& slot = *slots_[index];
    try {
        if (fd_ < 0) recover(deadline, &slot);
        write(index, method, m, monotonicNow(), nullptr);
        slot.state = Slot::State::unsent;
        unsent_.push_back(index);
        batch_.append(slot.request.data(), slot.request.size());
        if (batch_.size() >= kBatchSize) flush(deadline);
    } catch (...) {
        release(index);
        throw;
    }
    return index;
}

void Connection::flush(Deadline deadline) {
    if (unsent_.empty()) return;
    if (!outgoing_.empty()) drain(deadline);
    if (batch_.empty())
        for (auto index : unsent_) batch_.append(slots_[index]->request.data(), slots_[index]->request.size());
    for (auto index : unsent_)
        if (slots_[index]->state == Slot::State::unsent) {
            slots_[index]->state = Slot::State::sent;
            ++inFlight_;
        }
    unsent_.clear();
    Buffer bytes;
    std::swap(bytes, batch_);                           // losing the connection meanwhile starts a new batch
    transmit(bytes.data(), bytes.size(), deadline);
    if (batch_.empty()) {
        bytes.clear();
        std::swap(bytes, batch_);
    }
}

void Connection::collect(Ticket ticket, Message& m) {
    if (ticket >= slots_.size() || slots_[ticket]->state == Slot::State::free)
        sorma::fail(errors::kLimit, who_, "this call has been collected already");
    Slot& slot = *slots_[ticket];
    struct Leave {
        Connection& c;
        std::uint32_t index;
        ~Leave() { c.release(index); }
    } leave{*this, ticket};
    if (!unsent_.empty()) flush(slot.deadline);
    await(ticket);
    if (slot.failed) throw Error(std::move(slot.failure));
    m.swap(slot.result);
    if (m.code < 0) throw Error(m.trail);
}

std::uint32_t Connection::acquire(std::string_view name, Deadline deadline) {
    if (free_.empty()) {
        std::size_t most = daemon_.slots != 0 ? std::min<std::size_t>(daemon_.slots, kControl) : 1;
        const bool full = slots_.size() >= std::max<std::size_t>(most, 1);
        if (full) renewSlots(deadline);
        if (full && free_.empty())
            sorma::fail(errors::kLimit, who_, std::to_string(slots_.size()) + " calls are in flight already, the daemon takes at most " +
                                                  std::to_string(most) + "; raise it there: sorma::configure -inflight N");
        if (free_.empty()) {
            free_.push_back(static_cast<std::uint32_t>(slots_.size()));
            slots_.push_back(std::make_unique<Slot>());
        }
    }
    std::uint32_t index = free_.back();
    free_.pop_back();
    Slot& slot = *slots_[index];
    slot.name = name;
    slot.deadline = deadline;
    slot.budget = fd_ < 0 ? deadline.left() : 0;        // otherwise write() takes the time anyway
    slot.failed = slot.orphan = slot.cut = slot.unsure = false;
    slot.into = nullptr;
    slot.state = Slot::State::done;                     // in use, nothing sent yet
    return index;
}

void Connection::release(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (slot.state == Slot::State::sent) {              // its reply may still come: the slot is not free before
        slot.state = Slot::State::unwanted;
        slot.into = nullptr;
        return;
    }
    if (slot.state == Slot::State::unsent) {
        // Its bytes are in the batch, between others: build the batch again without them.
        std::erase(unsent_, index);
        batch_.clear();
        for (auto other : unsent_) batch_.append(slots_[other]->request.data(), slots_[other]->request.size());
        --slot.sequence;
    }
    slot.into = nullptr;
    if (std::exchange(slot.unsure, false)) {
        slot.state = Slot::State::unwanted;            // should the daemon come back, see probe()
        ++inFlight_;
        return;
    }
    slot.state = Slot::State::free;
    if (slot.request.capacity() > kKeepBuffer) slot.request.release();
    free_.push_back(index);
}

// Replace a request that was cancelled by another one of the same number. Either the daemon answers with its reply to the
// first one; or it does not know that one, executes this one, and will never execute the first. Then the slot is free again.
void Connection::probe(std::uint32_t index) {
    Slot& slot = *slots_[index];
    Message m;
    m.words = {"-info", "name"};
    slot.request.release();
    wire::writeCall(slot.request, xidOf(index, slot.sequence), program_, {index, slot.sequence, 0, Method::dbx, "sorm"}, m);
}

// On a new connection: is there something to send again?
bool Connection::toResend(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (slot.state == Slot::State::unwanted) return probe(index), true;
    if (slot.state == Slot::State::unsent && slot.orphan) return release(index), false;
    return slot.state == Slot::State::sent || slot.state == Slot::State::unsent;
}

// Do all slots that are in use belong to calls that were cancelled? A daemon that is only slow answers them in the end. But
// if a record was damaged on its way, that answer never comes, or we cannot read it.
bool Connection::exhausted() const {
    constexpr std::int64_t kPatience = 5'000'000'000;       // [ns] with a new connection that has not answered any
    if (fd_ >= 0 && !answered_ && monotonicNow() - since_ < kPatience) return false;
    return std::all_of(slots_.begin(), slots_.end(), [](auto& s) { return s->state == Slot::State::unwanted || s->state == Slot::State::free; });
}

// A new connection finds out which of them can be used again, see toResend().
void Connection::renewSlots(Deadline deadline) {
    if (!exhausted()) return;
    if (fd_ >= 0) lost("no reply came to any of " + std::to_string(inFlight_) + " calls");
    recover(deadline, nullptr);
    while (fd_ >= 0 && free_.empty() && !CallContext::currentGivenUp() && receive(deadline)) {}
}

void Connection::write(std::uint32_t index, Method method, const Message& m, std::int64_t now, const wire::Behalf* behalf) {
    Slot& slot = *slots_[index];
    wire::Request request{index, ++slot.sequence, 0, method, slot.name};
    ++calls_;
    slot.request.clear();
    if (!slot.deadline.none()) {
        slot.budget = std::max<std::int64_t>(slot.deadline.when() - now, 0);
        if (daemon_.clock.empty()) {
            request.deadline = static_cast<std::uint32_t>(std::min<std::int64_t>(slot.budget / 1'000'000 + 1, UINT32_MAX));
        } else {
            request.deadline = deadlineMark(slot.deadline, now);
            if (otherClock_ && now - clockSaid_ > kClockTold) wire::writeClock(slot.request, program_, clockSaid_ = now);
        }
    }
    const std::size_t before = slot.request.size();
    wire::writeCall(slot.request, xidOf(index, slot.sequence), program_, request, m, wire::kCall, behalf);
    std::size_t size = slot.request.size() - before - wire::kMarkSize;
    std::size_t most = std::min<std::size_t>(daemon_.maxMessage, static_cast<std::size_t>(settings_.maxMessage));
    if (size > most) {
        --slot.sequence;
        slot.request.release();
        sorma::fail(errors::kTooBig, fullName(slot), "request", size, most < daemon_.maxMessage ? "this process" : "daemon " + daemon_.name, most);
    }
}

void Connection::await(std::uint32_t index, std::int64_t left) {
    Slot& slot = *slots_[index];
    while (slot.state == Slot::State::sent || slot.state == Slot::State::unsent) {
        if (fd_ < 0) {
            recover(slot.deadline, &slot);
            left = -1;
            continue;
        }
        if (left < 0) left = slot.deadline.left();
        if (CallContext::currentGivenUp()) [[unlikely]] {
            tellCancel(index);
            sorma::fail(errors::kGivenUp, fullName(slot), "daemon " + daemon_.name);
        }
        if (receive(slot.deadline, std::exchange(left, -1))) continue;
        if (slot.state == Slot::State::sent) tellCancel(index);
        failTimeout(&slot, fullName(slot), {});
    }
}

void Connection::failTimeout(const Slot* waiting, const std::string& whom, const std::string& lastError) {
    std::int64_t budget = !waiting ? 0 : waiting->budget > 0 ? waiting->budget : settings_.timeout * 1'000'000;
    std::string patience = budget > 0 ? durationText(double(budget)) : std::string("time");
    if (waiting && waiting->state == Slot::State::sent) sorma::fail(errors::kTimeoutSent, whom, patience, address_);
    if (waiting && waiting->cut) sorma::fail(errors::kTimeoutCut, whom, "the daemon", patience, lastError);
    sorma::fail(errors::kTimeoutUnsent, whom, "the daemon", patience, lastError);
}

// A connection that was quiet may have been closed by the other side, and TCP would still take our bytes. So look first:
// then "never sent" is true. Calls that were cancelled do not count here.
void Connection::checkIdle(std::int64_t now) {
    if (now - lastHeard_ < kIdle) return;
    auto awaited = [](auto& slot) { return slot->state == Slot::State::sent; };
    if (inFlight_ > 0 && std::any_of(slots_.begin(), slots_.end(), awaited)) return;
    char c;
    ssize_t n;
    while ((n = recv(fd_, &c, 1, MSG_PEEK | MSG_DONTWAIT)) > 0) {
        receive(Deadline::in(1000));                    // a GOODBYE, most likely
        if (fd_ < 0) return;
    }
    if (n < 0 && errno == EAGAIN) return;
    lost(n == 0 ? "the daemon closed it" : std::strerror(errno));
}

// Tell the daemon that the caller has cancelled the call: the service may stop early.
void Connection::tellCancel(std::uint32_t index) {
    Buffer bytes;
    wire::writeCancel(bytes, program_, {index, slots_[index]->sequence});
    sendBytes(std::move(bytes));
    if (!outgoing_.empty()) watch();
}

bool Connection::transmit(const char* data, std::size_t size, Deadline deadline, std::size_t* taken) {
    while (size > 0) {
        ssize_t n = send(fd_, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n > 0) {
            if (taken) *taken += static_cast<std::size_t>(n);
            data += n;
            size -= static_cast<std::size_t>(n);
            continue;
        }
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno == EAGAIN) {
            // The daemon may wait until we take its replies: read while we wait to write.
            pollfd p{fd_, POLLIN | POLLOUT, 0};
            int ready = poll(&p, 1, int(std::min<std::int64_t>(deadline.left() / 1'000'000 + 1, 60'000)));
            if (ready > 0 && (p.revents & POLLIN)) {
                receive(deadline);
                if (fd_ < 0) return false;
            }
            if (!deadline.passed()) continue;
            // Half a record stands on the wire: nothing else can follow it.
            return lost("the daemon did not read the request in time"), false;
        }
        return lost(std::strerror(errno)), false;
    }
    return true;
}

bool Connection::receive(Deadline deadline, std::int64_t left) {
    if (left == 0) return false;
    // The socket's own timeout serves as the deadline, so that a call costs no poll; it is set again only when it
    // would wait too long. A shorter one just makes us look again.
    if (CallContext::current()) left = std::min(left, kLook);
    if (receiveTimeout_ == 0 || receiveTimeout_ > left) {
        if (left > 3'600'000'000'000) left = 3'600'000'000'000;
        if (left < 1'000'000) left = 1'000'000;
        timeval t{left / 1'000'000'000, left % 1'000'000'000 / 1000};
        setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &t, sizeof t);
        receiveTimeout_ = left;
    }
    ssize_t n = read(0);
    if (n == 0) return lost("the daemon closed it"), true;
    if (n < 0) {
        if (errno == EINTR) return true;
        if (errno == EAGAIN) {
            receiveTimeout_ = 0;                        // it was shorter than the deadline, or the deadline is here
            return !deadline.passed();
        }
        return lost(std::strerror(errno)), true;
    }
    takeRecords();
    return true;
}

ssize_t Connection::read(int flags) {
    std::size_t half = in_.size();
    std::size_t size = std::max(kReadSize, std::min(half, std::size_t{8} << 20));
    char* room = in_.extend(size);
    ssize_t n = recv(fd_, room, size, flags);
    in_.resize(half + (n > 0 ? static_cast<std::size_t>(n) : 0));
    return n;
}

bool Connection::takeRecords() {
    while (in_.size() - inAt_ >= wire::kMarkSize) {
        XdrReader marks(in_.data() + inAt_, wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        if (!(mark & wire::kLastFragment) || length > static_cast<std::size_t>(settings_.maxMessage)) {
            unread_ = printable(std::string_view(in_.data() + inAt_, in_.size() - inAt_));
            disconnect();
            lost("what came is not a record of ONC RPC, or it is longer than -maxmessage");
            return false;
        }
        if (in_.size() - inAt_ < wire::kMarkSize + length) break;
        std::string_view record(in_.data() + inAt_ + wire::kMarkSize, length);
        inAt_ += wire::kMarkSize + length;
        take(record);
        if (fd_ < 0) return false;
    }
    in_.drop(inAt_);
    inAt_ = 0;
    if (in_.empty() && in_.capacity() > kKeepBuffer) in_.release();
    return true;
}

void Connection::take(std::string_view record) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    lastHeard_ = callTime_ != 0 ? callTime_ : monotonicNow();
    if (r.good() && envelope.kind == 0) {
        auto header = wire::readCallHeader(r, envelope.xid);
        if (header.procedure == wire::kGoodbye) lastWords_ = std::string(r.text());
        if (header.procedure == wire::kEvent) takeEvent(r);
        return;
    }
    std::uint32_t index = envelope.xid & ((1u << kSlotBits) - 1);
    if (r.good() && index == kControl) [[unlikely]] {
        auto found = controls_.find(envelope.xid);
        if (found == controls_.end()) return;
        auto handler = std::move(found->second);
        controls_.erase(found);
        return handler(r, wire::readReplyHeader(r));
    }
    if (!r.good() || index >= slots_.size()) {
        disconnect();
        return lost("a record that is no reply to any call");
    }
    Slot& slot = *slots_[index];
    bool ours = (slot.state == Slot::State::sent || slot.state == Slot::State::unwanted) &&
                envelope.xid == xidOf(index, slot.sequence);
    if (!ours) return;                                  // late, and nobody waits
    --inFlight_;
    answered_ = true;
    if (slot.state == Slot::State::unwanted) {
        slot.state = Slot::State::free;
        free_.push_back(index);
        return;
    }
    std::string objection = wire::readReplyHeader(r);
    Message& m = slot.pending ? slot.pending->message : slot.into ? *slot.into : slot.result;
    if (objection.empty() && !wire::readReply(r, times_, m)) objection = "its reply could not be decoded";
    slot.state = Slot::State::done;
    if (!objection.empty())
        fail(index, Trail(makeEntry(errors::kProtocol, {MessageArg::of(fullName(slot)), MessageArg::of(address_), MessageArg::of(objection),
                                                        MessageArg::of("are both of the same version?")})));
    if (slot.pending) settle(index);
}

void Connection::fail(std::uint32_t index, Trail trail) {
    Slot& slot = *slots_[index];
    slot.state = Slot::State::done;
    slot.failed = true;
    slot.failure = std::move(trail);
}

// ---- the connection itself ----

void Connection::connect(Deadline deadline) {
    if (fd_ < 0) recover(deadline, nullptr);
}

void Connection::open(const std::string& whom, Deadline deadline) {
    closeOpening();
    Address address = locate_();
    program_ = address.kind == Address::Kind::program ? wire::kProgramBase + address.number : wire::kProgram;
    address_ = address.kind == Address::Kind::alias ? runtimeSocket(address.host) : describe(address);
    wait_ = address.wait;
    hungUp_ = false;
    fd_ = connectTo(address, whom, deadline);
    absentSince_ = 0;
    receiveTimeout_ = 0;
    in_.clear();
    inAt_ = 0;
    unread_.clear();
    lastWords_.clear();
    try {
        greet(whom, deadline);
    } catch (...) {
        disconnect();
        throw;
    }
}

bool Connection::sayHello(int fd) {
    auto& self = Caller::self();
    Buffer out;
    wire::writeHello(out, 0, program_, {client_, self.user, self.host, self.program, self.process,
                                       static_cast<std::uint32_t>(settings_.maxMessage), clockSeen(), monotonicNow()});
    return send(fd, out.data(), out.size(), MSG_NOSIGNAL | MSG_DONTWAIT) == static_cast<ssize_t>(out.size());
}

void Connection::greet(const std::string& whom, Deadline deadline) {
    std::string record, why;
    hungUp_ = !sayHello(fd_);
    if (!hungUp_) why = readWhole(deadline, record);
    else why = std::strerror(errno);
    if (!why.empty()) {
        if (why == "deadline") sorma::fail(errors::kConnectTimeout, whom, address_ + " (it is connected, but does not answer)");
        if (hungUp_) sorma::fail(errors::kRefused, whom, address_, why, "it may be ending, or full");
        sorma::fail(errors::kProtocol, whom, address_, why, "is the address right?");
    }
    welcomed(whom, record);
}

// The daemon's answer to HELLO. It says which daemon this is, and so what happens to calls without a reply.
void Connection::welcomed(const std::string& whom, const std::string& record) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    if (r.good() && envelope.kind == 0) {               // the daemon speaks first when it will not serve us
        auto header = wire::readCallHeader(r, envelope.xid);
        std::string reason(r.text());
        if (header.procedure == wire::kGoodbye && r.good()) sorma::fail(errors::kDaemonLimit, whom, address_, reason);
    }
    std::string objection = r.good() ? wire::readReplyHeader(r) : "its answer is not a message of ONC RPC";
    wire::Welcome welcome;
    if (objection.empty() && !wire::readWelcome(r, welcome)) objection = "its welcome could not be decoded";
    if (!objection.empty()) sorma::fail(errors::kProtocol, whom, address_, objection, "is the address right?");
    bool first = daemon_.boot == 0, sameDaemon = welcome.boot == daemon_.boot;
    if (!first && !sameDaemon)
        failSent({"the daemon has ended", "another one answers there now: " + welcome.program + "[" + std::to_string(welcome.process) + "]"});
    else if (!first && !welcome.known)
        failSent({"the daemon does not know this client any more", "ask there what became of it"});
    daemon_ = welcome;
    otherClock_ = daemon_.clock != clockSeen();
    since_ = lastHeard_ = monotonicNow();
    if (first || !sameDaemon) ++boots_;
    pause_ = 0;
    answered_ = false;
    tellChange();
    if (!first && !sameDaemon)
        for (auto& [number, callback] : std::map(restarted_)) {
            try {
                callback();
            } catch (const std::exception&) {           // the others are called all the same
            }
        }
    if (!oneways_.empty()) sendBytes(std::exchange(oneways_, {}), true);
    resubscribe();
}

// One whole record while nothing else is under way. Returns what went wrong, "deadline" for the deadline.
std::string Connection::readWhole(Deadline deadline, std::string& record) {
    Buffer in;
    for (;;) {
        if (in.size() >= wire::kMarkSize) {
            XdrReader marks(in.data(), wire::kMarkSize);
            std::uint32_t mark = marks.u32();
            std::size_t length = mark & ~wire::kLastFragment;
            if (!(mark & wire::kLastFragment) || length > 1 << 20) return "it said \"" + printable(std::string_view(in.data(), in.size())) + "\"";
            if (in.size() >= wire::kMarkSize + length) {
                record.assign(in.data() + wire::kMarkSize, length);
                in_.append(in.data() + wire::kMarkSize + length, in.size() - wire::kMarkSize - length);
                return {};
            }
        }
        pollfd p{fd_, POLLIN, 0};
        int n = poll(&p, 1, int(std::min<std::int64_t>(deadline.left() / 1'000'000 + 1, 60'000)));
        if (n < 0 && errno != EINTR) return std::strerror(errno);
        if (n <= 0) {
            if (deadline.passed()) return "deadline";
            continue;
        }
        std::size_t before = in.size();
        ssize_t got = recv(fd_, in.extend(4096), 4096, MSG_DONTWAIT);
        in.resize(before + (got > 0 ? static_cast<std::size_t>(got) : 0));
        hungUp_ = got == 0 || (got < 0 && errno == ECONNRESET);     // also in the middle of its welcome
        if (hungUp_ && in.empty()) return "it closed the connection without a word";
        if (hungUp_) return "it closed the connection after \"" + printable(std::string_view(in.data(), in.size())) + "\"";
        if (got < 0 && errno != EAGAIN && errno != EINTR) return std::strerror(errno);
    }
}

// The connection broke. Calls that were sent keep their slots until we know which daemon answers next.
void Connection::lost(const std::string& how) {
    // Replies and a GOODBYE may still be in the socket: read them, so that fewer calls have an unknown result.
    while (fd_ >= 0 && read(MSG_DONTWAIT) > 0) takeRecords();
    how_ = lastWords_.empty() ? how : "the daemon said: " + lastWords_;
    if (!unread_.empty()) how_ += " (\"" + unread_ + "\")";
    disconnect();
    ++reconnects_;
    tellChange();
    if (wanted()) retry();
    else releaseSelf();
}

// Does nothing listen there?
bool Connection::absent(const Error& e) const { return (e.is("COMM REFUSED") || e.is("ADDRESS UNRESOLVED")) && !hungUp_; }

// A daemon that was there before may come back, unless it has said GOODBYE. One that was never there is reported at once,
// unless the address says -wait.
bool Connection::mayCome(const Error& e) const {
    if (absent(e)) return wait_ || (daemon_.boot != 0 && lastWords_.empty());
    return daemon_.boot != 0 && (hungUp_ || e.is("COMM LIMIT") || e.is("COMM TIMEOUT"));
}

// The connection cannot be made again: what becomes of calls that were sent? If nothing listens for a moment, the daemon may
// still be there, behind a tunnel for instance. It has certainly ended when it said GOODBYE, or when its process has ended.
void Connection::conclude(const Error& e) {
    if (e.is("COMM PROTOCOL")) return failSent({"something else answers there now", e.what(), false});
    if (!absent(e)) return;
    std::int64_t now = monotonicNow();
    if (absentSince_ == 0) absentSince_ = now;
    if (!lastWords_.empty() || hasEnded(daemon_.process, daemon_.processes))
        failSent({"the daemon has ended", "nothing listens there now: is it started again?"});
    else if (now - absentSince_ > kAbsence)
        failSent({"nothing has listened there for " + durationText(double(now - absentSince_)), "ask there what became of it", false});
}

// Connect again, within the deadline.
// waiting: the slot that waits for this, if any; it stops when that one has failed.
void Connection::recover(Deadline deadline, const Slot* waiting) {
    std::int64_t pauseTime = kFirstPause;
    std::string whom = waiting ? fullName(*waiting) : who_;
    // An attempt that the reactor has begun goes on: a caller that waits many times for a short time must not begin it each
    // time.
    finishOpening(deadline);
    if (opening_) sorma::fail(errors::kConnectTimeout, whom, address_ + " (it is connected, but does not answer)");
    if ((waiting && waiting->failed) || (driven_ && hasArrived(*driven_))) return;
    while (fd_ < 0) {
        std::string problem = "it breaks off each new connection";
        try {
            open(whom, deadline);
        } catch (const Error& e) {
            conclude(e);
            if ((waiting && waiting->failed) || (driven_ && hasArrived(*driven_))) return;
            if (!mayCome(e)) throw;
            if (CallContext::currentGivenUp()) {
                if (waiting && waiting->state == Slot::State::sent) sorma::fail(errors::kGivenUp, whom, "nobody");
                sorma::fail(errors::kGivenUpUnsent, whom);
            }
            problem = e.what();
        }
        if (fd_ >= 0) resend(deadline);
        if (fd_ >= 0 && wanted()) {
            sendWaiting();
            watch();
        }
        if ((waiting && waiting->failed) || (driven_ && hasArrived(*driven_)) || fd_ >= 0) return;
        std::int64_t left = deadline.left();
        pause(std::min(left, pauseTime));
        if (left <= pauseTime) failTimeout(waiting, whom, problem);
        pauseTime = std::min(pauseTime * 2, kLastPause);
    }
}

// After a broken connection to a daemon that still lives: send again what it may not have got. It knows what it has.
void Connection::resend(Deadline deadline) {
    unsent_.clear();
    batch_.clear();
    if (!outgoing_.empty() && !drain(deadline)) return;
    for (std::size_t i = 0; i < slots_.size() && fd_ >= 0; ++i) {
        Slot& slot = *slots_[i];
        if (!toResend(i)) continue;
        if (transmit(slot.request.data(), slot.request.size(), deadline)) sent(i);
    }
    if (fd_ >= 0) return;
    for (std::uint32_t i = 0; i < slots_.size(); ++i)           // calls that were not sent wait for the next connection
        if (slots_[i]->state == Slot::State::unsent) unsent_.push_back(i);
}

std::uint64_t Connection::onRestart(std::function<void()> callback) {
    restarted_.emplace(nextRestart_, std::move(callback));
    return nextRestart_++;
}

void Connection::cancelRestart(std::uint64_t number) { restarted_.erase(number); }

// Fail the calls that were sent and will get no reply.
void Connection::failSent(const Verdict& verdict) {
    for (std::uint32_t i = 0; i < slots_.size(); ++i) {
        Slot& slot = *slots_[i];
        if (slot.state == Slot::State::unwanted && verdict.ended) {
            --inFlight_;
            slot.state = Slot::State::free;
            free_.push_back(i);
        } else if (slot.state == Slot::State::sent) {
            --inFlight_;
            slot.unsure = !verdict.ended;
            fail(i, Trail(makeEntry(errors::kLost, {MessageArg::of(fullName(slot)), MessageArg::of(address_), MessageArg::of(daemon_.name),
                                                    MessageArg::of(age()), MessageArg::of(how_), MessageArg::of(verdict.why), MessageArg::of(verdict.hint)})));
            if (slot.pending) settle(i);
        }
    }
}

void Connection::ping(Deadline deadline) {
    Message m;
    m.words = {"-info", "name"};
    call("sorm", Method::dbx, m, deadline);
}

void Connection::close(const std::string& reason) {
    if (fd_ < 0) return;
    how_ = reason;
    disconnect();
    failSent({"it was closed on this side", "ask there what became of it", false});
    if (!arrived_.empty()) deliverLater();
}

std::string Connection::age() const { return durationText(double(monotonicNow() - since_)); }

std::string Connection::row() const {
    std::string seconds = fd_ >= 0 ? std::to_string((monotonicNow() - since_) / 1'000'000'000) : std::string();
    return listOf({"to", who_, address_, seconds, std::to_string(calls_), std::to_string(inFlight_)});
}

std::string Connection::facts() const {
    std::string out = "daemon " + daemon_.name + " at " + address_;
    out += fd_ >= 0 ? ", connected for " + age() : ", not connected" + (how_.empty() ? std::string() : ": " + how_);
    out += "\nserved by " + daemon_.user + "@" + daemon_.host + " " + daemon_.program + "[" + std::to_string(daemon_.process) +
           "] since " + clockText(daemon_.started);
    out += "\ncalls " + std::to_string(calls_) + ", in flight " + std::to_string(inFlight_) + ", connections lost " +
           std::to_string(reconnects_) + ", daemons seen " + std::to_string(boots_);
    if (dropped_ > 0) out += "\none-way requests never sent " + std::to_string(dropped_);
    out += "\nlast reply: waited " + std::to_string(times_.waited) + " us, ran " + std::to_string(times_.ran) + " us, of which sub-calls " +
           std::to_string(times_.sub) + " us";
    return out;
}

}  // namespace sorma
