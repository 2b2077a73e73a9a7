// serverLock.h -- guards the data of the servers between the SORM's thread and the health responder's thread.
//
// The SORM's thread holds the lock only while it reads, answers and sorts: for microseconds. It releases it before it enters
// a service or Tcl, and before it sleeps. Then the health responder may take it.
//
// Waiting: the health responder never waits for it. The SORM's thread waits at most for one look of the health responder.
// Threads: Held and Released are for the SORM's thread; tryLook and endLook for the health responder's.
#pragma once

#include <atomic>

namespace sorma {

class ServerLock {
public:
    // The SORM's thread holds the lock while this exists. May be nested, in itself and in Released.
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
    // The SORM's thread releases the lock while this exists, to run the code of a service. After it anything may have
    // changed.
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

    // Take the lock for the health responder; false when the SORM's thread holds it. After true, endLook() must follow.
    bool tryLook() {
        int expected = kFree;
        return state_.compare_exchange_strong(expected, kLooking, std::memory_order_acquire, std::memory_order_relaxed);
    }
    void endLook() {
        state_.store(kFree, std::memory_order_release);     // the next holder sees what the health responder did
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
        state_.store(kFree, std::memory_order_release);     // the health responder sees what the SORM's thread did
    }

    std::atomic<int> state_{kFree};
    bool held_ = false;         // the SORM's thread holds it; only that thread reads and writes this
};

}  // namespace sorma
