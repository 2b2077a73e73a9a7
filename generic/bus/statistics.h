// statistics.h -- how often and how fast: counters and a histogram of times on a logarithmic scale.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace sorma {

class Histogram {
public:
    // Bucket i counts times from 2^i to 2^(i+1) nanoseconds.
    void add(std::int64_t nanoseconds) {
        int i = nanoseconds < 1 ? 0 : 63 - __builtin_clzll(static_cast<unsigned long long>(nanoseconds));
        ++buckets_[i < kBuckets ? i : kBuckets - 1];
        ++count_;
        if (nanoseconds > max_) max_ = nanoseconds;
    }
    std::uint64_t count() const { return count_; }
    std::int64_t quantile(double q) const;      // [ns], upper edge of the bucket; 0 when empty
    std::string toText() const;                 // one line for each bucket in use

private:
    static constexpr int kBuckets = 40;
    std::array<std::uint32_t, kBuckets> buckets_{};
    std::uint64_t count_ = 0;
    std::int64_t max_ = 0;
};

std::string durationText(double nanoseconds);   // "1.2 us", "35 ms", "2.5 s"
std::string clockText(std::int64_t microseconds);    // local date and time of a wall clock: "2026-03-01 10:31:02.123"

}  // namespace sorma
