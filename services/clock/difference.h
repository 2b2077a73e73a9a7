// difference.h -- estimates the difference of two clocks from exchanges of messages.
//
// We send at t0, the other process answers with its time, and the answer arrives at t3. If both ways took equally long, that
// time was in the middle of t0 and t3; otherwise the error is at most half of the delay. So the quickest exchanges are the
// best. A line fitted through these gives the drift.
// Sources: F. Cristian, Probabilistic clock synchronization, 1989; RFC 5905 (NTPv4), for four stamps.
//
// Threads:   one at a time.
// Allocates: nothing.
#pragma once

#include <array>
#include <cstddef>

namespace timing {

struct Exchange {
    double sent = 0, received = 0, answered = 0, back = 0;      // [s] sent and back by our clock, the others by the other one
};

struct Sample {
    double at = 0;                  // [s] our clock, in the middle of the exchange
    double offset = 0;              // [s] the other clock minus ours
    double delay = 0;               // [s] on both ways; |error of offset| <= delay / 2
};
Sample sampleOf(const Exchange& exchange);

class Difference {
public:
    // Add a sample. False: it contradicts the others, so one of the clocks was set; the others were removed.
    bool add(const Sample& sample);
    void forget() { count_ = 0, drift_ = 0, best_ = {}; }

    bool known() const { return count_ > 0; }
    std::size_t samples() const { return count_; }
    double newest() const { return sample(0).at; }              // [s] our clock, time of the last sample
    double drift() const { return drift_; }                     // [s/s] by which the offset grows
    double offset(double mine) const { return best_.offset + drift_ * (mine - best_.at); }      // [s] at a time of our clock
    double bound(double mine) const;                            // [s] largest error of offset(mine)
    // Times of one clock as times of the other one [s].
    double toMine(double other) const;
    double toOther(double mine) const { return mine + offset(mine); }

private:
    static constexpr std::size_t kMost = 64;
    const Sample& sample(std::size_t age) const { return samples_[(newest_ + kMost - age) % kMost]; }
    void fit();

    std::array<Sample, kMost> samples_;
    std::size_t count_ = 0, newest_ = 0;
    double drift_ = 0;
    Sample best_;
};

}  // namespace timing
