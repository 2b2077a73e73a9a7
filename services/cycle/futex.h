// futex.h -- a word on which a thread sleeps until another thread has changed it, or until a time. Any thread may use it.
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <climits>
#include <cstdint>
#include <ctime>

namespace cycle {

inline std::int64_t nanoseconds() {     // CLOCK_MONOTONIC
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

class Futex {
public:
    explicit Futex(std::uint32_t value = 0) : word_(value) {}
    std::uint32_t load() const { return word_.load(std::memory_order_acquire); }
    std::uint32_t peek() const { return word_.load(std::memory_order_relaxed); }       // when no other data depends on it
    bool exchange(std::uint32_t from, std::uint32_t to) {
        return word_.compare_exchange_strong(from, to, std::memory_order_acq_rel);
    }
    // Change it, and wake the threads that sleep.
    void set(std::uint32_t value) {
        word_.store(value, std::memory_order_release);
        wake();
    }
    void increase() {
        word_.fetch_add(1, std::memory_order_release);
        wake();
    }
    void wake() { call(FUTEX_WAKE_PRIVATE, INT_MAX, nullptr); }
    // Sleep while it has this value, until a time on the monotonic clock [ns]; INT64_MAX: for ever. May return early.
    void wait(std::uint32_t value, std::int64_t until) {
        timespec t{std::time_t(until / 1'000'000'000), long(until % 1'000'000'000)};
        call(FUTEX_WAIT_BITSET_PRIVATE, value, until == INT64_MAX ? nullptr : &t);
    }

private:
    long call(int operation, std::uint32_t value, const timespec* until) {
        return syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word_), operation, value, until, nullptr, FUTEX_BITSET_MATCH_ANY);
    }
    std::atomic<std::uint32_t> word_;
    static_assert(sizeof(std::atomic<std::uint32_t>) == 4 && std::atomic<std::uint32_t>::is_always_lock_free);
};

}  // namespace cycle
