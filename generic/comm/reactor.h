// reactor.h -- waits for many descriptors in one epoll set of its own.
//
// Tcl 8.6 hands every wait to a helper thread and cannot watch a descriptor above 1023; so all connections live here,
// with descriptors moved above 1024, and only the set's own descriptor is given to the surrounding event loop.
//
// Threads: one reactor belongs to one thread. poll() may be entered again from a callback (a service that runs the
// event loop); then the outer call goes on where it was.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "bus/loop.h"

namespace sorma {

class Reactor : public Loop {
public:
    // Something that waits for a descriptor. The watcher must call remove() before it goes.
    class Watcher {
    public:
        virtual ~Watcher() = default;
        virtual void ready(std::uint32_t events) = 0;       // EPOLLIN, EPOLLOUT, EPOLLHUP ...

    private:
        friend class Reactor;
        bool pending_ = false;
    };

    // mailbox: what others leave there is done in the reactor's turns.
    explicit Reactor(std::shared_ptr<Mailbox> mailbox = std::make_shared<Mailbox>());
    ~Reactor() override;
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

    // ---- Loop ----
    void watch(int fd, Callback readable) override;
    void unwatch(int fd) override;
    void turn(std::int64_t until) override { pollUntil(until); }

    // Turns in which something was called. Any thread may look: one that stands still while the descriptor can be read
    // belongs to a thread that is busy.
    std::uint64_t turns() const { return turns_.load(std::memory_order_seq_cst); }
    // Somebody else sleeps until the next turn begins: `bell`, an eventfd, is then rung once. -1: nobody does. Sequential
    // order: either the sleeper, who looks at turns() after this, sees the turn, or the turn sees the sleeper.
    void setSleeper(int bell) { sleeper_.store(bell, std::memory_order_seq_cst); }

protected:
    std::uint64_t start(std::int64_t when, Callback callback) override;
    void stop(std::uint64_t timer) override;

private:
    struct Batch;                       // events that a poll on the stack has yet to call
    int wait(int timeout, std::int64_t end);
    int callAll(Batch& batch);
    void armTimer(std::int64_t limit = 0);
    void ring();
    int runTimers();
    int runPending();

    int epoll_ = -1, timer_ = -1, bell_ = -1;
    std::int64_t armed_ = 0;            // when the timer goes off, 0: it is not set
    std::int64_t seen_ = 0;
    std::uint64_t nextTimer_ = 1;
    std::map<std::pair<std::int64_t, std::uint64_t>, Callback> timers_;
    std::unordered_map<std::uint64_t, std::int64_t> timerTimes_;        // of those in timers_
    struct Descriptor;
    std::unordered_map<int, std::unique_ptr<Descriptor>> descriptors_;
    std::vector<std::unique_ptr<Descriptor>> unwatched_;                // one may be on the stack
    std::shared_ptr<Mailbox> mailbox_;
    std::atomic<std::uint64_t> turns_{0};
    std::atomic<int> sleeper_{-1};
    std::vector<Watcher*> pending_;     // to be called again; the bell has been rung while it is not empty
    Batch* batches_ = nullptr;
};

// Move a descriptor out of select()'s reach where that is possible; closes the old one. Close-on-exec is set.
int raiseDescriptor(int fd);

}  // namespace sorma
