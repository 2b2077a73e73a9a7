// loop.h -- what a service object can wait for beside requests: a time, a descriptor, word from another thread.
//
// COMM's reactor is one, and lies inside Tcl's event loop in an interpreter. Callbacks run on the SORM's thread, one
// after another, never in the middle of a request (unless that request itself runs the event loop).
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

namespace sorma {

class Loop {
public:
    using Callback = std::function<void()>;
    virtual ~Loop() = default;

    // Call once, not before a time on the monotonic clock [ns]. Returns a number for cancel, never 0.
    virtual std::uint64_t after(std::int64_t when, Callback callback) = 0;
    virtual void cancel(std::uint64_t timer) = 0;       // one that has gone off, or 0, is no error

    // Call whenever the descriptor can be read or has been hung up. The owner says unwatch before closing it.
    virtual void watch(int fd, Callback readable) = 0;
    virtual void unwatch(int fd) = 0;

    // One turn: wait until something has been called, or until a time [ns]. For those who wait for a reply.
    virtual void turn(std::int64_t until) = 0;
};

// Work for a SORM's thread, left by any thread. Shared, so that it outlives the SORM when a thread still holds it; then
// what is left in it is dropped.
class Mailbox {
public:
    void post(Loop::Callback work);             // any thread; never blocks, never runs the work itself
    void run();                                 // the SORM's thread: do what is there now
    bool wait(std::int64_t until);              // until there is something [ns]; false: nothing came
    // Called by post, on its thread, when the box was empty: wakes the loop. Null: nobody needs waking.
    void setBell(Loop::Callback bell);
    void close();                               // by the SORM when it ends

    class Sorm* owner = nullptr;                // null when it has ended; for its own thread

private:
    std::mutex mutex_;
    std::condition_variable came_;
    std::vector<Loop::Callback> work_;
    Loop::Callback bell_;
    bool closed_ = false;
};

}  // namespace sorma
