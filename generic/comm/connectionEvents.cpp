// The half of a connection that the reactor drives: calls that were begun, subscriptions, reconnection without blocking.
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <cerrno>
#include <cstring>

#include "bus/statistics.h"
#include "comm/connectionParts.h"
#include "comm/endpoint.h"
#include "comm/errors.h"

namespace sorma {

namespace {

constexpr std::int64_t kOpenTime = 5'000'000'000;       // [ns] for an address to be connected and the daemon to greet

const Prototype kFull{Severity::error, "COMM LIMIT", 1,
    "{}: {} bytes of one-way requests wait for {} already, which does not read them; never sent; see sorma::configure -onewayqueue and -onewaywait"};
const Prototype kDropped{Severity::warning, "COMM LOST", 1, "{}: {} one-way requests were never sent: {}"};
const Prototype kNotGreeted{Severity::error, "COMM TIMEOUT", 1, "{}: {} is connected, but does not answer; never sent"};

std::size_t recordSize(const Buffer& bytes, std::size_t at) {
    return wire::kMarkSize + (XdrReader(bytes.data() + at, wire::kMarkSize).u32() & ~wire::kLastFragment);
}

std::size_t recordsIn(const Buffer& bytes) {
    std::size_t n = 0;
    for (std::size_t at = 0; at < bytes.size(); at += recordSize(bytes, at)) ++n;
    return n;
}

// A daemon that runs answers quickly. Waiting that long gets a request on its way although no event loop runs.
std::int64_t moment(const Settings& settings) {         // [ms]
    constexpr std::int64_t kMoment = 10;
    return settings.timeout > 0 ? std::min(settings.timeout, kMoment) : kMoment;
}

}  // namespace

// ---- calls that are begun ----

void Connection::begin(const PendingPointer& pending, const std::string& name, Method method) {
    pending->carrier = this;
    pending->ticket = kNoTicket;
    pending->who = name + "@" + who_;
    if (pendings_++ == 0) keep_ = shared_from_this();
    addDeadline(pending);
    if (pending->asker) pending->sent = monotonicNow();
    if (fd_ >= 0) checkIdle(monotonicNow());
    (method == Method::exec ? waiting_ : urgent_).push_back({pending, name, method});
    if (fd_ >= 0) {
        sendWaiting();
    } else if (!opening_ && !retryTimer_) {
        startOpening();
        if (!background_) finishOpening(Deadline::in(moment(settings_)));
    }
    watch();
    if (!arrived_.empty()) deliverLater();
}

// Wait for the connection that is being made, without the event loop.
void Connection::finishOpening(Deadline deadline) {
    while (opening_ && !deadline.passed()) {
        pollfd p{opening_->fd, short(opening_->greeting ? POLLIN : POLLOUT), 0};
        int patience = deadline.none() ? -1 : int(std::min<std::int64_t>(deadline.left() / 1'000'000 + 1, INT_MAX));
        if (poll(&p, 1, patience) > 0) ready(std::uint32_t(p.revents));
    }
}

// The SORM ends: no caller and no listener is told anything.
void Connection::end() {
    auto keep = shared_from_this();
    close("the program ends its use of it");
    closeOpening();
    retryTimer_.cancel();
    deadlineTimer_.cancel();
    waiting_.clear();
    urgent_.clear();
    arrived_.clear();
    for (auto& slot : slots_) slot->pending.reset();
    oneways_.release();
    whenDropped = nullptr;
    keep_.reset();
}

void Connection::oneway(const std::string& name, Method method, const Message& m, bool relayed) {
    if (fd_ >= 0) checkIdle(monotonicNow());
    try {
        if (fd_ < 0 && daemon_.boot == 0) recover(Deadline::in(settings_.timeout), nullptr);
    } catch (const Error& e) {
        return dropped(1, e.what());
    }
    const std::size_t most = std::size_t(settings_.onewayQueue);
    if (backlog() > most) {
        if (!inEvents_) makeRoom(most, Deadline::at(monotonicNow() + settings_.onewayWait * 1'000'000));
        if (backlog() > most) sorma::fail(kFull, name + "@" + who_, backlog(), who_);
    }
    Buffer bytes;
    wire::Behalf behalf{relayed, CallContext::currentRequest(), CallContext::currentCallers()};
    wire::writeCall(bytes, 0, program_, {wire::kNoSlot, 0, 0, method, name}, m, wire::kOneway,
                    relayed || CallContext::current() ? &behalf : nullptr);
    // One-way requests that wait are one piece of bytes.
    if (!outgoing_.empty() && outgoing_.back().oneway) outgoing_.back().bytes.append(bytes.data(), bytes.size());
    else sendBytes(std::move(bytes), true);
    if (!keep_ && (!outgoing_.empty() || !oneways_.empty())) keep_ = shared_from_this();
    if (fd_ < 0 && !opening_ && !retryTimer_) {
        startOpening();
        finishOpening(Deadline::in(moment(settings_)));
    }
    watch();
}

std::size_t Connection::backlog() const {
    std::size_t bytes = oneways_.size();
    for (auto& o : outgoing_) bytes += o.bytes.size();
    return outgoing_.empty() || outgoing_.front().slot != kControl ? bytes : bytes - outgoingAt_;
}

void Connection::makeRoom(std::size_t most, Deadline deadline) {
    auto keep = shared_from_this();
    sendUntil(deadline, [&] { return backlog() <= most; });
    if (!arrived_.empty()) deliverLater();
}

// The connection broke: keep the one-way requests whose last byte the socket has not taken.
void Connection::keepOneways() {
    std::size_t taken = outgoingAt_;
    for (auto& o : outgoing_) {
        std::size_t at = 0;
        while (o.oneway && at < taken && at + recordSize(o.bytes, at) <= taken) at += recordSize(o.bytes, at);
        if (o.oneway) keepOneway(o.bytes.data() + at, o.bytes.size() - at);
        taken = 0;
    }
}

void Connection::keepOneway(const char* records, std::size_t size) {
    if (oneways_.empty()) onewaysSince_ = monotonicNow();
    oneways_.append(records, size);
}

// One-way requests will never be sent.
void Connection::dropped(std::size_t count, const std::string& why) {
    dropped_ += count;
    whyDropped_ = why;
    if (whenDropped) whenDropped(Trail(makeEntry(kDropped, {MessageArg::of(who_), MessageArg::of(count), MessageArg::of(why)})));
}

void Connection::dropOneways(const std::string& why) {
    const std::size_t count = recordsIn(oneways_);
    oneways_.release();
    if (count > 0) dropped(count, why);
    releaseSelf();
}

std::string Connection::finish(Deadline deadline) {
    auto keep = shared_from_this();
    try {
        if (fd_ < 0 && !oneways_.empty()) recover(deadline, nullptr);
    } catch (const Error& e) {
        dropOneways(e.what());
    }
    makeRoom(0, deadline);
    std::size_t left = recordsIn(oneways_);
    for (auto& o : outgoing_)
        if (o.oneway) left += recordsIn(o.bytes);
    if (left + dropped_ == 0) return {};
    return std::to_string(left + dropped_) + " one-way requests to " + who_ + " were never sent: " + (left > 0 ? "it does not read them" : whyDropped_);
}

// Send as many waiting calls as there are slots. CTRL and DBX go first, and some slots are kept free for them.
void Connection::sendWaiting() {
    std::size_t most = std::min<std::size_t>(daemon_.slots, kControl), reserved = most > 4 * kReserved ? kReserved : 0;
    auto taken = [&] { return slots_.size() - free_.size(); };
    for (auto* queue : {&urgent_, &waiting_}) {
        std::size_t limit = queue == &urgent_ ? most : most - reserved;
        while (fd_ >= 0 && !queue->empty()) {
            Waiting& next = queue->front();
            if (next.pending->answered()) {             // cancelled meanwhile
                queue->pop_front();
                countAnswered(1);
                continue;
            }
            if (taken() >= limit) {
                if (exhausted()) lost("no reply came to any of " + std::to_string(taken()) + " calls");
                break;
            }
            Waiting call = std::move(next);
            queue->pop_front();
            std::uint32_t index = acquire(call.name, call.pending->deadline);
            Slot& slot = *slots_[index];
            try {
                auto& asker = call.pending->asker;
                const bool tell = asker || call.pending->relayed || Listening::any();       // for the numbers in events
                wire::Behalf behalf;
                if (tell) behalf = {call.pending->relayed, call.pending->number(), asker ? asker->callers() : std::string()};
                write(index, call.method, call.pending->message, monotonicNow(), tell ? &behalf : nullptr);
            } catch (const Error& e) {
                release(index);
                arrived(call.pending, e.trail);
                continue;
            }
            call.pending->ticket = index;
            slot.pending = std::move(call.pending);
            slot.state = Slot::State::unsent;
            sendSlot(index);
        }
    }
}

void Connection::sent(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (slot.state != Slot::State::unsent) return;      // sent again after a broken connection
    slot.state = slot.orphan ? Slot::State::unwanted : Slot::State::sent;
    ++inFlight_;
}

void Connection::sendSlot(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (!outgoing_.empty() || !unsent_.empty()) return outgoing_.push_back({index, {}});
    ssize_t n = send(fd_, slot.request.data(), slot.request.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n == static_cast<ssize_t>(slot.request.size())) return sent(index);
    if (n < 0 && errno != EAGAIN && errno != EINTR) return lost(std::strerror(errno));
    outgoingAt_ = n > 0 ? static_cast<std::size_t>(n) : 0;
    outgoing_.push_back({index, {}});
}

void Connection::sendBytes(Buffer bytes, bool oneway) {
    if (fd_ < 0) {
        if (oneway) keepOneway(bytes.data(), bytes.size());
        return;
    }
    const bool first = outgoing_.empty() && unsent_.empty();
    outgoing_.push_back({kControl, std::move(bytes), oneway});
    if (first) continueSending();
}

void Connection::continueSending() {
    while (!outgoing_.empty()) {
        std::uint32_t index = outgoing_.front().slot;
        const Buffer& bytes = index == kControl ? outgoing_.front().bytes : slots_[index]->request;
        ssize_t n = send(fd_, bytes.data() + outgoingAt_, bytes.size() - outgoingAt_, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno == EAGAIN) return;
        if (n < 0) return lost(std::strerror(errno));
        outgoingAt_ += static_cast<std::size_t>(n);
        if (outgoingAt_ < bytes.size()) return;
        outgoing_.pop_front();
        outgoingAt_ = 0;
        if (index != kControl) sent(index);
    }
    releaseSelf();
}

// Send outgoing_, blocking, until enough() is true.
template <class Enough> void Connection::sendUntil(Deadline deadline, Enough enough) {
    while (fd_ >= 0 && !enough()) {
        continueSending();
        if (fd_ < 0 || enough() || deadline.passed()) return;
        // As in transmit: the daemon may wait until we take its replies.
        pollfd p{fd_, POLLIN | POLLOUT, 0};
        if (poll(&p, 1, int(std::min<std::int64_t>(deadline.left() / 1'000'000 + 1, 1'000))) > 0 && (p.revents & POLLIN)) receive(deadline);
    }
}

bool Connection::drain(Deadline deadline) {
    sendUntil(deadline, [&] { return outgoing_.empty(); });
    if (fd_ >= 0 && !outgoing_.empty()) lost("the daemon did not read in time what was sent");
    return fd_ >= 0;
}

// The reply of a call that was begun is there, or it has failed: its slot is free for the next one.
void Connection::settle(std::uint32_t index) {
    Slot& slot = *slots_[index];
    arrived(std::move(slot.pending), slot.failed ? std::move(slot.failure) : Trail());
    release(index);
}

void Connection::arrived(PendingPointer pending, Trail failure) {
    pending->ticket = kNoTicket;
    arrived_.push_back({std::move(pending), std::move(failure)});
}

bool Connection::hasArrived(const Pending& pending) const {
    return std::any_of(arrived_.rbegin(), arrived_.rend(), [&](auto& a) { return a.pending.get() == &pending; });
}

void Connection::deliver() {
    auto keep = shared_from_this();
    auto batch = std::exchange(arrived_, {});
    for (auto& a : batch) {
        if (a.failure.empty()) a.pending->answer();
        else a.pending->answer(std::move(a.failure));
    }
    countAnswered(batch.size());
    if (fd_ >= 0 && !(waiting_.empty() && urgent_.empty())) sendWaiting();
    watch();
}

void Connection::deliverOne(Pending& pending) {
    auto found = std::find_if(arrived_.begin(), arrived_.end(), [&](auto& a) { return a.pending.get() == &pending; });
    if (found == arrived_.end()) return;
    Arrived a = std::move(*found);
    arrived_.erase(found);
    if (a.failure.empty()) a.pending->answer();
    else a.pending->answer(std::move(a.failure));
    countAnswered(1);
}

void Connection::deliverLater() {
    if (std::exchange(delivering_, true)) return;
    mailbox_->post([self = shared_from_this()] {
        self->delivering_ = false;
        self->deliver();
    });
}

void Connection::tellChange() {
    if (!changed) return;
    mailbox_->post([weak = weak_from_this()] {
        if (auto self = weak.lock(); self && self->changed) self->changed();
    });
}

void Connection::countAnswered(std::size_t calls) {
    pendings_ -= calls;
    releaseSelf();
}

void Connection::releaseSelf() {
    if (keep_ && pendings_ == 0 && outgoing_.empty() && oneways_.empty()) mailbox_->post([keep = std::move(keep_)] {});
}

// Block until a call that was begun is answered. Others that are answered meanwhile are told by the loop.
void Connection::drive(Pending& pending, Deadline deadline) {
    auto keep = shared_from_this();
    const Pending* outer = std::exchange(driven_, &pending);
    struct Leave {
        Connection& c;
        const Pending* outer;
        ~Leave() {
            c.driven_ = outer;
            if (!c.arrived_.empty()) c.deliverLater();
            c.watch();
        }
    } leave{*this, outer};
    while (!pending.answered()) {
        if (!hasArrived(pending)) {
            try {
                if (fd_ < 0) recover(deadline, nullptr);
                if (fd_ >= 0 && !(waiting_.empty() && urgent_.empty())) sendWaiting();
                if (fd_ >= 0 && !outgoing_.empty()) drain(deadline);
                if (CallContext::currentGivenUp()) {
                    pending.cancel(Trail(makeEntry(errors::kGivenUp, {MessageArg::of(pending.who), MessageArg::of("daemon " + daemon_.name)})));
                    return;
                }
                if (fd_ >= 0 && !hasArrived(pending) && !receive(deadline)) return;
            } catch (const Error& e) {
                if (deadline.passed()) return;          // the caller has a better message
                if (!hasArrived(pending)) {
                    pending.answer(e.trail);            // it stays in its queue, and is removed there when its turn comes
                    if (pending.ticket != kNoTicket) {
                        Slot& slot = *slots_[pending.ticket];
                        slot.pending.reset();
                        slot.orphan = true;
                        countAnswered(1);
                    }
                    return;
                }
            }
        }
        deliverOne(pending);
    }
}

// The caller has cancelled the call: tell the daemon, and do not wait for the reply.
void Connection::cancelled(Pending& pending) {
    if (pending.ticket == kNoTicket) return sweepWaiting();     // it stays in its queue, and is removed there when its turn comes
    std::uint32_t index = std::exchange(pending.ticket, kNoTicket);
    Slot& slot = *slots_[index];
    auto mine = std::move(slot.pending);
    countAnswered(1);
    if (slot.state == Slot::State::unsent && !beingSent(index)) {       // and never will be
        std::erase_if(outgoing_, [&](auto& o) { return o.slot == index; });
        return release(index);
    }
    if (slot.state == Slot::State::unsent) slot.orphan = true;          // the rest of it has to follow, and then this
    else slot.state = Slot::State::unwanted;
    tellCancel(index);
    watch();
}

// Has the socket taken a part of it?
bool Connection::beingSent(std::uint32_t index) const {
    return outgoingAt_ > 0 && !outgoing_.empty() && outgoing_.front().slot == index;
}

// Remove cancelled calls from the queues when they are the majority: so cancelling is cheap, and memory is bounded.
void Connection::sweepWaiting() {
    constexpr std::size_t kFew = 64;
    if (++stale_ < kFew || 2 * stale_ < waiting_.size() + urgent_.size()) return;
    std::size_t gone = 0;
    for (auto* queue : {&urgent_, &waiting_})
        gone += std::erase_if(*queue, [](auto& w) { return w.pending->answered(); });
    stale_ = 0;
    countAnswered(gone);
}

Trail Connection::overdue(Pending& pending) {
    std::string patience = settings_.timeout > 0 ? durationText(double(settings_.timeout) * 1e6) : std::string("its time");
    bool sent = pending.ticket != kNoTicket && slots_[pending.ticket]->state == Slot::State::sent;
    if (pending.ticket != kNoTicket && slots_[pending.ticket]->budget > 0) patience = durationText(double(slots_[pending.ticket]->budget));
    if (pending.ticket != kNoTicket && beingSent(pending.ticket))
        return Trail(makeEntry(errors::kTimeoutPart, {MessageArg::of(pending.who), MessageArg::of(patience), MessageArg::of(address_)}));
    if (sent) return Trail(makeEntry(errors::kTimeoutSent, {MessageArg::of(pending.who), MessageArg::of(patience), MessageArg::of(address_)}));
    return Trail(makeEntry(errors::kTimeoutUnsent, {MessageArg::of(pending.who), MessageArg::of("the daemon"), MessageArg::of(patience),
                                                      MessageArg::of(fd_ < 0 ? how_ : "all its slots are taken")}));
}

// ---- deadlines: a heap of them, swept when most of it is over ----

void Connection::addDeadline(const PendingPointer& pending) {
    if (pending->deadline.none()) return;
    if (due_.size() > 2 * pendings_ + 64) {
        decltype(due_) left;
        for (; !due_.empty(); due_.pop())
            if (auto p = due_.top().pending.lock(); p && !p->answered()) left.push(due_.top());
        due_.swap(left);
    }
    due_.push({pending->deadline.when(), pending});
    if (deadlineTimer_ && deadlineAt_ <= pending->deadline.when()) return;
    deadlineAt_ = pending->deadline.when();
    deadlineTimer_ = reactor_->after(deadlineAt_, [this] { passDeadlines(); });
}

void Connection::passDeadlines() {
    deadlineTimer_.cancel();
    auto keep = weak_from_this().lock();
    std::int64_t now = monotonicNow();
    while (!due_.empty()) {
        auto p = due_.top().pending.lock();
        if (p && !p->answered() && due_.top().when > now) break;
        due_.pop();
        if (p && !p->answered()) p->cancel(overdue(*p));
    }
    if (due_.empty()) return;
    deadlineAt_ = due_.top().when;
    deadlineTimer_ = reactor_->after(deadlineAt_, [this] { passDeadlines(); });
}

// ---- the reactor's turns ----

void Connection::watch() {
    if (fd_ < 0) return;
    if (!watched_ && !wanted() && outgoing_.empty()) return;    // blocking calls need nobody to watch
    std::uint32_t events = EPOLLIN | (outgoing_.empty() ? 0u : std::uint32_t{EPOLLOUT});
    if (!watched_) reactor_->add(fd_, events, this);
    else if (events != interest_) reactor_->change(fd_, events, this);
    watched_ = true;
    interest_ = events;
}

void Connection::ready(std::uint32_t events) {
    auto keep = shared_from_this();
    bool outer = std::exchange(inEvents_, true);
    struct Leave {
        bool& flag;
        bool outer;
        ~Leave() { flag = outer; }
    } leave{inEvents_, outer};
    if (opening_) return advance(events);
    if (fd_ < 0) return;
    if (events & EPOLLOUT) continueSending();
    if (fd_ >= 0 && (events & (EPOLLIN | EPOLLHUP | EPOLLERR))) {
        ssize_t n = read(MSG_DONTWAIT);
        if (n > 0) takeRecords();
        else if (n == 0) lost("the daemon closed it");
        else if (errno != EAGAIN && errno != EINTR) lost(std::strerror(errno));
    }
    if (!arrived_.empty()) deliver();
    watch();
}

// ---- connecting without blocking ----

void Connection::retry() {
    if (fd_ >= 0 || opening_ || retryTimer_) return;
    pause_ = pause_ == 0 ? kFirstPause : std::min(pause_ * 2, kLastPause);
    retryTimer_ = reactor_->after(monotonicNow() + pause_, [this] {
        retryTimer_.cancel();
        if (fd_ < 0 && !opening_ && wanted()) startOpening();
    });
}

// The name in messages: the call that waits longest.
std::string Connection::whom() const {
    if (!urgent_.empty()) return urgent_.front().pending->who;
    return waiting_.empty() ? who_ : waiting_.front().pending->who;
}

void Connection::startOpening() {
    auto keep = shared_from_this();
    try {
        Address address = locate_();
        program_ = address.kind == Address::Kind::program ? wire::kProgramBase + address.number : wire::kProgram;
        address_ = address.kind == Address::Kind::alias ? runtimeSocket(address.host) : describe(address);
        wait_ = address.wait;
        hungUp_ = false;
        int fd = beginConnect(address, whom());
        opening_ = std::make_unique<Opening>();
        opening_->fd = fd;
        opening_->address = address;
        opening_->timer = reactor_->after(monotonicNow() + kOpenTime, [this] {
            closeOpening();
            openFailed(Error(makeEntry(kNotGreeted, {MessageArg::of(who_), MessageArg::of(address_)})));
        });
        reactor_->add(fd, EPOLLOUT, this);
    } catch (const Error& e) {
        openFailed(e);
    }
}

void Connection::closeOpening() {
    if (!opening_) return;
    if (opening_->fd >= 0) {
        reactor_->remove(opening_->fd, this);
        ::close(opening_->fd);
    }
    opening_.reset();
}

void Connection::advance(std::uint32_t) {
    Opening& o = *opening_;
    try {
        if (!o.greeting) {
            endConnect(o.fd, o.address, whom());
            absentSince_ = 0;
            hungUp_ = !sayHello(o.fd);
            if (hungUp_) sorma::fail(errors::kRefused, whom(), address_, std::strerror(errno), "it may be ending, or full");
            o.greeting = true;
            reactor_->change(o.fd, EPOLLIN, this);
            return;
        }
        std::size_t before = o.in.size();
        ssize_t n = recv(o.fd, o.in.extend(4096), 4096, MSG_DONTWAIT);
        o.in.resize(before + (n > 0 ? static_cast<std::size_t>(n) : 0));
        if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
        hungUp_ = n <= 0;
        if (hungUp_)
            sorma::fail(errors::kRefused, whom(), address_,
                        o.in.empty() ? "it closed the connection without a word" : "it closed the connection in the middle of its welcome",
                        "it may be ending, or full");
        if (o.in.size() < wire::kMarkSize) return;
        XdrReader marks(o.in.data(), wire::kMarkSize);
        std::uint32_t mark = marks.u32();
        std::size_t length = mark & ~wire::kLastFragment;
        if (!(mark & wire::kLastFragment) || length > 1 << 20)
            sorma::fail(errors::kProtocol, whom(), address_, "what it said is no record of ONC RPC", "is the address right?");
        if (o.in.size() < wire::kMarkSize + length) return;
        std::string record(o.in.data() + wire::kMarkSize, length);
        // It is ours: from here on it is the connection.
        fd_ = std::exchange(o.fd, -1);
        watched_ = true;
        interest_ = EPOLLIN;
        receiveTimeout_ = 0;
        in_.clear();
        inAt_ = 0;
        in_.append(o.in.data() + wire::kMarkSize + length, o.in.size() - wire::kMarkSize - length);
        unread_.clear();
        lastWords_.clear();
        closeOpening();
        try {
            welcomed(whom(), record);
        } catch (...) {
            disconnect();
            throw;
        }
    } catch (const Error& e) {
        closeOpening();
        return openFailed(e);
    }
    // Send again the calls that were sent to this daemon, and those that were not sent, in order, as the socket takes them.
    for (std::uint32_t i = 0; i < slots_.size() && fd_ >= 0; ++i) {
        if (toResend(i)) sendSlot(i);
    }
    unsent_.clear();
    batch_.clear();
    if (fd_ >= 0) sendWaiting();
    if (!arrived_.empty()) deliver();
    watch();
}

// As recover() has it.
void Connection::openFailed(const Error& e) {
    conclude(e);
    how_ = e.what();
    const bool given = settings_.timeout > 0 && monotonicNow() - onewaysSince_ > settings_.timeout * 1'000'000;
    if (!oneways_.empty() && (given || !mayCome(e))) dropOneways(e.what());
    if (!mayCome(e)) failWaiting(e.trail);
    if (!arrived_.empty()) deliverLater();
    if (wanted()) retry();
}

void Connection::failWaiting(const Trail& trail) {
    for (auto* queue : {&urgent_, &waiting_})
        for (; !queue->empty(); queue->pop_front()) arrived(queue->front().pending, trail);
    for (std::uint32_t i = 0; i < slots_.size(); ++i) {
        Slot& slot = *slots_[i];
        if (slot.state != Slot::State::unsent || !slot.pending) continue;
        slot.state = Slot::State::done;
        --slot.sequence;
        slot.failed = true;
        slot.failure = trail;
        settle(i);
    }
}

// ---- what is no call: health and subscriptions ----

std::uint32_t Connection::control(Control handler) {
    std::uint32_t xid = ++lastControl_ << kSlotBits | kControl;
    controls_.emplace(xid, std::move(handler));
    return xid;
}

wire::Health Connection::health(Deadline deadline) {
    const std::string patience = durationText(double(deadline.left()));
    if (fd_ >= 0) checkIdle(monotonicNow());
    if (fd_ < 0) recover(deadline, nullptr);
    // Shared with the answer, which may come when nobody is here any more.
    struct Answer {
        wire::Health health;
        std::string wrong;
        bool done = false;
    };
    auto answer = std::make_shared<Answer>();
    Buffer bytes;
    wire::writeHealthRequest(bytes, control([answer](XdrReader& r, const std::string& objection) {
        answer->wrong = objection;
        if (objection.empty() && !wire::readHealth(r, answer->health)) answer->wrong = "its answer could not be decoded";
        answer->done = true;
    }), program_);
    sendBytes(std::move(bytes));
    while (!answer->done) {
        if (fd_ < 0) sorma::fail(errors::kRefused, who_, address_, how_, "ask again");
        drain(deadline);
        if (fd_ >= 0 && !answer->done && !receive(deadline))
            sorma::fail(errors::kUnanswered, who_, address_, patience, "say how it is");
    }
    if (!arrived_.empty()) deliverLater();
    if (!answer->wrong.empty()) sorma::fail(errors::kProtocol, who_, address_, answer->wrong, "are both of the same version?");
    return answer->health;
}

void Connection::askHealth(std::function<void(const wire::Health&)> told) {
    if (fd_ < 0) return;
    Buffer bytes;
    auto answered = [mailbox = mailbox_, told = std::move(told)](XdrReader& r, const std::string& objection) {
        wire::Health health;
        if (objection.empty() && wire::readHealth(r, health)) mailbox->post([told, health] { told(health); });
    };
    wire::writeHealthRequest(bytes, control(std::move(answered)), program_);
    sendBytes(std::move(bytes));
    watch();
}

class Connection::Remote : public Listening {
public:
    Remote(std::shared_ptr<Connection> c, wire::Subscription w, std::shared_ptr<Inbox> i, bool r)
        : connection(std::move(c)), wanted(std::move(w)), inbox(std::move(i)), relayed(r) {
        connection->subscriptions_.emplace(wanted.id, this);
    }
    ~Remote() override {
        inbox->close();
        connection->subscriptions_.erase(wanted.id);
        Buffer bytes;
        wire::writeUnsubscribe(bytes, connection->program_, wanted.id);
        connection->sendBytes(std::move(bytes));
        connection->watch();
    }
    // Ask the daemon for it. answered: what it objects to, empty when it agrees.
    void ask(std::function<void(Trail objection, const Message& m)> answered) {
        Buffer bytes;
        Connection& c = *connection;
        auto handler = [&c, answered = std::move(answered)](XdrReader& r, const std::string& objection) {
            Message m;
            wire::Times times;
            std::string wrong = objection;
            if (wrong.empty() && (!wire::readReply(r, times, m) || (m.code >= 0 ? m.ints.size() != 3 : m.trail.empty())))
                wrong = "its answer could not be decoded";
            if (!wrong.empty()) {
                m.code = -1;
                m.trail = Trail(makeEntry(errors::kProtocol, {MessageArg::of(c.who_), MessageArg::of(c.address_), MessageArg::of(wrong),
                                            MessageArg::of("are both of the same version?")}));
            }
            answered(m.code < 0 ? m.trail : Trail(), m);
        };
        wire::Behalf behalf{relayed, CallContext::currentRequest(), CallContext::currentCallers()};
        wire::writeSubscribe(bytes, c.control(std::move(handler)), c.program_, wanted, relayed ? &behalf : nullptr);
        c.sendBytes(std::move(bytes));
    }
    void tell(std::string name, std::int64_t lost, std::string text) {
        Message m;
        m.text = std::move(text);
        inbox->push({wanted.name + "@" + connection->who_, std::move(name), std::move(m), last, lost, wallNow()});
    }

    std::shared_ptr<Connection> connection;
    wire::Subscription wanted;
    std::shared_ptr<Inbox> inbox;
    const bool relayed;
    std::uint64_t last = 0;             // number of the last event that came
    std::uint64_t boot = 0;             // of the daemon that counts them
};

std::unique_ptr<Listening> Connection::listen(std::string name, std::string pattern, std::size_t keep, Listener listener,
                                              Deadline deadline, bool relayed) {
    const std::string patience = durationText(double(deadline.left()));
    if (fd_ >= 0) checkIdle(monotonicNow());
    if (fd_ < 0) recover(deadline, nullptr);
    wire::Subscription wanted{++lastSubscription_, std::move(name), std::move(pattern), static_cast<std::uint32_t>(keep), false};
    auto remote = std::make_unique<Remote>(shared_from_this(), wanted, std::make_shared<Inbox>(mailbox_, keep, std::move(listener)), relayed);
    // Shared with the answer, which may come when nobody is here any more.
    struct Answer {
        Trail objection;
        std::uint64_t last = 0;
        bool done = false;
    };
    auto answer = std::make_shared<Answer>();
    auto ask = [&] {
        remote->boot = daemon_.boot;
        remote->ask([answer](Trail why, const Message& m) {
            answer->done = true;
            answer->objection = std::move(why);
            if (answer->objection.empty()) answer->last = std::uint64_t(m.ints[0]);
        });
    };
    ask();
    while (!answer->done) {
        if (fd_ < 0) {
            recover(deadline, nullptr);                 // which subscribes again by itself, but tells nobody here
            ask();
        }
        drain(deadline);
        if (fd_ >= 0 && !answer->done && !receive(deadline))
            sorma::fail(errors::kUnanswered, remote->wanted.name + "@" + who_, address_, patience, "subscribe");
    }
    if (!arrived_.empty()) deliverLater();
    if (!answer->objection.empty()) throw Error(std::move(answer->objection));
    remote->last = std::max(remote->last, answer->last);     // events may have come with the answer
    watch();
    return remote;
}

std::unique_ptr<Listening> Connection::listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing) {
    wire::Subscription wanted{++lastSubscription_, std::move(name), std::move(pattern), static_cast<std::uint32_t>(keep), existing};
    auto remote = std::make_unique<Remote>(shared_from_this(), wanted, std::make_shared<Inbox>(mailbox_, keep, std::move(listener)), false);
    remote->boot = daemon_.boot;
    if (fd_ >= 0)
        remote->ask([this, id = wanted.id](Trail objection, const Message& m) {
            auto found = subscriptions_.find(id);
            if (found == subscriptions_.end()) return;
            if (objection.empty()) found->second->last = std::max(found->second->last, std::uint64_t(m.ints[0]));
            else found->second->tell("sorma.refused", -1, objection.cause() ? objection.cause()->text : "");
        });
    watch();
    return remote;
}

// On a new connection: the same daemon knows how many events it could not send us; another one knows nothing.
void Connection::resubscribe() {
    for (auto& [id, remote] : subscriptions_) {
        if (remote->boot == 0) continue;
        bool same = remote->boot == daemon_.boot;
        remote->boot = daemon_.boot;
        std::uint32_t number = id;
        remote->ask([this, number, same](Trail objection, const Message& m) {
            auto found = subscriptions_.find(number);
            if (found == subscriptions_.end()) return;
            Remote& r = *found->second;
            if (!objection.empty()) return r.tell("sorma.refused", -1, objection.cause() ? objection.cause()->text : "");
            auto now = std::uint64_t(m.ints[0]);
            bool counted = same && m.ints[2] == 1 && now >= r.last;
            std::int64_t missed = counted ? std::int64_t(now - r.last) : -1;
            r.last = now;
            r.tell("sorma.reconnected", missed, "");
        });
    }
}

void Connection::takeEvent(XdrReader& r) {
    wire::EventHeader header;
    wire::EventBody body;
    Message content;
    if (!wire::readEvent(r, header, body, content)) return;
    auto found = subscriptions_.find(header.id);
    if (found == subscriptions_.end()) return;          // it has just ended
    Remote& remote = *found->second;
    remote.last = header.number;
    if (body.name == "sorma.gone" || body.name == "sorma.refused") remote.boot = 0;     // it has ended: not to be resumed
    remote.inbox->push({remote.wanted.name + "@" + who_, std::move(body.name), std::move(content), header.number,
                        std::int64_t(header.lost), body.time, body.request});
}

}  // namespace sorma
