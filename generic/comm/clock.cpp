#include "comm/clock.h"

#include <limits.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <utility>

namespace sorma {

namespace {

constexpr std::int64_t kWindow = 10'000'000'000;        // [ns] in two of them clocks drift by 10 ms at 500 ppm
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kLatest = INT64_MAX / 4;         // [ns] 73 years: no clock that began at a boot says more

// "BOOT NAMESPACE"; empty when the kernel does not say: then no two are the same.
std::string seen(const char* link) {
    std::string boot;
    std::ifstream("/proc/sys/kernel/random/boot_id") >> boot;
    char space[PATH_MAX];
    ssize_t n = readlink(link, space, sizeof space);
    if (n <= 0 || boot.empty()) return {};
    return boot + ' ' + std::string(space, std::size_t(n));
}

}  // namespace

const std::string& clockSeen() {
    static const std::string text = seen("/proc/self/ns/time");
    return text;
}

const std::string& processesSeen() {
    static const std::string text = seen("/proc/self/ns/pid");
    return text;
}

bool hasEnded(std::int64_t process, std::string_view processes) {
    if (process <= 0 || process > INT_MAX || processes.empty() || processes != processesSeen()) return false;
    if (kill(pid_t(process), 0) < 0) return errno == ESRCH;
    std::string stat;                       // "4711 (name of the program) S ..."
    std::getline(std::ifstream("/proc/" + std::to_string(process) + "/stat"), stat);
    auto name = stat.rfind(')');
    return name != stat.npos && name + 2 < stat.size() && (stat[name + 2] == 'Z' || stat[name + 2] == 'X');    // ended, not fetched yet
}

void PeerClock::sample(std::int64_t sent, std::int64_t arrived) {
    if (sent < 0 || sent > kLatest) return;
    std::int64_t difference = arrived - sent;
    if (arrived - since_ > kWindow) {
        before_ = std::exchange(least_, difference);
        since_ = arrived;
    }
    least_ = std::min(least_, difference);
}

Deadline PeerClock::deadline(std::uint32_t mark, std::int64_t arrived) const {
    if (mark == 0) return {};
    std::int64_t difference = same_ ? 0 : std::min(least_, before_);
    if (difference == INT64_MAX) difference = 0;                    // nothing that it said could be a time
    std::int64_t theirs = (arrived - difference) / kMillisecond;
    std::int64_t left = std::int32_t(mark - static_cast<std::uint32_t>(theirs));
    return Deadline::at((theirs + left) * kMillisecond + difference);
}

}  // namespace sorma
