// difference.h -- how much another clock is ahead of mine, from exchanges of messages.
//
// I send at t0, the other answers with its time, I have that at t3. When the way there and the way back took equally long, its
// time was that of the middle; else the error is at most half of the delay. So the quickest exchanges say most. How fast the
// difference grows is fitted through these.
// Sources: F. Cristian, Probabilistic clock synchronization, 1989; RFC 5905 (NTPv4), for four stamps.
//
// Threads:   one at a time.
// Allocates: nothing.
#pragma once

#include <array>
#include <cstddef>

namespace timing {

struct Exchange {
    double sent = 0, received = 0, answered = 0, back = 0;      // [s] sent and back by my clock, the others by the other one
};

struct Sample {
    double at = 0;                  // [s] my clock, in the middle of the exchange
    double offset = 0;              // [s] the other clock minus mine
    double delay = 0;               // [s] on both ways; |error of offset| <= delay / 2
};
Sample sampleOf(const Exchange& exchange);

class Difference {
public:
    // False: it contradicts what is known, so one of the clocks was set. All before it has been forgotten.
    bool add(const Sample& sample);
    void forget() { count_ = 0, drift_ = 0, best_ = {}; }

    bool known() const { return count_ > 0; }
    std::size_t samples() const { return count_; }
    double newest() const { return sample(0).at; }              // [s] my clock, of the last one
    double drift() const { return drift_; }                     // [s/s] by which the offset grows
    double offset(double mine) const { return best_.offset + drift_ * (mine - best_.at); }      // [s] at a time of my clock
    double bound(double mine) const;                            // [s] of the error of that
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
