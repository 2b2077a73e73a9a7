// pace.h -- lab time follows wall time by a factor, or runs as fast as it can. Time that cannot be caught up is skipped and
// counted.
//
// Threads: one.
#pragma once

#include <cstdint>

namespace simlab {

class Pace {
public:
    void setFactor(double factor) { factor_ = factor, restart(); }      // lab seconds in a second; 0: as fast as it goes
    double factor() const { return factor_; }
    // A pause is over: the time of the pause does not count as late.
    void restart() { begun_ = false; }
    // A step of lab time was made. Returns when the next one is due [ns, monotonic clock]; a time in the past: at once.
    std::int64_t stepped(double step, std::int64_t wall);

    double speed() const { return speed_; }         // lab seconds in a second, measured
    double skipped() const { return skipped_; }     // [s] of lab time skipped, because the machine was too slow

private:
    double factor_ = 1, skipped_ = 0, speed_ = 0;
    bool begun_ = false;
    std::int64_t due_ = 0;
    double fraction_ = 0;                           // [ns] of due_
    std::int64_t since_ = 0;                        // of the measurement
    double passed_ = 0;                             // [s] of lab time since then
};

}  // namespace simlab
