#include "comm/calls.h"

#include <algorithm>

#include "bus/atEnd.h"
#include "bus/requestText.h"
#include "bus/statistics.h"
#include "bus/stream.h"
#include "comm/errors.h"

namespace sorma {

namespace {

constexpr std::size_t kBatchSize = 32 * 1024;           // of submitted requests, before they are sent unasked
constexpr std::size_t kReserved = 8;                    // slots kept free for CTRL and DBX while EXECs wait
constexpr std::int64_t kMoment = 10;                    // [ms] a daemon that runs answers within that

using errors::trailOf;

void trace(Slot& slot, const SpanPointer& span) {
    slot.span = span;
    span->sent = true;
}

}  // namespace

Calls::Calls(Link& link, Link::User& user, const Settings& settings, std::shared_ptr<Reactor> reactor, std::shared_ptr<Mailbox> mailbox,
             std::function<void()> update, std::function<void(bool fresh)> resumed)
    : link_(link), user_(user), settings_(settings), reactor_(std::move(reactor)), mailbox_(std::move(mailbox)), update_(std::move(update)),
      resumed_(std::move(resumed)), slots_(link, settings) {}

// ---- slots ----

std::uint32_t Calls::acquire(std::string_view name, Deadline deadline) {
    if (slots_.none()) [[unlikely]] {
        renew(deadline);
        if (slots_.none())
            sorma::fail(errors::kLimit, link_.who(), std::to_string(slots_.size()) + " calls are in flight already, the daemon takes at most " +
                                                         std::to_string(slots_.most()) + "; raise it there: sorma::configure -inflight N");
    }
    return slots_.take(name, deadline);
}

// A new connection finds out which of the unwanted ones can be used again, see Slots::toResend.
void Calls::renew(Deadline deadline) {
    if (!slots_.exhausted()) return;
    if (link_.live()) link_.lose("no reply came to any of " + std::to_string(slots_.inFlight()) + " calls");
    connect(deadline);
    while (link_.live() && slots_.none() && !CallContext::currentGivenUp() && link_.step(deadline)) {}
}

void Calls::freeSlot(std::uint32_t index) {
    if (slots_[index].state == Slot::State::unsent && std::erase(unsent_, index) > 0) {
        // Its bytes are in the batch, between others: build the batch again without them.
        batch_.clear();
        for (auto other : unsent_) batch_.append(slots_[other].request.data(), slots_[other].request.size());
    }
    slots_.give(index);
}

// Tell the daemon that the caller has cancelled the call: the service may stop early.
void Calls::tellCancel(std::uint32_t index) {
    Buffer bytes;
    wire::writeCancel(bytes, link_.program(), {index, slots_[index].sequence});
    link_.send(std::move(bytes));
    if (link_.queued()) link_.watch();
}

// ---- calls that block ----

void Calls::call(std::string_view name, Method method, Message& m, Deadline deadline, const PrincipalPointer& relayFor, std::int64_t now) {
    // For a call that is answered at once the clock is read only once, by the code that made the deadline. Each reading costs a
    // hundredth of an empty call.
    if (now == 0) now = monotonicNow();
    lookIfIdle(now);
    if (!ready()) {
        Slot caller;
        caller.name = name;
        caller.deadline = deadline;
        caller.budget = deadline.left();
        connect(deadline, &caller);
        now = monotonicNow();
    }
    const std::uint32_t index = acquire(name, deadline);
    Slot& slot = slots_[index];
    const AtEnd leave([this, index] { freeSlot(index); });
    if (!link_.live()) [[unlikely]] connect(deadline, &slot);
    if (!batch_.empty()) flush(deadline);
    if (link_.queued()) [[unlikely]] link_.drainAll(deadline);
    slot.into = &m;
    if (CallContext::current() || relayFor || link_.epoch() != 0) [[unlikely]] {
        wire::Behalf behalf = wire::behalfOf(relayFor, link_.epoch());
        if (behalf.trace.number) trace(slot, CallContext::current()->span);
        slots_.write(index, method, m, now, &behalf, true);
    } else {
        slots_.write(index, method, m, now, nullptr, true);
    }
    // A call counts as sent when the kernel has taken its last byte: the daemon cannot execute a part of it.
    std::size_t taken = 0;
    if (link_.live() && link_.write(slot.request, slot.lent, deadline, taken)) slots_.sent(index);
    else slot.cut = taken > 0;
    const AtEnd forget([this, outer = std::exchange(link_.callTime, now)] { link_.callTime = outer; });
    await(index, deadline.none() ? deadline.left() : slot.budget);
    tellLater();
    if (slot.failed) throw Error(std::move(slot.failure));
    if (m.code < 0) {
        if (m.trail.empty()) sorma::fail(errors::kCode, fullName(slot), m.code);
        throw Error(m.trail);
    }
}

Calls::Ticket Calls::submit(std::string_view name, Method method, const Message& m, Deadline deadline, std::int64_t now) {
    if (!ready()) connect(deadline), now = 0;
    const std::uint32_t index = acquire(name, deadline);
    try {
        if (!link_.live()) connect(deadline, &slots_[index]), now = 0;
        slots_.write(index, method, m, now != 0 ? now : monotonicNow(), nullptr);
        unsent_.push_back(index);
        batch_.append(slots_[index].request.data(), slots_[index].request.size());
        if (batch_.size() >= kBatchSize) flush(deadline);
    } catch (...) {
        freeSlot(index);
        throw;
    }
    return index;
}

void Calls::flush(Deadline deadline) {
    if (unsent_.empty()) return;
    if (link_.queued()) link_.drainAll(deadline);
    if (batch_.empty())
        for (auto index : unsent_) batch_.append(slots_[index].request.data(), slots_[index].request.size());
    for (auto index : unsent_) slots_.sent(index);
    unsent_.clear();
    Buffer bytes;
    std::swap(bytes, batch_);                           // losing the connection meanwhile starts a new batch
    if (link_.live()) link_.write(bytes.data(), bytes.size(), deadline);
    if (batch_.empty()) {
        bytes.clear();
        std::swap(bytes, batch_);
    }
}

void Calls::collect(Ticket ticket, Message& m) {
    if (ticket >= slots_.size() || slots_[ticket].state == Slot::State::free)
        sorma::fail(errors::kLimit, link_.who(), "this call has been collected already");
    Slot& slot = slots_[ticket];
    const AtEnd leave([this, ticket] { freeSlot(ticket); });
    if (!unsent_.empty()) flush(slot.deadline);
    await(ticket, -1);
    if (slot.failed) throw Error(std::move(slot.failure));
    m.swap(slot.result);
    if (m.code < 0) throw Error(m.trail);
}

// left: time to the deadline [ns], when it is known; < 0: it is not
void Calls::await(std::uint32_t index, std::int64_t left) {
    Slot& slot = slots_[index];
    while (slot.awaited()) {
        if (!link_.live()) {
            connect(slot.deadline, &slot);
            left = -1;
            continue;
        }
        if (left < 0) left = slot.deadline.left();
        if (CallContext::currentGivenUp()) [[unlikely]] {
            tellCancel(index);
            sorma::fail(errors::kGivenUp, fullName(slot), "daemon " + link_.daemon().name);
        }
        if (link_.step(slot.deadline, std::exchange(left, -1))) continue;
        if (slot.state == Slot::State::sent) tellCancel(index);
        failTimeout(&slot, fullName(slot), {});
    }
}

void Calls::failTimeout(const Slot* waiting, const std::string& whom, const std::string& problem) {
    std::int64_t budget = !waiting ? 0 : waiting->budget > 0 ? waiting->budget : settings_.timeout * 1'000'000;
    std::string patience = budget > 0 ? durationText(double(budget)) : std::string("time");
    if (waiting && waiting->state == Slot::State::sent) sorma::fail(errors::kTimeoutSent, whom, patience, link_.address());
    if (waiting && waiting->cut) sorma::fail(errors::kTimeoutCut, whom, "the daemon", patience, problem);
    sorma::fail(errors::kTimeoutUnsent, whom, "the daemon", patience, problem);
}

void Calls::failHopeless(const Error& why, const Slot* waiting, const std::string& whom) {
    if (!waiting || waiting->state != Slot::State::sent) throw Error(why);
    sorma::fail(errors::kLost, whom, link_.address(), link_.daemon().name, link_.age(), link_.how(), "there is no way back to it: " + std::string(why.what()),
                "ask there what became of it");
}

void Calls::checkGivenUp(const Slot* waiting, const std::string& whom) {
    if (!CallContext::currentGivenUp()) return;
    if (waiting && waiting->state == Slot::State::sent)
        sorma::fail(errors::kGivenUp, whom, link_.live() ? "daemon " + link_.daemon().name : std::string("nobody"));
    sorma::fail(errors::kGivenUpUnsent, whom);
}

void Calls::connect(Deadline deadline, const Slot* waiting, bool restored) {
    const std::string whom = waiting ? fullName(*waiting) : link_.who();
    const AtEnd unblock([this, outer = std::exchange(blocked_, &whom)] { blocked_ = outer; });
    while (!over(waiting)) {
        if (restored) proceed();
        if ((link_.live() && !(restored && held_)) || over(waiting)) break;
        checkGivenUp(waiting, whom);
        const bool restoring = link_.live();
        const bool went = link_.step(restoring ? deadline.earlier(restoringUntil_) : deadline);
        if (over(waiting)) break;
        if (!link_.live() && link_.hopeless()) failHopeless(*link_.hopeless(), waiting, whom);
        if (went) continue;
        if (restoring && !deadline.passed()) {
            restoringOverdue();
            continue;
        }
        if (restoring) failTimeout(waiting, whom, "the state of its objects is being restored");
        const Error why = link_.unconnected(whom);
        if (link_.daemon().boot == 0 && link_.state() != Link::State::lost && !(waiting && waiting->state == Slot::State::sent)) throw why;
        failTimeout(waiting, whom, why.what());
    }
    if (link_.queued()) link_.drainAll(deadline);
    link_.watch();
}

void Calls::connectSoon() {
    if (link_.state() != Link::State::lost) return;
    link_.begin();
    if (background) return;
    const Deadline soon = Deadline::in(settings_.timeout > 0 ? std::min(settings_.timeout, kMoment) : kMoment);
    while (link_.state() != Link::State::lost && !link_.live())
        if (!link_.step(soon)) return;
}

// Not inside the reactor's turn, which has just taken it.
void Calls::lookNow() {
    if (!link_.live() || link_.inEvents()) return;
    auto keep = user_.keep();
    link_.look();
    tellLater();
    link_.watch();
}

// ---- calls that are begun ----

void Calls::begin(const PendingPointer& pending, const std::string& name, Method method) {
    pending->carrier = this;
    pending->ticket = kNoTicket;
    pending->who = link_.fullName(name);
    ++pendings_;
    update_();
    pending->expireBy(*reactor_);
    if (pending->asker) pending->sent = monotonicNow();
    if (link_.live()) lookIfIdle(monotonicNow());
    (method == Method::exec ? waiting_ : urgent_).push_back({pending, name, method});
    if (link_.live()) sendWaiting();
    else connectSoon();
    link_.watch();
    tellLater();
}

// The SORM ends: no caller is told anything.
void Calls::end() {
    restoring_.clear();
    waiting_.clear();
    urgent_.clear();
    arrived_.clear();
    for (std::uint32_t i = 0; i < slots_.size(); ++i) slots_[i].pending.reset();
}

// Send as many waiting calls as there are slots.
void Calls::sendWaiting() {
    if (held_) return proceed();
    const std::int64_t now = monotonicNow();
    std::size_t most = slots_.most(), reserved = most > 4 * kReserved ? kReserved : 0;
    for (auto* queue : {&urgent_, &waiting_}) {
        std::size_t limit = queue == &urgent_ ? most : most - reserved;
        while (link_.live() && !queue->empty()) {
            Waiting& next = queue->front();
            if (next.pending->answered()) {             // cancelled meanwhile
                queue->pop_front();
                countAnswered(1);
                continue;
            }
            if (slots_.taken() >= limit) {
                if (slots_.exhausted()) link_.lose("no reply came to any of " + std::to_string(slots_.taken()) + " calls");
                break;
            }
            Waiting call = std::move(next);
            queue->pop_front();
            std::uint32_t index = slots_.take(call.name, call.pending->deadline);
            try {
                auto& asker = call.pending->asker;
                const bool tell = asker || call.pending->relayFor || link_.epoch() != 0 || Listening::any();       // for the numbers in events
                wire::Behalf behalf;
                if (tell) behalf = wire::behalfOf(call.pending->relayFor, call.pending->number(), asker ? asker->callers() : std::string(), link_.epoch());
                if (auto& span = call.pending->span) {
                    trace(slots_[index], span);
                    behalf.trace.number = span->share->number;
                    span->waited = now - span->begun;
                }
                slots_.write(index, call.method, call.pending->message, now, tell ? &behalf : nullptr);
            } catch (const Error& e) {
                slots_.give(index);
                arrive(call.pending, e.trail);
                continue;
            }
            call.pending->ticket = index;
            slots_[index].pending = std::move(call.pending);
            link_.send(index, slots_[index].request);
        }
    }
}

// The reply of a call that was begun is there, or it has failed: its slot is free for the next one.
void Calls::takeAnswer(std::uint32_t index) {
    Slot& slot = slots_[index];
    arrive(std::move(slot.pending), slot.failed ? std::move(slot.failure) : Trail());
    freeSlot(index);
}

void Calls::arrive(PendingPointer pending, Trail failure) {
    pending->ticket = kNoTicket;
    arrived_.push_back({std::move(pending), std::move(failure)});
}

bool Calls::hasArrived(const Pending& pending) const {
    return std::any_of(arrived_.rbegin(), arrived_.rend(), [&](auto& a) { return a.pending.get() == &pending; });
}

void Calls::deliver() {
    auto keep = user_.keep();
    auto batch = std::exchange(arrived_, {});
    for (auto& a : batch) a.tell();
    countAnswered(batch.size());
    if (link_.live() && !(waiting_.empty() && urgent_.empty())) sendWaiting();
    link_.watch();
}

void Calls::deliverOne(Pending& pending) {
    auto found = std::find_if(arrived_.begin(), arrived_.end(), [&](auto& a) { return a.pending.get() == &pending; });
    if (found == arrived_.end()) return;
    Arrived a = std::move(*found);
    arrived_.erase(found);
    a.tell();
    countAnswered(1);
}

void Calls::tellLater() {
    if (arrived_.empty() || std::exchange(delivering_, true)) return;
    mailbox_->post([this, keep = user_.keep()] {
        delivering_ = false;
        deliver();
    });
}

void Calls::countAnswered(std::size_t calls) {
    pendings_ -= calls;
    update_();
}

// Block until a call that was begun is answered. Others that are answered meanwhile are told by the loop.
void Calls::drive(Pending& pending, Deadline deadline) {
    auto keep = user_.keep();
    const AtEnd leave([this, outer = std::exchange(driven_, &pending)] {
        driven_ = outer;
        tellLater();
        link_.watch();
    });
    while (!pending.answered()) {
        if (!hasArrived(pending)) {
            try {
                if (!link_.live()) connect(deadline, pending.ticket == kNoTicket ? nullptr : &slots_[pending.ticket]);
                if (link_.live() && !(waiting_.empty() && urgent_.empty())) sendWaiting();
                if (link_.queued()) link_.drainAll(deadline);
                if (CallContext::currentGivenUp()) {
                    pending.cancel(trailOf(errors::kGivenUp, pending.who, "daemon " + link_.daemon().name));
                    return;
                }
                if (link_.live() && !hasArrived(pending) && !link_.step(deadline)) return;
            } catch (const Error& e) {
                if (deadline.passed()) return;          // the caller has a better message
                if (!hasArrived(pending)) {
                    abandon(pending);
                    pending.answer(e.trail);
                    return;
                }
            }
        }
        deliverOne(pending);
    }
}

// Nobody waits for the call any more. Returns its slot, when the daemon may have the request or a part of it.
std::optional<std::uint32_t> Calls::abandon(Pending& pending) {
    if (pending.ticket == kNoTicket) {          // it stays in its queue, and is removed there when its turn comes
        sweepWaiting();
        return {};
    }
    std::uint32_t index = std::exchange(pending.ticket, kNoTicket);
    Slot& slot = slots_[index];
    auto mine = std::move(slot.pending);
    countAnswered(1);
    if (slot.state == Slot::State::unsent && link_.forget(index)) {     // and never will be
        freeSlot(index);
        return {};
    }
    if (slot.state == Slot::State::unsent) slot.orphan = true;          // the rest of it has to follow, and then it is unwanted
    else slot.state = Slot::State::unwanted;
    return index;
}

// The caller has cancelled the call: tell the daemon, and do not wait for the reply.
void Calls::cancelled(Pending& pending) {
    if (auto index = abandon(pending)) {
        tellCancel(*index);
        link_.watch();
    }
}

// Remove cancelled calls from the queues when they are the majority: so cancelling is cheap, and memory is bounded.
void Calls::sweepWaiting() {
    constexpr std::size_t kFew = 64;
    if (++stale_ < kFew || 2 * stale_ < waiting_.size() + urgent_.size()) return;
    std::size_t gone = 0;
    for (auto* queue : {&urgent_, &waiting_})
        gone += std::erase_if(*queue, [](auto& w) { return w.pending->answered(); });
    stale_ = 0;
    countAnswered(gone);
}

Trail Calls::overdue(Pending& pending) {
    const Slot* slot = pending.ticket == kNoTicket ? nullptr : &slots_[pending.ticket];
    std::string patience = settings_.timeout > 0 ? durationText(double(settings_.timeout) * 1e6) : std::string("its time");
    if (slot && slot->budget > 0) patience = durationText(double(slot->budget));
    const bool part = slot && link_.begun(pending.ticket);
    if (part || (slot && slot->state == Slot::State::sent))
        return trailOf(part ? errors::kTimeoutPart : errors::kTimeoutSent, pending.who, patience, link_.address());
    return trailOf(errors::kTimeoutUnsent, pending.who, "the daemon", patience,
                   link_.live() ? std::string("all its slots are taken") : link_.unconnected(pending.who).what());
}

// ---- what the link tells ----

// The name in messages: of whoever blocks, or the call that waits longest.
std::string Calls::whom() const {
    if (blocked_) return *blocked_;
    if (!urgent_.empty()) return urgent_.front().pending->who;
    return waiting_.empty() ? link_.who() : waiting_.front().pending->who;
}

void Calls::ended() {
    if (restoringSlot_ != kNoTicket) freeSlot(std::exchange(restoringSlot_, kNoTicket));     // to be sent once more
    restoringTimer_.cancel();
    restoringUntil_ = {};
}

void Calls::replied(XdrReader& r, std::uint32_t xid) {
    if (!r.good() || (xid & Slots::kControl) >= slots_.size()) return link_.reject("a record that is no reply to any call");
    const std::uint32_t index = slots_.answered(xid);
    if (index == kNoTicket) return;
    Slot& slot = slots_[index];
    std::string objection = wire::readReplyHeader(r);
    if (objection.empty() && !wire::readReply(r, times_, slot.reply(), slot.span.get())) objection = "its reply could not be decoded";
    if (!objection.empty())
        slots_.fail(index, trailOf(errors::kProtocol, fullName(slot), link_.address(), objection, "are both of the same version?"));
    if (slot.pending) return takeAnswer(index);
    if (index != restoringSlot_) [[likely]] return;
    const Message reply = std::move(slot.result);
    const Trail failure = slot.failed ? std::move(slot.failure) : reply.code < 0 ? reply.trail : Trail();
    finishRestoring(reply, failure);
}

void Calls::unanswered(const Link::Verdict& verdict) {
    for (std::uint32_t i = 0; i < slots_.size(); ++i) {
        Slot& slot = slots_[i];
        if (slot.state == Slot::State::unwanted && verdict.ended) {
            slots_.clear(i);
        } else if (slot.state == Slot::State::sent) {
            slots_.drop(i, verdict.ended, trailOf(errors::kLost, fullName(slot), link_.address(), link_.daemon().name, link_.age(), link_.how(),
                                                  verdict.why, verdict.hint));
            if (slot.pending) takeAnswer(i);
        }
    }
    failWaiting([&](const Pending& p) { return p.bound ? trailOf(errors::kBound, p.who, link_.address(), verdict.why) : Trail(); });
}

// why: an empty one for those that go on waiting.
void Calls::failWaiting(const std::function<Trail(const Pending&)>& why) {
    for (auto* queue : {&urgent_, &waiting_})
        std::erase_if(*queue, [&](auto& w) {
            Trail trail = why(*w.pending);
            const bool fails = !trail.empty();
            if (fails) arrive(w.pending, std::move(trail));
            return fails;
        });
    for (std::uint32_t i = 0; i < slots_.size(); ++i) {
        if (slots_[i].state != Slot::State::unsent || !slots_[i].pending) continue;
        Trail trail = why(*slots_[i].pending);
        if (trail.empty()) continue;
        --slots_[i].sequence;
        slots_.fail(i, std::move(trail));
        takeAnswer(i);
    }
}

// ---- state that a daemon gets before anything else ----

void Calls::restore(const void* owner, std::string name, Method method, std::vector<std::string> words, PrincipalPointer relayFor, Restored done) {
    restoring_.push_back({owner, std::move(name), method, {}, std::move(relayFor), std::move(done)});
    restoring_.back().request.words = std::move(words);
    held_ = true;
}

void Calls::cancelRestore(const void* owner) {
    if (restoringSlot_ != kNoTicket && restoring_.front().owner == owner) restoring_.front().done = nullptr;
    std::erase_if(restoring_, [&](auto& r) { return r.owner == owner && (restoringSlot_ == kNoTicket || &r != &restoring_.front()); });
}

// Send the first of restoring_. False: it has to wait for a slot.
bool Calls::sendRestoring() {
    Restoring& next = restoring_.front();
    try {
        if (slots_.none() && slots_.inFlight() > 0) {
            // Their answers free them.
            if (fresh_) resend();
            return false;
        }
        restoringUntil_ = settings_.timeout > 0 ? Deadline::in(settings_.timeout) : Deadline();
        restoringSlot_ = acquire(next.name, restoringUntil_);
        const std::uint32_t index = restoringSlot_;
        const wire::Behalf behalf = wire::behalfOf(next.relayFor, 0, {}, link_.epoch());
        slots_.write(index, next.method, next.request, monotonicNow(), next.relayFor || behalf.epoch != 0 ? &behalf : nullptr);
        if (!restoringUntil_.none()) restoringTimer_ = reactor_->after(restoringUntil_.when(), [this] { restoringOverdue(); });
        link_.send(index, slots_[index].request);
    } catch (const Error& e) {
        finishRestoring({}, e.trail);
    }
    return true;
}

void Calls::finishRestoring(const Message& reply, const Trail& failure) {
    restoringTimer_.cancel();
    restoringUntil_ = {};
    if (restoringSlot_ != kNoTicket) freeSlot(std::exchange(restoringSlot_, kNoTicket));
    Restored done = std::move(restoring_.front().done);
    restoring_.pop_front();
    if (done) done(reply, failure);
}

void Calls::restoringOverdue() {
    if (restoringSlot_ == kNoTicket) return;
    const Slot& slot = slots_[restoringSlot_];
    const Trail why = trailOf(errors::kTimeoutSent, fullName(slot), durationText(double(settings_.timeout) * 1e6), link_.address());
    if (slot.state == Slot::State::sent) tellCancel(restoringSlot_);
    if (restoringSlot_ != kNoTicket) finishRestoring({}, why);
    proceed();
    link_.watch();
}

void Calls::proceed() {
    while (link_.live() && !restoring_.empty())
        if (restoringSlot_ != kNoTicket || !sendRestoring()) return;
    if (!link_.live() || !held_) return;
    held_ = false;
    const bool fresh = std::exchange(fresh_, false);
    resumed_(fresh);
    if (fresh) resend();
    if (link_.live()) sendWaiting();
}

// On a new connection: send again what the daemon may not have got. A daemon that still lives knows what it has. That a call
// was cancelled may have been lost with the old line.
void Calls::resend() {
    unsent_.clear();
    batch_.clear();
    for (std::uint32_t i = 0; i < slots_.size() && link_.live(); ++i) {
        if (!slots_.toResend(i)) continue;
        link_.send(i, slots_[i].request);
        if (slots_[i].state == Slot::State::unwanted && link_.live()) tellCancel(i);
    }
}

}  // namespace sorma
