#include "comm/reactor.h"

#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <mutex>
#include <system_error>

#include "bus/atEnd.h"
#include "bus/call.h"

namespace sorma {

namespace {

constexpr int kSelectLimit = 1024;      // FD_SETSIZE
constexpr int kBatch = 64;

}  // namespace

struct Reactor::Batch {
    epoll_event events[kBatch];
    int at = 0, count = 0;
    Batch* outer = nullptr;

    void forget(Watcher* watcher) {
        for (int i = at; i < count; ++i)
            if (events[i].data.ptr == watcher) events[i].events = 0;
    }
};

// Someone who waits for a descriptor without a class of his own.
struct Reactor::Watched : Watcher {
    Callback readable;
    explicit Watched(Callback callback) : readable(std::move(callback)) {}
    void ready(std::uint32_t) override {
        auto callback = readable;       // it may unwatch itself
        callback();
    }
};

Reactor::Reactor(std::shared_ptr<Mailbox> mailbox)
    : epoll_(epoll_create1(EPOLL_CLOEXEC)), timer_(raiseDescriptor(Descriptor(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)))),
      bell_(raiseDescriptor(Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)))), seen_(monotonicNow()), mailbox_(std::move(mailbox)),
      gathered_(std::make_unique<Batch>()) {
    if (!epoll_ || !timer_ || !bell_) throw std::system_error(errno, std::generic_category(), "cannot wait for events");
    epoll_event e{};
    e.events = EPOLLIN;
    e.data.ptr = nullptr;               // null: the timer
    epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, timer_.get(), &e);
    e.data.ptr = this;                  // this: the bell
    epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, bell_.get(), &e);
    mailbox_->setBell([this] { ring(); });
}

Reactor::~Reactor() { mailbox_->setBell(nullptr); }

void Reactor::add(int fd, std::uint32_t events, Watcher* watcher) {
    epoll_event e{};
    e.events = events;
    e.data.ptr = watcher;
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &e) < 0)
        throw std::system_error(errno, std::generic_category(), "cannot watch a descriptor");
}

bool Reactor::change(int fd, std::uint32_t events, Watcher* watcher) {
    epoll_event e{};
    e.events = events;
    e.data.ptr = watcher;
    return epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &e) == 0;
}

void Reactor::remove(int fd, Watcher* watcher) {
    epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
    // Polls on the stack must not call it any more, and neither must callGathered.
    for (Batch* b = batches_; b; b = b->outer) b->forget(watcher);
    gathered_->forget(watcher);
    if (watcher->pending_) std::erase(pending_, watcher);
    if (watcher->awake_) std::erase(awake_, watcher);
    if (watcher->rests_) std::erase(resting_, watcher);
    watcher->pending_ = watcher->awake_ = watcher->rests_ = false;
}

// Any thread. It cannot fail: the counter is read before it can overflow.
void Reactor::ring() {
    std::uint64_t one = 1;
    ssize_t ignored = write(bell_.get(), &one, sizeof one);
    (void)ignored;
    rung_.store(true, std::memory_order_release);       // after the bell: who sees it finds the bell
}

void Reactor::again(Watcher* watcher) {
    if (watcher->pending_) return;
    watcher->pending_ = true;
    if (pending_.empty()) ring();
    pending_.push_back(watcher);
}

int Reactor::runPending() {
    std::uint64_t rung;
    rung_.store(false, std::memory_order_relaxed);
    if (read(bell_.get(), &rung, sizeof rung) < 0) return 0;
    mailbox_->run();
    // Watchers that are added while these run wait for the next poll, so that descriptors get their turn.
    std::size_t n = pending_.size();
    int called = 1;
    for (; n > 0 && !pending_.empty(); --n, ++called) {
        Watcher* watcher = pending_.front();
        pending_.pop_front();
        watcher->pending_ = false;
        watcher->ready(0);
    }
    if (!pending_.empty()) ring();
    return called;
}

int Reactor::poll(std::int64_t nanoseconds) {
    return wait(nanoseconds == 0 ? 0 : -1, nanoseconds > 0 ? monotonicNow() + nanoseconds : 0);
}

int Reactor::pollUntil(std::int64_t end) { return wait(-1, end); }

// timeout: as for epoll_wait, 0 or -1. end: when to give up waiting, 0 = never.
int Reactor::wait(int timeout, std::int64_t end) {
    for (;;) {
        // Our timer keeps the limit; it is set again only when it has expired. A timeout of epoll_wait would be one more
        // kernel timer set and taken back for each request, and costs 1.4 us where raw ping-pong takes 4.
        if (end != 0) armTimer(end);
        Batch batch;
        if (awake_.empty() || !findBefore(batch, timeout == 0 ? kNoWait : end))
            batch.count = std::max(0, epoll_wait(epoll_.get(), batch.events, kBatch, timeout));
        const int n = batch.count, called = n > 0 ? callAll(batch) : 0;
        if (timeout == 0 && !batches_) doze();
        if (n == 0) return 0;
        if (called > 0 || timeout == 0 || (end != 0 && monotonicNow() >= end)) return called;
    }
}

bool Reactor::gather(std::int64_t until) {
    if (gathered_->count > 0) return true;
    if (!awake_.empty() && findBefore(*gathered_, until)) return true;
    if (until > 0) armTimer(until);
    gathered_->count = std::max(0, epoll_wait(epoll_.get(), gathered_->events, kBatch, until == kNoWait ? 0 : -1));
    return gathered_->count > 0;
}

Reactor::Watcher* Reactor::findAwake(bool sleep) {
    for (Watcher* watcher : awake_)
        if (watcher->brought(sleep)) return watcher;
    return nullptr;
}

// Before descriptors are waited for: look whether a line has brought something. end: as gather's until. False: wait, they sleep.
bool Reactor::findBefore(Batch& batch, std::int64_t end) {
    constexpr std::int64_t kTurn = 50'000;              // [ns] after which descriptors and timers have their turn
    const auto found = [&](Watcher* watcher) {
        batch.events[0].events = EPOLLIN;
        batch.events[0].data.ptr = watcher;
        batch.count = 1;
        return true;
    };
    if (seen_ - waited_ > kTurn) {
        waited_ = monotonicNow();
        batch.count = std::max(0, epoll_wait(epoll_.get(), batch.events, kBatch, 0));
        if (batch.count > 0) return true;
    }
    Watcher* watcher = nullptr;
    const auto look = [&] { return (watcher = findAwake(false)) != nullptr; };
    if (end == kNoWait ? look() : spinner_.wait(look, end == 0 ? Spinner::kLongest : end - monotonicNow())) return found(watcher);
    if (end == kNoWait) return false;
    if ((watcher = findAwake(true))) return found(watcher);
    leaveAwake();
    return false;
}

void Reactor::leaveAwake() {
    for (Watcher* watcher : awake_) {
        watcher->awake_ = false;
        if (std::exchange(watcher->rests_, true)) continue;
        if (resting_.empty()) restLater();
        resting_.push_back(watcher);
    }
    awake_.clear();
}

void Reactor::restLater() {
    constexpr std::int64_t kMoment = 10'000'000;        // [ns]
    start(monotonicNow() + kMoment, [this] { restAll(); });
}

// All that have been silent for the whole moment.
void Reactor::restAll() {
    std::erase_if(resting_, [](Watcher* watcher) {
        if (std::exchange(watcher->moved_, false)) return false;
        watcher->rests_ = false;
        watcher->rest();
        return true;
    });
    if (!resting_.empty()) restLater();
}

void Reactor::doze() {
    for (Watcher* watcher : awake_)
        if (watcher->brought(true)) again(watcher);
    leaveAwake();
}

int Reactor::callGathered() {
    if (gathered_->count == 0) return 0;
    Batch batch;                        // those who are called may gather again
    batch.count = std::exchange(gathered_->count, 0);
    std::copy_n(gathered_->events, batch.count, batch.events);
    return callAll(batch);
}

int Reactor::callAll(Batch& batch) {
    CallContext::Fresh fresh;           // whatever is called has nothing to do with whoever waits here
    batch.outer = batches_;
    batches_ = &batch;
    turns_.fetch_add(1, std::memory_order_seq_cst);
    if (sleeper_.load(std::memory_order_seq_cst) >= 0) [[unlikely]] {
        int bell = sleeper_.exchange(-1);
        std::uint64_t one = 1;
        ssize_t ignored = bell >= 0 ? write(bell, &one, sizeof one) : 0;
        (void)ignored;
    }
    if (!unwatched_.empty() && !batch.outer) unwatched_.clear();
    const AtEnd leave([this] { batches_ = batches_->outer; });
    int called = 0;
    while (batch.at < batch.count) {
        epoll_event& e = batch.events[batch.at++];
        if (e.data.ptr == nullptr) {
            called += runTimers();
        } else if (e.data.ptr == this) {
            called += runPending();
        } else if (e.events != 0) {
            static_cast<Watcher*>(e.data.ptr)->ready(e.events);
            ++called;
        }
    }
    // Do now what these have left to do: its memory is at hand, and lines that are awake may not wait for descriptors for long.
    if (rung_.load(std::memory_order_acquire)) called += runPending();
    return called;
}

std::uint64_t Reactor::start(std::int64_t when, Callback callback) {
    std::uint64_t id = nextTimer_++;
    timers_.emplace(std::pair(when, id), std::move(callback));
    timerTimes_.emplace(id, when);
    armTimer();
    return id;
}

void Reactor::stop(std::uint64_t timer) {
    auto found = timerTimes_.find(timer);
    if (found == timerTimes_.end()) return;
    timers_.erase({found->second, timer});
    timerTimes_.erase(found);
}

void Reactor::watch(int fd, Callback readable) {
    unwatch(fd);
    auto watched = std::make_unique<Watched>(std::move(readable));
    add(fd, EPOLLIN, watched.get());
    watched_.emplace(fd, std::move(watched));
}

void Reactor::unwatch(int fd) {
    auto found = watched_.find(fd);
    if (found == watched_.end()) return;
    remove(fd, found->second.get());
    unwatched_.push_back(std::move(found->second));
    watched_.erase(found);
}

// The timer goes off when the first callback is due, or at limit (0: none), or earlier: then it is set again.
void Reactor::armTimer(std::int64_t limit) {
    std::int64_t wanted = timers_.empty() ? limit : timers_.begin()->first.first;
    if (limit != 0) wanted = std::min(wanted, limit);
    if (wanted == 0 || (armed_ != 0 && armed_ <= wanted)) return;
    armed_ = wanted;
    itimerspec spec{};
    spec.it_value.tv_sec = wanted / 1'000'000'000;
    spec.it_value.tv_nsec = wanted % 1'000'000'000;
    timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
}

int Reactor::runTimers() {
    std::uint64_t expired;
    if (read(timer_.get(), &expired, sizeof expired) < 0) return 0;
    int called = 0;
    std::int64_t now = monotonicNow();
    seen_ = now;
    armed_ = 0;
    while (!timers_.empty() && timers_.begin()->first.first <= now) {
        auto callback = std::move(timers_.begin()->second);
        timerTimes_.erase(timers_.begin()->first.second);
        timers_.erase(timers_.begin());
        callback();
        ++called;
    }
    armTimer();
    return called;
}

Descriptor raiseDescriptor(Descriptor fd) {
    static std::once_flag once;
    std::call_once(once, [] {
        rlimit limit;
        if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < limit.rlim_max) {
            limit.rlim_cur = limit.rlim_max;
            setrlimit(RLIMIT_NOFILE, &limit);
        }
    });
    if (!fd || fd.get() >= kSelectLimit) return fd;
    Descriptor high(fcntl(fd.get(), F_DUPFD_CLOEXEC, kSelectLimit));
    return high ? std::move(high) : std::move(fd);      // the hard limit is low; then there are few descriptors anyway
}

}  // namespace sorma
