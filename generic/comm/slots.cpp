#include "comm/slots.h"

#include <algorithm>

#include "comm/apart.h"
#include "comm/clock.h"
#include "comm/errors.h"

namespace sorma {

namespace {

constexpr std::int64_t kClockTold = 1'000'000'000;      // [ns] a daemon with another clock hears that often what ours says

}  // namespace

std::size_t Slots::most() const { return std::clamp<std::size_t>(link_.daemon().slots, 1, kControl); }

bool Slots::awaited() const {
    return inFlight_ > 0 && std::any_of(slots_.begin(), slots_.end(), [](auto& slot) { return slot->state == Slot::State::sent; });
}

bool Slots::exhausted() const {
    constexpr std::int64_t kPatience = 5'000'000'000;       // [ns] with a new connection that has not answered any
    if (link_.live() && !heard_ && monotonicNow() - link_.since() < kPatience) return false;
    return std::all_of(slots_.begin(), slots_.end(), [](auto& s) { return s->state == Slot::State::unwanted || s->state == Slot::State::free; });
}

std::uint32_t Slots::take(std::string_view name, Deadline deadline) {
    if (free_.empty()) {
        free_.push_back(size());
        slots_.push_back(std::make_unique<Slot>());
    }
    const std::uint32_t index = free_.back();
    free_.pop_back();
    Slot& slot = *slots_[index];
    slot.name = name;
    slot.deadline = deadline;
    slot.budget = link_.live() ? 0 : deadline.left();       // otherwise write() takes the time anyway
    slot.failed = slot.orphan = slot.cut = slot.unsure = false;
    slot.into = nullptr;
    slot.state = Slot::State::done;                     // in use, nothing sent yet
    return index;
}

// The caller has given it up, but the daemon may still answer.
void Slots::abandon(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (slot.state == Slot::State::sent) {              // its reply may still come: the slot is not free before
        slot.state = Slot::State::unwanted;
    } else if (std::exchange(slot.unsure, false)) {
        slot.state = Slot::State::unwanted;             // should the daemon come back, see probe()
        ++inFlight_;
    } else {
        if (slot.state == Slot::State::unsent) --slot.sequence;
        free(index);
    }
}

void Slots::write(std::uint32_t index, Method method, const Message& m, std::int64_t now, const wire::Behalf* behalf, bool lend) {
    Slot& slot = *slots_[index];
    const wire::Welcome& daemon = link_.daemon();
    wire::Request request{index, ++slot.sequence, 0, method, slot.name};
    ++calls_;
    slot.request.clear();
    slot.lent = {};
    if (!slot.deadline.none()) {
        slot.budget = std::max<std::int64_t>(slot.deadline.when() - now, 0);
        if (daemon.clock.empty()) {
            request.deadline = static_cast<std::uint32_t>(std::min<std::int64_t>(slot.budget / 1'000'000 + 1, UINT32_MAX));
        } else {
            request.deadline = deadlineMark(slot.deadline, now);
            if (link_.otherClock() && now - clockSaid_ > kClockTold) wire::writeClock(slot.request, link_.program(), clockSaid_ = now);
        }
    }
    const std::size_t before = slot.request.size();
    wire::writeCall(slot.request, xidOf(index, slot.sequence), link_.program(), request, m, wire::kCall, behalf, lend ? &slot.lent : nullptr);
    std::size_t size = slot.request.size() + slot.lent.size() - before - record::kMarkSize;
    std::size_t most = std::min<std::size_t>(daemon.maxMessage, static_cast<std::size_t>(settings_.maxMessage));
    if (size > most) {
        --slot.sequence;
        slot.request.release();
        sorma::fail(errors::kTooBig, link_.fullName(slot.name), "request", size, most < daemon.maxMessage ? "this process" : "daemon " + daemon.name, most);
    }
    slot.state = Slot::State::unsent;
}

std::uint32_t Slots::answered(std::uint32_t xid) {
    const std::uint32_t index = xid & kControl;
    Slot& slot = *slots_[index];
    if ((slot.state != Slot::State::sent && slot.state != Slot::State::unwanted) || xid != xidOf(index, slot.sequence)) return kNoTicket;
    --inFlight_;
    heard_ = true;
    if (slot.state == Slot::State::sent) {
        slot.state = Slot::State::done;
        return index;
    }
    free(index);
    return kNoTicket;
}

void Slots::fail(std::uint32_t index, Trail why) {
    Slot& slot = *slots_[index];
    slot.state = Slot::State::done;
    slot.failed = true;
    slot.failure = std::move(why);
}

void Slots::drop(std::uint32_t index, bool ended, Trail why) {
    --inFlight_;
    slots_[index]->unsure = !ended;
    fail(index, std::move(why));
}

// Replace a request that was cancelled by another one of the same number. Either the daemon answers with its reply to the
// first one; or it does not know that one, executes this one, and will never execute the first. Then the slot is free again.
void Slots::probe(std::uint32_t index) {
    Slot& slot = *slots_[index];
    Message m;
    m.words = {"-info", "name"};
    slot.request.release();
    slot.lent = {};
    wire::writeCall(slot.request, xidOf(index, slot.sequence), link_.program(), {index, slot.sequence, 0, Method::dbx, "sorm"}, m);
}

bool Slots::toResend(std::uint32_t index) {
    Slot& slot = *slots_[index];
    if (slot.state == Slot::State::unwanted) return probe(index), true;
    if (slot.state == Slot::State::unsent && slot.orphan) return give(index), false;
    if (!slot.awaited()) return false;
    if (slot.lent.data) {                               // the line takes bytes
        Buffer all;
        record::Source(slot.request, slot.lent).appendTo(all);
        slot.request = std::move(all);
        slot.lent = {};
    }
    return true;
}

}  // namespace sorma
