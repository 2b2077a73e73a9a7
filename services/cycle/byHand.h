// byHand.h -- when a tick is due that somebody makes by hand, while the cycle is stopped: one period after the tick before it.
//
// So time goes on by one period with each tick, however long somebody looks at the values between two of them. With the clock of a simulation,
// ticks stay at whole periods from the first one; those that the clock has passed meanwhile are missed.
//
// Times are in ns, by the clock of the cycle. `now` is what the clock of a simulation says.
#pragma once

#include <algorithm>
#include <cstdint>

namespace cycle {

class ByHand {
public:
    using Time = std::int64_t;

    // The time of a tick that is made now. Without one before it: now.
    Time due(Time now, Time period) const { return fresh(now) ? now : last_ + std::max<Time>(1, (now + kTolerance - last_) / period) * period; }
    // Where the clock must be for the tick after this moment: later than now.
    Time after(Time now, Time period) const {
        return fresh(now) ? now + period : last_ + std::max<Time>(1, (now + kTolerance - last_) / period + 1) * period;
    }
    void ticked(Time time, Time now) { last_ = time, seen_ = now, any_ = true; }
    void forget() { any_ = false; }
    bool any() const { return any_; }                   // was there a tick?
    Time last() const { return last_; }

private:
    // No tick before, or the clock has begun anew.
    bool fresh(Time now) const { return !any_ || now < seen_ - kTolerance; }

    static constexpr Time kTolerance = 1'000;           // of a clock whose times are sums of floats
    bool any_ = false;
    Time last_ = 0, seen_ = 0;                          // the last tick; what the clock said then
};

}  // namespace cycle
