#include "comm/shares.h"

#include <algorithm>
#include <utility>

namespace sorma {

namespace {

constexpr std::int64_t kCrowd = 2'000'000;              // [ns] two flows had requests not longer ago than this
constexpr std::uint64_t kCrowdedTurns = 8;              // or than so many turns: where requests take long, one turn takes longer
constexpr std::int64_t kMostDebt = 100'000'000;         // [ns] more is owed by nobody, however long a request took

}  // namespace

void Level::enter(Flow& flow, std::uint64_t turn, std::int64_t now) {
    if (turn != turn_) next(turn, now);
    ++entered_;
    if (flow.turn_ != turn) {
        flow.turn_ = turn;
        flow.inTurn_ = 0;
        flow.waits_ = false;
        ++flows_;
    }
    flow.due_ = std::max(flow.due_, clock_);
}

void Level::took(Flow& flow, std::int64_t nanoseconds) {
    flow.due_ = std::min(flow.due_ + nanoseconds, clock_ + kMostDebt);
    flow.inTurn_ += nanoseconds;
    lastDue_ = std::max(lastDue_, flow.due_);
}

void Level::leave(Flow& flow, bool wantsMore) {
    if (!wantsMore) {
        if (!flow.waits_) modest_ = std::max(modest_, flow.inTurn_);
        return;
    }
    firstDue_ = waiting_ == 0 ? flow.due_ : std::min(firstDue_, flow.due_);
    if (!std::exchange(flow.waits_, true)) ++waiting_;
}

// Another turn begins.
void Level::next(std::uint64_t turn, std::int64_t now) {
    if (flows_ > 1) {
        crowded_ = now;
        crowdedTurn_ = turn;
    }
    const bool crowded = now - crowded_ < kCrowd || turn - crowdedTurn_ <= kCrowdedTurns;
    if (!crowded) quantum_ = kMost;
    else if (modest_ > 0) quantum_ = std::clamp(modest_, std::min(kLeast + kTurn * entered_, kMost), kMost);
    else if (waiting_ > 1) quantum_ = std::min(2 * quantum_, kMost);
    clock_ = std::max(clock_, waiting_ > 0 ? firstDue_ : lastDue_);
    turn_ = turn;
    lastDue_ = clock_;
    modest_ = 0;
    flows_ = waiting_ = entered_ = 0;
}

Shares::Share Shares::of(const AccountPointer& account) {
    Share share;
    if (account->owner()) return share;
    std::erase_if(groups_, [&](auto& entry) { return entry.second.use_count() == 1 && !principals_.owes(entry.second->flow); });
    auto& group = groups_[account];
    if (!group) group = std::make_shared<Group>();
    share.group_ = group;
    return share;
}

}  // namespace sorma
