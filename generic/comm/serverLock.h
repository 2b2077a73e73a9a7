// serverLock.h -- who may touch what a server keeps: the SORM's thread, or the health responder while that thread is elsewhere.
//
// The SORM's thread holds it only while it reads, answers and sorts: a microsecond at a time. It releases it before it enters a service
// or Tcl, and before it sleeps; then the health responder may take it. Neither ever waits for long: the health responder never waits,
// and keeps it for one look.
#pragma once

#include <atomic>

namespace sorma {

class ServerLock {
public:
    // The SORM's thread holds it for the life of this. May be nested.
    class Held {
    public:
        explicit Held(ServerLock& lock) : lock_(lock), was_(lock.held_) {
            if (!was_) lock_.take();
        }
        ~Held() {
            if (!was_) lock_.release();
        }
        Held(const Held&) = delete;
        Held& operator=(const Held&) = delete;

    private:
        ServerLock& lock_;
        const bool was_;
    };
    // ... and releases it for the life of this, to execute somebody else's code.
    class Released {
    public:
        explicit Released(ServerLock& lock) : lock_(lock), was_(lock.held_) {
            if (was_) lock_.release();
        }
        ~Released() {
            if (was_) lock_.take();
        }
        Released(const Released&) = delete;
        Released& operator=(const Released&) = delete;

    private:
        ServerLock& lock_;
        const bool was_;
    };

    // The health responder: false when the SORM's thread holds it.
    bool tryLook() {
        int expected = kFree;
        return state_.compare_exchange_strong(expected, kLooking, std::memory_order_acquire, std::memory_order_relaxed);
    }
    void endLook() {
        state_.store(kFree, std::memory_order_release);     // what the health responder did is seen by whoever takes it next
        state_.notify_one();
    }

private:
    static constexpr int kFree = 0, kHeld = 1, kLooking = 2;
    void take() {
        int expected = kFree;
        // acquire: sees what the health responder did
        while (!state_.compare_exchange_strong(expected, kHeld, std::memory_order_acquire, std::memory_order_relaxed)) {
            state_.wait(kLooking, std::memory_order_relaxed);
            expected = kFree;
        }
        held_ = true;
    }
    void release() {
        held_ = false;
        state_.store(kFree, std::memory_order_release);     // the health responder sees what was done
    }

    std::atomic<int> state_{kFree};
    bool held_ = false;         // by the SORM's thread, for itself
};

}  // namespace sorma
