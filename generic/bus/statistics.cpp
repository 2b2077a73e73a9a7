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
    static constexpr struct { double unit; const char* name; } scale[] = {{1e9, "s"}, {1e6, "ms"}, {1e3, "us"}};
    char text[32];
    for (auto& s : scale)
        if (ns >= s.unit) return std::snprintf(text, sizeof text, "%.3g %s", ns / s.unit, s.name), text;
    std::snprintf(text, sizeof text, "%.3g ns", ns);
    return text;
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
