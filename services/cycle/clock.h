// clock.h -- the clock of a cycle: the machine's, or float 0 of a snapshot buffer.
//
// The second kind is simulated time, or the time of a recording. Its writer writes the time in seconds with each record. It
// may run faster or slower than the machine's clock, stop, and begin again. While its writer pauses it, the writer repeats the
// same time: so a clock that is paused differs from one whose writer hangs or has ended.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace cycle {

class Clock {
public:
    virtual ~Clock() = default;
    virtual std::int64_t now() noexcept = 0;        // [ns]
    // To sleep: call bell(), check whether there is still something to wait for, then call sleep() with that bell. It
    // returns at `due` on this clock, at `until` on the monotonic clock [ns], or after ring(). It may return early.
    virtual std::uint32_t bell() const noexcept = 0;
    virtual void sleep(std::uint32_t bell, std::int64_t due, std::int64_t until) noexcept = 0;
    virtual void ring() noexcept = 0;               // any thread
    virtual bool monotonic() const = 0;             // it is CLOCK_MONOTONIC
    // Changes with each record that now() has seen, also when the time is the same.
    virtual std::uint64_t record() const noexcept = 0;
};

std::unique_ptr<Clock> machineClock();
// Throws std::runtime_error when there is no time: no such buffer, or no record in it.
std::unique_ptr<Clock> snapshotClock(const std::string& key);

}  // namespace cycle
