#include "difference.h"

#include <algorithm>
#include <cmath>

namespace timing {

namespace {

constexpr double kSlack = 15e-6;            // [s/s] by which an offset may change unseen
constexpr double kMostDrift = 1e-3;         // [s/s] no clock is as bad
constexpr double kQuick = 2;                // times the shortest delay: such exchanges count for the drift
constexpr std::size_t kLeast = 8;           // samples, for a drift

}  // namespace

Sample sampleOf(const Exchange& e) {
    return {0.5 * (e.sent + e.back), 0.5 * ((e.received - e.sent) + (e.answered - e.back)), (e.back - e.sent) - (e.answered - e.received)};
}

double Difference::bound(double mine) const { return 0.5 * best_.delay + kSlack * std::abs(mine - best_.at); }

double Difference::toMine(double other) const {
    // other = mine + offset(mine), which is a straight line
    return best_.at + (other - best_.at - best_.offset) / (1 + drift_);
}

bool Difference::add(const Sample& s) {
    const bool fits = count_ == 0 || std::abs(s.offset - offset(s.at)) <=
        0.5 * s.delay + bound(s.at) + (count_ < kLeast ? kMostDrift * std::abs(s.at - best_.at) : 0);
    if (!fits) forget();
    newest_ = (newest_ + 1) % kMost;
    samples_[newest_] = s;
    count_ = std::min(count_ + 1, kMost);
    fit();
    return fits;
}

void Difference::fit() {
    double shortest = sample(0).delay;
    for (std::size_t i = 0; i < count_; ++i) shortest = std::min(shortest, sample(i).delay);
    // A straight line through the quick ones, each by how sure it is.
    double weight = 0, t = 0, o = 0, tt = 0, to = 0;
    std::size_t used = 0;
    double first = sample(0).at;
    for (std::size_t i = 0; i < count_; ++i) {
        const Sample& s = sample(i);
        if (s.delay > kQuick * shortest) continue;
        const double w = 1 / (1e-18 + s.delay * s.delay), at = s.at - sample(0).at, offset = s.offset - sample(0).offset;
        weight += w, t += w * at, o += w * offset, tt += w * at * at, to += w * at * offset;
        first = std::min(first, s.at);
        ++used;
    }
    // Not before it can be told from the delays: over a short time these are all that there is to see.
    const double span = sample(0).at - first, spread = tt - t * t / weight;
    drift_ = used >= kLeast && span * kSlack > 0.25 * shortest && spread > 0
        ? std::clamp((to - t * o / weight) / spread, -kMostDrift, kMostDrift) : 0;
    best_ = sample(0);
    for (std::size_t i = 1; i < count_; ++i) {
        const Sample& s = sample(i);
        if (0.5 * s.delay + kSlack * (sample(0).at - s.at) < 0.5 * best_.delay + kSlack * (sample(0).at - best_.at)) best_ = s;
    }
}

}  // namespace timing
