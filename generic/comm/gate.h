// gate.h -- who may touch what a server keeps: the SORM's thread, or the watchman while that thread is elsewhere.
//
// The SORM's thread is inside only while it reads, answers and sorts: a microsecond at a time. Outside, in a service,
// in Tcl, or asleep, it touches nothing of the server's, and the watchman may come in. Neither ever waits for long:
// the watchman never waits at all, and it stays for one look.
#pragma once

#include <atomic>

namespace sorma {

class Gate {
public:
    // The SORM's thread comes in for the life of this. May be nested.
    class Inside {
    public:
        explicit Inside(Gate& gate) : gate_(gate), was_(gate.inside_) {
            if (!was_) gate_.enter();
        }
        ~Inside() {
            if (!was_) gate_.leave();
        }
        Inside(const Inside&) = delete;
        Inside& operator=(const Inside&) = delete;

    private:
        Gate& gate_;
        const bool was_;
    };
    // ... and goes out for the life of this, to execute somebody else's code.
    class Outside {
    public:
        explicit Outside(Gate& gate) : gate_(gate), was_(gate.inside_) {
            if (was_) gate_.leave();
        }
        ~Outside() {
            if (was_) gate_.enter();
        }
        Outside(const Outside&) = delete;
        Outside& operator=(const Outside&) = delete;

    private:
        Gate& gate_;
        const bool was_;
    };

    // The watchman: false when the SORM's thread is inside.
    bool tryWatch() {
        int expected = kOpen;
        return state_.compare_exchange_strong(expected, kWatched, std::memory_order_acquire, std::memory_order_relaxed);
    }
    void endWatch() {
        state_.store(kOpen, std::memory_order_release);     // what the watchman did is seen by whoever enters next
        state_.notify_one();
    }

private:
    static constexpr int kOpen = 0, kInside = 1, kWatched = 2;
    void enter() {
        int expected = kOpen;
        // acquire: sees what the watchman did
        while (!state_.compare_exchange_strong(expected, kInside, std::memory_order_acquire, std::memory_order_relaxed)) {
            state_.wait(kWatched, std::memory_order_relaxed);
            expected = kOpen;
        }
        inside_ = true;
    }
    void leave() {
        inside_ = false;
        state_.store(kOpen, std::memory_order_release);     // the watchman sees what was done inside
    }

    std::atomic<int> state_{kOpen};
    bool inside_ = false;       // of the SORM's thread, for itself
};

}  // namespace sorma
