// deadline.h -- clocks, and until when something may take.
//
// Deadlines travel between processes as time left, so clocks need not agree.
#pragma once

#include <cstdint>

namespace sorma {

std::int64_t monotonicNow();    // nanoseconds, CLOCK_MONOTONIC
std::int64_t wallNow();         // microseconds since 1970

class Deadline {
public:
    Deadline() = default;       // none
    static Deadline in(std::int64_t milliseconds) {     // 0 = none
        return milliseconds > 0 ? Deadline(monotonicNow() + milliseconds * 1'000'000) : Deadline();
    }
    static Deadline at(std::int64_t monotonicNanoseconds) { return Deadline(monotonicNanoseconds); }

    bool none() const { return at_ == 0; }
    bool passed() const { return at_ != 0 && monotonicNow() >= at_; }
    std::int64_t when() const { return at_; }               // [ns], 0 = none
    std::int64_t left() const {                             // [ns]; a century when there is none, 0 when passed
        if (at_ == 0) return std::int64_t{3'155'760'000} * 1'000'000'000;
        std::int64_t rest = at_ - monotonicNow();
        return rest > 0 ? rest : 0;
    }
    Deadline earlier(Deadline other) const {
        if (none()) return other;
        if (other.none()) return *this;
        return at_ < other.at_ ? *this : other;
    }

private:
    explicit Deadline(std::int64_t at) : at_(at) {}
    std::int64_t at_ = 0;
};

}  // namespace sorma
