// reactor.h -- waits for many descriptors, and calls back, in one epoll set of its own.
//
// Tcl 8.6 hands every wait to a helper thread and cannot watch a descriptor above 1023. So all connections are here, their
// descriptors are moved above 1024, and the surrounding event loop watches only the descriptor of the set.
//
// Threads:   one reactor belongs to one thread. Only turns() and setSleeper() may be called by others.
// Callbacks: poll() calls watchers, timers and the mailbox. A callback may add and remove watchers, and may call poll()
//            again (a service that runs the event loop); then the outer poll() continues with what is left. A callback must
//            not throw.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "bus/descriptor.h"
#include "bus/loop.h"
#include "comm/spinner.h"

namespace sorma {

class Reactor : public Loop {
public:
    // Gets called for a descriptor. It belongs to whoever added it, and must be removed before it is deleted; it may delete
    // itself inside ready(), after remove().
    class Watcher {
    public:
        virtual ~Watcher() = default;
        // events: EPOLLIN, EPOLLOUT, EPOLLHUP ..., or 0 after again().
        virtual void ready(std::uint32_t events) = 0;
        // After stay(): has its line brought something? As Transport::brought.
        virtual bool brought(bool /*sleep*/) { return false; }
        // Its line has been silent for a moment: as Transport::rest.
        virtual void rest() {}

    private:
        friend class Reactor;
        bool pending_ = false, awake_ = false, rests_ = false, moved_ = false;
    };

    // mailbox: its functions are called in the reactor's turns. Throws std::system_error when the kernel has run out of
    // descriptors.
    explicit Reactor(std::shared_ptr<Mailbox> mailbox = std::make_shared<Mailbox>());
    ~Reactor() override;
    Reactor(const Reactor&) = delete;
    Reactor& operator=(const Reactor&) = delete;

    // Can be read while something is to be called: for a surrounding event loop.
    int descriptor() const { return epoll_.get(); }

    // Call watcher->ready() when one of the events is there. add throws std::system_error when the kernel refuses the
    // descriptor. After remove the watcher is not called any more, not even in a turn that has begun.
    void add(int fd, std::uint32_t events, Watcher* watcher);
    bool change(int fd, std::uint32_t events, Watcher* watcher);        // false: the descriptor is not watched
    void remove(int fd, Watcher* watcher);

    // Call the watchers that are ready and the timers that are due. When there are none, wait for the first one, for at most
    // so many nanoseconds (-1: without limit). Returns how many were called.
    int poll(std::int64_t nanoseconds);
    // The same with a time on the monotonic clock as the limit [ns].
    int pollUntil(std::int64_t end);
    // The last time that was given to seen(now) [ns, monotonic]. Use it where a rough time is enough: it costs no system
    // call.
    std::int64_t seen() const { return seen_; }
    void seen(std::int64_t now) { seen_ = now; }
    bool polling() const { return batches_ != nullptr; }        // is a poll on the stack?

    // poll() in two steps, for an event loop that waits in this set, and calls later.
    // until: gather waits for events until this time on the monotonic clock [ns].   0: without limit;   kNoWait: not at all.
    // If it returns true, callGathered has something to call; that returns how many were called.
    static constexpr std::int64_t kNoWait = -1;
    bool gather(std::int64_t until);
    int callGathered();
    void wake() { ring(); }                 // a gather that waits returns, or else the next one. Any thread

    // Call watcher->ready(0) in the next poll, which then does not wait. Once, also when it is asked for again before.
    void again(Watcher* watcher);

    // Its descriptor has no event although bytes come: ask watcher->brought() instead, until the reactor sleeps. It asks for a while before
    // it does (comm/spinner.h), and then calls watcher->ready(EPOLLIN). When it has slept for a moment watcher->rest() is called once.
    void stay(Watcher* watcher) {
        watcher->moved_ = true;
        if (!std::exchange(watcher->awake_, true)) awake_.push_back(watcher);
    }
    // Another event loop is about to wait for descriptor().
    void doze();

    // ---- Loop ----
    void watch(int fd, Callback readable) override;
    void unwatch(int fd) override;
    void turn(std::int64_t until) override { pollUntil(until); }

    // Counts the turns in which something was called. Any thread. When it does not change although the descriptor can be
    // read, the reactor's thread is busy elsewhere.
    std::uint64_t turns() const { return turns_.load(std::memory_order_seq_cst); }
    // Another thread wants to sleep until the next turn begins: that turn writes to `bell`, an eventfd, once. -1: nobody
    // does. Any thread. The order is sequentially consistent: either the sleeper, which reads turns() after this, sees the
    // turn, or the turn sees the sleeper.
    void setSleeper(int bell) { sleeper_.store(bell, std::memory_order_seq_cst); }

protected:
    std::uint64_t start(std::int64_t when, Callback callback) override;
    void stop(std::uint64_t timer) override;

private:
    struct Batch;                       // events for which a poll on the stack still has to call
    int wait(int timeout, std::int64_t end);
    int callAll(Batch& batch);
    void armTimer(std::int64_t limit = 0);
    void ring();
    int runTimers();
    int runPending();

    const Descriptor epoll_, timer_, bell_;
    std::int64_t armed_ = 0;            // when the timer expires [ns]; 0: it is not set
    std::int64_t seen_ = 0;
    std::uint64_t nextTimer_ = 1;
    std::map<std::pair<std::int64_t, std::uint64_t>, Callback> timers_;
    std::unordered_map<std::uint64_t, std::int64_t> timerTimes_;        // of those in timers_
    struct Watched;
    std::unordered_map<int, std::unique_ptr<Watched>> watched_;         // by descriptor
    std::vector<std::unique_ptr<Watched>> unwatched_;                   // deleted later: one may be on the stack
    std::atomic<bool> rung_{false};     // the bell is, perhaps
    std::shared_ptr<Mailbox> mailbox_;
    std::atomic<std::uint64_t> turns_{0};
    std::atomic<int> sleeper_{-1};
    std::deque<Watcher*> pending_;      // from again(); while it is not empty the bell can be read
    Batch* batches_ = nullptr;          // of the polls on the stack, the innermost first
    std::unique_ptr<Batch> gathered_;   // what gather() has found
    std::vector<Watcher*> awake_;       // from stay()
    std::vector<Watcher*> resting_;     // have slept; there is a timer for them
    Spinner spinner_;
    std::int64_t waited_ = 0;           // [ns] when descriptors were last asked for events
    Watcher* findAwake(bool sleep);
    void leaveAwake();
    void restLater();
    void restAll();
    bool findBefore(Batch& batch, std::int64_t end);
};

// Move a descriptor above 1023, which select() cannot use. Returns the new one, close-on-exec; the old one when the process may
// not have so many. The first call raises the process's soft limit of descriptors to the hard one.
Descriptor raiseDescriptor(Descriptor fd);

}  // namespace sorma
