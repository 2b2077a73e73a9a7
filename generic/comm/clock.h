// clock.h -- deadlines that cross the wire, between processes whose clocks may differ.
//
// A deadline crosses the wire as a time of the caller's CLOCK_MONOTONIC. So the time that a request spends in sockets
// counts, and a request that is sent again keeps its deadline. Two processes that see the same clock compare directly.
// Otherwise the daemon estimates the difference of the clocks. A record with its time of sending cannot arrive
// earlier than that. So the smallest arrival minus sending of the last 10 to 20 s is the difference plus the shortest transit time.
// This is the idea of NTP's clock filter, RFC 5905 section 10.
//
// Threads: the functions may be called by any thread; a PeerClock belongs to its peer. Nothing throws but for memory.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus/deadline.h"

namespace sorma {

// Names the clock that this process sees: this boot of the kernel and the time namespace. Two processes with the same text
// have the same clock. Empty when the kernel does not say.
const std::string& clockSeen();
// The same for process numbers: this boot and the pid namespace.
const std::string& processesSeen();
// True when this process has certainly ended. False also when we cannot see it: processes is not the same as
// processesSeen().
bool hasEnded(std::int64_t process, std::string_view processes);

// A deadline as it crosses the wire: milliseconds of the caller's clock, rounded up, the low 32 bits. 0: there is none, or
// it is more than 20 days away, where the low bits could mean the past.   now: [ns]
inline std::uint32_t deadlineMark(Deadline deadline, std::int64_t now) {
    constexpr std::int64_t kMillisecond = 1'000'000, kFarthest = 20 * 86'400'000 * kMillisecond;
    if (deadline.none() || deadline.when() - now > kFarthest) return 0;
    auto mark = static_cast<std::uint32_t>((deadline.when() + kMillisecond - 1) / kMillisecond);
    return mark == 0 ? 1 : mark;
}

// One peer's clock, as far as it is known.
class PeerClock {
public:
    // It is our clock, too: no estimate is needed.
    void same() { same_ = true; }
    // A record has arrived that says when it was sent.   sent: time of the peer's clock [ns]; what cannot be such a time is
    // ignored;   arrived: of ours [ns]
    void sample(std::int64_t sent, std::int64_t arrived);
    // The peer's mark (see deadlineMark) as a time of our clock.   arrived: when the mark came [ns]; the deadline is taken
    // to be within 24 days of it. Without same() and without a sample() the two clocks count as one.
    Deadline deadline(std::uint32_t mark, std::int64_t arrived) const;

private:
    bool same_ = false;
    std::int64_t since_ = 0;                                // [ns] when this window began
    std::int64_t least_ = INT64_MAX, before_ = INT64_MAX;   // smallest difference [ns], in this window and in the last one
};

}  // namespace sorma
