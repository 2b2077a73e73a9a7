// spinner.h -- looks again and again for a while, before a thread sleeps, where that has paid lately.
//
// Where the other end runs on the same processor it never pays. After each try in vain twice as many waits go by without one, 255 at
// most; after one that has paid every wait tries.
//
// Threads: one object belongs to one thread.
#pragma once

#include <algorithm>
#include <cstdint>

#include "bus/deadline.h"

namespace sorma {

class Spinner {
public:
    static constexpr std::int64_t kLongest = 50'000;            // [ns]
    // Ask until it is true, for `most` nanoseconds at most. Returns what it said last.
    template <class Ready> bool wait(Ready ready, std::int64_t most = kLongest) {
        if (ready()) return true;
        if (left_ > 0) {
            --left_;
            return false;
        }
        const std::int64_t end = monotonicNow() + std::min(most, kLongest);
        do {
            for (int i = 0; i < kLooks; ++i) {
                if (ready()) {
                    vain_ = 0;
                    return true;
                }
                pause();
            }
        } while (monotonicNow() < end);
        left_ = vain_ = std::min(2 * vain_ + 1, kMostVain);
        return false;
    }

private:
    static constexpr int kLooks = 16;                           // between two looks at the clock
    static constexpr unsigned kMostVain = 255;
    static void pause() {
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        asm volatile("yield");
#endif
    }
    unsigned vain_ = 0, left_ = 0;
};

}  // namespace sorma
