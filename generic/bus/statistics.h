// statistics.h -- a histogram of times on a logarithmic scale, and times as text.
//
// Threads: no locks; one thread at a time uses a histogram.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace sorma {

class Histogram {
public:
    // Count a time. Bucket i is for times from 2^i to 2^(i+1) nanoseconds.
    void add(std::int64_t nanoseconds) {
        int i = nanoseconds < 1 ? 0 : 63 - __builtin_clzll(static_cast<unsigned long long>(nanoseconds));
        ++buckets_[i < kBuckets ? i : kBuckets - 1];
        ++count_;
        if (nanoseconds > 0) sum_ += std::uint64_t(nanoseconds);
        if (nanoseconds > max_) max_ = nanoseconds;
    }
    std::uint64_t count() const { return count_; }
    std::uint64_t sum() const { return sum_; }  // of all times [ns]
    std::uint64_t below(int i) const;           // how many times were shorter than 2^i nanoseconds
    void add(const Histogram& other);
    // The time that a share q (0 .. 1) of all did not exceed [ns]: upper edge of its bucket. 0 when there are none.
    std::int64_t quantile(double q) const;
    std::string toText() const;                 // for people, one line for each bucket that is not empty

private:
    static constexpr int kBuckets = 40;
    std::array<std::uint32_t, kBuckets> buckets_{};
    std::uint64_t count_ = 0, sum_ = 0;
    std::int64_t max_ = 0;
};

// Counts of all objects of a class, also of removed ones.
struct Figures {
    std::uint64_t objects = 0, underWay = 0;                    // that there are; requests under way, or waiting
    std::uint64_t execs = 0, ctrls = 0, dbxs = 0, errors = 0;   // so far
    Histogram times;                                            // of EXEC, one call in 64, until its answer
};

std::string durationText(double nanoseconds);   // "1.2 us", "35 ms", "2.5 s"
std::string clockText(std::int64_t microseconds);    // since 1970, as local date and time: "2026-03-01 10:31:02.123"

}  // namespace sorma
