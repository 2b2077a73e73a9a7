// clock.h -- which clock and which processes of the kernel's a process sees, and what another's clock says here.
//
// A deadline crosses the wire as the caller's own CLOCK_MONOTONIC, so that the time a request spends in sockets counts, and
// a request that is sent again says the same. Two processes that see the same clock compare directly. Of others the
// difference is estimated: a record that says when it was sent cannot have come earlier, so the least of arrival minus
// sending, over a while, is the difference plus the shortest way (the idea of NTP's clock filter, RFC 5905 section 10).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus/deadline.h"

namespace sorma {

const std::string& clockSeen();             // the same text: the same clock. This boot of the kernel, and the time namespace
const std::string& processesSeen();         // the same for process numbers: this boot, and the namespace of processes
bool hasEnded(std::int64_t process, std::string_view processes);     // no doubt that it has: we would see it

// A deadline as it crosses the wire: milliseconds of the caller's clock, rounded up, the low 32 bits; 0: none,
// or none that is near enough to be told from the past. now: [ns]
inline std::uint32_t deadlineMark(Deadline deadline, std::int64_t now) {
    constexpr std::int64_t kMillisecond = 1'000'000, kFarthest = 20 * 86'400'000 * kMillisecond;
    if (deadline.none() || deadline.when() - now > kFarthest) return 0;
    auto mark = static_cast<std::uint32_t>((deadline.when() + kMillisecond - 1) / kMillisecond);
    return mark == 0 ? 1 : mark;
}

class PeerClock {
public:
    void same() { same_ = true; }
    // A record that was sent at a time of the peer's clock has come. [ns]
    void sample(std::int64_t sent, std::int64_t arrived);
    // What the peer's mark means here. arrived: when it came; a deadline is taken to be within 24 days of it.
    Deadline deadline(std::uint32_t mark, std::int64_t arrived) const;

private:
    bool same_ = false;
    std::int64_t since_ = 0;
    std::int64_t least_ = INT64_MAX, before_ = INT64_MAX;   // in this window, in the last one
};

}  // namespace sorma
