#include "bus/deadline.h"

#include <ctime>

namespace sorma {

namespace {

std::int64_t read(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

std::int64_t monotonicNow() { return read(CLOCK_MONOTONIC); }
std::int64_t wallNow() { return read(CLOCK_REALTIME) / 1000; }

}  // namespace sorma
