// deadline.h -- clocks and deadlines.
//
// A deadline is a time of this process's monotonic clock. comm/clock.h says how it crosses to other processes.
#pragma once

#include <cstdint>

namespace sorma {

std::int64_t monotonicNow();    // nanoseconds, CLOCK_MONOTONIC
std::int64_t wallNow();         // microseconds since 1970

// The time at which somebody stops waiting; or none. A value, for any thread.
class Deadline {
public:
    Deadline() = default;       // none
    static Deadline in(std::int64_t milliseconds) {     // from now; 0: none
        return milliseconds > 0 ? Deadline(monotonicNow() + milliseconds * 1'000'000) : Deadline();
    }
    static Deadline at(std::int64_t monotonicNanoseconds) { return Deadline(monotonicNanoseconds); }

    bool none() const { return at_ == 0; }
    bool passed() const { return at_ != 0 && monotonicNow() >= at_; }
    std::int64_t when() const { return at_; }               // [ns], 0: none
    std::int64_t left() const {                             // [ns]; 0 when it has passed, a century when there is none
        if (at_ == 0) return std::int64_t{3'155'760'000} * 1'000'000'000;
        std::int64_t rest = at_ - monotonicNow();
        return rest > 0 ? rest : 0;
    }
    Deadline earlier(Deadline other) const {                // the earlier of the two
        if (none()) return other;
        if (other.none()) return *this;
        return at_ < other.at_ ? *this : other;
    }

private:
    explicit Deadline(std::int64_t at) : at_(at) {}
    std::int64_t at_ = 0;
};

}  // namespace sorma
