#include "bus/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

namespace sorma {

std::int64_t Histogram::quantile(double q) const {
    std::uint64_t wanted = static_cast<std::uint64_t>(std::ceil(q * double(count_))), seen = 0;
    for (int i = 0; i < kBuckets; ++i) {
        seen += buckets_[i];
        if (seen >= wanted && seen > 0) return std::min(max_, std::int64_t{2} << i);
    }
    return max_;
}

std::uint64_t Histogram::below(int i) const {
    std::uint64_t sum = 0;
    for (int k = 0; k < std::min(i, kBuckets); ++k) sum += buckets_[k];
    return sum;
}

void Histogram::add(const Histogram& other) {
    if (other.count_ == 0) return;
    for (int i = 0; i < kBuckets; ++i) buckets_[i] += other.buckets_[i];
    count_ += other.count_;
    sum_ += other.sum_;
    max_ = std::max(max_, other.max_);
}

std::string Histogram::toText() const {
    std::string out;
    for (int i = 0; i < kBuckets; ++i) {
        if (buckets_[i] == 0) continue;
        if (!out.empty()) out += '\n';
        out += durationText(double(std::int64_t{1} << i)) + " .. " + durationText(double(std::int64_t{2} << i)) + ": " +
               std::to_string(buckets_[i]);
    }
    return out;
}

std::string durationText(double ns) {
    static constexpr struct { double unit; const char* name; } scale[] = {{1e9, "s"}, {1e6, "ms"}, {1e3, "us"}, {1, "ns"}};
    char digits[32];
    for (auto& s : scale) {
        if (ns < 0.9995 * s.unit && s.unit > 1) continue;       // 999.7 us are 1 ms, not 1000 us
        // Three digits, but no 1e+03.
        std::snprintf(digits, sizeof digits, ns < 999.5 * s.unit ? "%.3g" : "%.0f", ns / s.unit);
        return std::string(digits) + ' ' + s.name;
    }
    return {};
}

std::string clockText(std::int64_t microseconds) {
    std::time_t seconds = microseconds / 1'000'000;
    std::tm local{};
    localtime_r(&seconds, &local);
    char text[64];
    std::size_t n = std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &local);
    std::snprintf(text + n, sizeof text - n, ".%03d", int(microseconds / 1000 % 1000));
    return text;
}

}  // namespace sorma
