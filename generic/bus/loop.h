// loop.h -- what a service object can wait for beside requests: a time, a descriptor, work from another thread.
//
// COMM's reactor is a loop; in an interpreter it is a part of Tcl's event loop.
//
// Threads:   the SORM's, but for Mailbox::post.
// Callbacks: they run on the SORM's thread, one after another. They never run in the middle of a request, unless that
//            request runs the event loop. Each starts without a call context; work that continues a request brings the
//            context that it kept.
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

// A callback at a certain time. It is cancelled when the timer is deleted, so an owner that has its timers as members need
// not do anything else. A timer may outlive its loop.
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

    void cancel();                                      // does nothing when it has expired or was never set
    // True after it was set, until it is cancelled or assigned to; also when it has expired.
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

    // Call the callback once, not before a time on the monotonic clock [ns]. It may delete or set its own timer.
    [[nodiscard]] Timer after(std::int64_t when, Callback callback) { return Timer(self_, start(when, std::move(callback))); }

    // Call the callback whenever the descriptor can be read or was hung up. Call unwatch before you close it; the callback
    // may, too.
    virtual void watch(int fd, Callback readable) = 0;
    virtual void unwatch(int fd) = 0;

    // One turn: wait until something was called, or until a time [ns]. For code that blocks until a reply comes.
    virtual void turn(std::int64_t until) = 0;

protected:
    virtual std::uint64_t start(std::int64_t when, Callback callback) = 0;      // returns a number that is never 0
    virtual void stop(std::uint64_t timer) = 0;         // does nothing when it has expired

private:
    friend class Timer;
    std::shared_ptr<Loop*> self_ = std::make_shared<Loop*>(this);
};

inline void Timer::cancel() {
    if (number_ == 0) return;
    if (auto loop = loop_.lock()) (*loop)->stop(number_);
    number_ = 0;
}

// Work that any thread gives to a SORM's thread. It is shared: a thread may keep it when the SORM has ended. Then its work
// is deleted and never runs.
class Mailbox {
public:
    // Any thread. Never blocks, and never runs the work itself. The work runs without a call context, or in the one that is
    // given.
    void post(Loop::Callback work) { post(nullptr, std::move(work)); }
    void post(KeptCallPointer context, Loop::Callback work);
    // The SORM's thread: run the work that is there now, in order. If one item runs an event loop, that loop runs the items
    // after it. If one item throws, the exception leaves this function; the others stay, and the bell is called for them.
    void run();
    bool wait(std::int64_t until);              // block until there is work, or until a time [ns]; false: none came
    // Called by post, on the thread of post, when the box was empty: it wakes the loop. Null: no loop needs it.
    void setBell(Loop::Callback bell);
    void close();                               // by the SORM when it ends: deletes the work

    class Sorm* owner = nullptr;                // null when it has ended; only its own thread may read it

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
