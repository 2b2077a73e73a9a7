#include "comm/lookout.h"

#include <linux/futex.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <mutex>
#include <system_error>
#include <unordered_map>

#include "bus/deadline.h"
#include "bus/descriptor.h"
#include "bus/detached.h"
#include "comm/reactor.h"

namespace sorma {

// One a process, for ever; a process that was forked makes its own. Its epoll set forgets a socket when that is closed. The numbers of
// dozers are never used again, so a late event finds nobody.
class Lookout {
public:
    static Lookout& get() {
        static std::atomic<Lookout*> one{nullptr};
        static const int known = pthread_atfork(nullptr, nullptr, [] { one = nullptr; });      // its thread is not in the child
        (void)known;
        Lookout* found = one;
        if (found) return *found;
        auto made = std::make_unique<Lookout>();
        return one.compare_exchange_strong(found, made.get()) ? *made.release() : *found;
    }
    Lookout() : epoll_(epoll_create1(EPOLL_CLOEXEC)), bell_(raiseDescriptor(Descriptor(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)))) {
        if (!epoll_ || !bell_) throw std::system_error(errno, std::generic_category(), "cannot wait for the end of lines");
        watch(bell_.get(), EPOLLIN, 0);
    }
    std::uint64_t add(Dozer& dozer, int socket) {
        std::lock_guard guard(mutex_);
        if (!running_) {
            startDetached([this] { run(); });
            running_ = true;
        }
        const std::uint64_t number = ++last_;
        watch(socket, EPOLLRDHUP | EPOLLET, number);
        dozers_.emplace(number, &dozer);
        return number;
    }
    void remove(std::uint64_t number) {
        std::lock_guard guard(mutex_);
        dozers_.erase(number);
    }
    // Somebody waits until then. He has said so before: either scan() sees him, or he sees what it has armed.
    void keep(std::int64_t until) {
        if (until >= armed_.load(std::memory_order_seq_cst)) [[likely]] return;
        const std::uint64_t one = 1;
        ssize_t ignored = write(bell_.get(), &one, sizeof one);
        (void)ignored;
    }

private:
    static constexpr std::int64_t kNever = INT64_MAX;

    void watch(int fd, std::uint32_t events, std::uint64_t number) {
        epoll_event e{};
        e.events = events;
        e.data.u64 = number;
        if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &e) < 0) throw std::system_error(errno, std::generic_category(), "cannot wait for the end of a line");
    }
    // Call those whose time is over. Returns when the first one of the others is.
    std::int64_t scan(std::int64_t now) {
        std::lock_guard guard(mutex_);
        std::int64_t first = kNever;
        for (auto& [number, dozer] : dozers_) {
            std::int64_t until = dozer->until_.load(std::memory_order_seq_cst);
            if (until == 0) continue;
            if (until > now) first = std::min(first, until);
            else if (dozer->until_.compare_exchange_strong(until, 0)) dozer->call();
        }
        return first;
    }
    void run() {
        for (;;) {
            const std::int64_t now = monotonicNow();
            std::int64_t first = kNever, next = scan(now);
            do armed_.store(first = next, std::memory_order_seq_cst);
            while ((next = scan(now)) < first);
            constexpr std::int64_t kLongest = 3'600'000'000'000;
            epoll_event events[64];
            const int n = epoll_wait(epoll_.get(), events, 64, first == kNever ? -1 : int((std::min(first - now, kLongest) + 999'999) / 1'000'000));
            std::lock_guard guard(mutex_);
            for (int i = 0; i < n; ++i) {
                std::uint64_t number = events[i].data.u64, rung;
                if (number == 0 && read(bell_.get(), &rung, sizeof rung) < 0) continue;
                if (auto found = dozers_.find(number); found != dozers_.end()) found->second->ended_ = true, found->second->call();
            }
        }
    }

    const Descriptor epoll_, bell_;
    std::mutex mutex_;
    std::unordered_map<std::uint64_t, Dozer*> dozers_;
    std::uint64_t last_ = 0;            // 0 is the bell
    bool running_ = false;
    std::atomic<std::int64_t> armed_{kNever};
};

Dozer::Dozer(int socket, Mark& mark) : lookout_(Lookout::get()), mark_(mark), number_(lookout_.add(*this, socket)) {}

Dozer::~Dozer() { lookout_.remove(number_); }

void Dozer::begin(std::int64_t until) {
    called_.store(false, std::memory_order_relaxed);
    until_.store(until, std::memory_order_seq_cst);     // before armed is read
    lookout_.keep(until);
}

// A dozer looks at called_ after it has set its mark. So it sees it, or the mark is taken away here. The mark is not asked: the other process
// may have written there.
void Dozer::call() {
    called_.store(true, std::memory_order_seq_cst);
    mark_.exchange(0);
    syscall(SYS_futex, &mark_, FUTEX_WAKE, 1, nullptr, nullptr, 0);
}

}  // namespace sorma
