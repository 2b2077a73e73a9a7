// clock.h -- the time by which the ticks of a cycle are due: the machine's, or float 0 of a snapshot buffer.
//
// The second kind is simulated time, or that of a recording. Its writer says what time it is, in seconds, with each record;
// it may run faster or slower than the machine's, stop, and begin anew.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace cycle {

class Clock {
public:
    virtual ~Clock() = default;
    virtual std::int64_t now() noexcept = 0;        // [ns]
    // For who sleeps: take bell(), look whether there is still something to wait for, then sleep until `due` on this clock, or a
    // time on the monotonic one [ns], or ring(). May return early.
    virtual std::uint32_t bell() const noexcept = 0;
    virtual void sleep(std::uint32_t bell, std::int64_t due, std::int64_t until) noexcept = 0;
    virtual void ring() noexcept = 0;               // any thread
    virtual bool monotonic() const = 0;             // it is CLOCK_MONOTONIC
};

std::unique_ptr<Clock> machineClock();
// Fails with a std::runtime_error that says why there is no time: no such buffer, or no record in it.
std::unique_ptr<Clock> snapshotClock(const std::string& key);

}  // namespace cycle
