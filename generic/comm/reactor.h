// reactor.h -- waits for many descriptors in one epoll set of its own.
//
// Tcl 8.6 hands every wait to a helper thread and cannot watch a descriptor above 1023; so all connections live here,
// with descriptors moved above 1024, and only the set's own descriptor is given to the surrounding event loop.
//
// Threads: one reactor belongs to one thread. poll() may be entered again from a callback (a service that runs the
// event loop); then the outer call goes on where it was.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

namespace sorma {

class Reactor {
public:
    // Something that waits for a descriptor. The watcher must call remove() before it goes.
    class Watcher {
    public:
        virtual ~Watcher() = default;
        virtual void ready(std::uint32_t events) = 0;       // EPOLLIN, EPOLLOUT, EPOLLHUP ...
    };

    Reactor();
    ~Reactor();
    Reactor(const Reactor&) = delete;
    Reactor& operator=(const Reactor&) = delete;

    int descriptor() const { return epoll_; }

    void add(int fd, std::uint32_t events, Watcher* watcher);
    void change(int fd, std::uint32_t events, Watcher* watcher);
    void remove(int fd, Watcher* watcher);

    // Call back watchers that are ready, and timers that are due; wait up to so many nanoseconds for the first one
    // (-1: for ever). Returns how many were called.
    int poll(std::int64_t nanoseconds);
    // The same until a time on the monotonic clock [ns].
    int pollUntil(std::int64_t end);
    // The latest reading of the clock that somebody told with seen(): for those who need the time only roughly.
    std::int64_t seen() const { return seen_; }
    void seen(std::int64_t now) { seen_ = now; }
    bool polling() const { return batches_ != nullptr; }        // is a poll on the stack?

    // Call watcher->ready(0) in the next poll, which then does not wait.
    void again(Watcher* watcher);

    // Call once, not before a time on the monotonic clock [ns]. Returns a number for cancel.
    std::uint64_t after(std::int64_t when, std::function<void()> callback);
    void cancel(std::uint64_t timer);

private:
    struct Batch;                       // events that a poll on the stack has yet to call
    int wait(int timeout, std::int64_t end);
    int callAll(Batch& batch);
    void armTimer(std::int64_t limit = 0);
    int runTimers();
    int runPending();

    int epoll_ = -1, timer_ = -1, bell_ = -1;
    std::int64_t armed_ = 0;            // when the timer goes off, 0: it is not set
    std::int64_t seen_ = 0;
    std::uint64_t nextTimer_ = 1;
    std::map<std::pair<std::int64_t, std::uint64_t>, std::function<void()>> timers_;
    std::vector<Watcher*> pending_;     // to be called again; the bell has been rung while it is not empty
    Batch* batches_ = nullptr;
};

// Move a descriptor out of select()'s reach where that is possible; closes the old one. Close-on-exec is set.
int raiseDescriptor(int fd);

}  // namespace sorma
