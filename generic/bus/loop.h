// loop.h -- what a service object can wait for beside requests: a time, a descriptor, word from another thread.
//
// COMM's reactor is one, and lies inside Tcl's event loop in an interpreter. Callbacks run on the SORM's thread, one
// after another, never in the middle of a request (unless that request itself runs the event loop). Each starts in a fresh
// call context; what goes on with a request brings the context that it has kept.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>

#include "bus/call.h"

namespace sorma {

class Loop;

// A callback at a time. It is cancelled when this goes: an owner that keeps its timers as members needs no other care.
// It may outlive its loop.
class Timer {
public:
    Timer() = default;
    Timer(Timer&& other) noexcept : loop_(std::move(other.loop_)), number_(std::exchange(other.number_, 0)) {}
    Timer& operator=(Timer&& other) noexcept {
        cancel();
        loop_ = std::move(other.loop_);
        number_ = std::exchange(other.number_, 0);
        return *this;
    }
    ~Timer() { cancel(); }

    void cancel();                                      // one that has gone off, or never was set, is no error
    // Has it been set, and neither been cancelled nor assigned to since? It may have gone off.
    explicit operator bool() const { return number_ != 0; }

private:
    friend class Loop;
    Timer(std::weak_ptr<Loop*> loop, std::uint64_t number) : loop_(std::move(loop)), number_(number) {}
    std::weak_ptr<Loop*> loop_;
    std::uint64_t number_ = 0;
};

class Loop {
public:
    using Callback = std::function<void()>;
    Loop() = default;
    virtual ~Loop() = default;
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    // Call once, not before a time on the monotonic clock [ns].
    [[nodiscard]] Timer after(std::int64_t when, Callback callback) { return Timer(self_, start(when, std::move(callback))); }

    // Call whenever the descriptor can be read or has been hung up. The owner says unwatch before closing it.
    virtual void watch(int fd, Callback readable) = 0;
    virtual void unwatch(int fd) = 0;

    // One turn: wait until something has been called, or until a time [ns]. For those who wait for a reply.
    virtual void turn(std::int64_t until) = 0;

protected:
    virtual std::uint64_t start(std::int64_t when, Callback callback) = 0;      // never 0
    virtual void stop(std::uint64_t timer) = 0;         // one that has gone off is no error

private:
    friend class Timer;
    std::shared_ptr<Loop*> self_ = std::make_shared<Loop*>(this);
};

inline void Timer::cancel() {
    if (number_ == 0) return;
    if (auto loop = loop_.lock()) (*loop)->stop(number_);
    number_ = 0;
}

// Work for a SORM's thread, left by any thread. Shared, so that it outlives the SORM when a thread still holds it; then
// what is left in it is dropped.
class Mailbox {
public:
    // Any thread; never blocks, never runs the work itself. It runs in a fresh call context, or in the one that was kept
    // for it.
    void post(Loop::Callback work) { post(nullptr, std::move(work)); }
    void post(KeptCallPointer context, Loop::Callback work);
    // The SORM's thread: do what is there now, one after another. Work that waits in an event loop of its own lets that one
    // do what comes after it. What one item throws comes out of here; the others stay, and the bell is rung for them.
    void run();
    bool wait(std::int64_t until);              // until there is something [ns]; false: nothing came
    // Called by post, on its thread, when the box was empty: wakes the loop. Null: nobody needs waking.
    void setBell(Loop::Callback bell);
    void close();                               // by the SORM when it ends

    class Sorm* owner = nullptr;                // null when it has ended; for its own thread

private:
    std::mutex mutex_;
    std::condition_variable came_;
    void ringAgain();
    struct Item {
        KeptCallPointer context;
        Loop::Callback work;
    };
    std::deque<Item> work_;
    Loop::Callback bell_;
    bool closed_ = false;
};

}  // namespace sorma
