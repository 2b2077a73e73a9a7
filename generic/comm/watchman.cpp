#include "comm/watchman.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace sorma {

namespace {

constexpr int kPatience = 50;       // [ms] that requests may wait before we look

}  // namespace

Watchman::Watchman(Reactor& reactor, Gate& gate, Look look) : reactor_(reactor), gate_(gate), look_(std::move(look)) {
    stop_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (stop_ < 0) throw std::system_error(errno, std::generic_category(), "cannot start the watchman");
    // Signals are for the program's own threads.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    thread_ = std::thread([this] { watch(); });
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

Watchman::~Watchman() {
    std::uint64_t one = 1;
    ssize_t ignored = write(stop_, &one, sizeof one);
    (void)ignored;
    thread_.join();
    close(stop_);
}

void Watchman::watch() {
    // The reactor's set is itself a descriptor that can be read when anything in it can. Asked for once at a time, so
    // that a busy daemon wakes us twenty times a second, and an idle one never.
    pollfd waits[] = {{stop_, POLLIN, 0}, {reactor_.descriptor(), POLLIN, 0}};
    for (;;) {
        if (poll(waits, 2, -1) < 0 && errno != EINTR) return;
        if (waits[0].revents) return;
        if (!waits[1].revents) continue;
        std::uint64_t turns = reactor_.turns();
        if (poll(waits, 1, kPatience) > 0) return;
        if (reactor_.turns() != turns) continue;
        pollfd still{reactor_.descriptor(), POLLIN, 0};
        if (poll(&still, 1, 0) <= 0) continue;
        epoll_event events[64];
        int n = epoll_wait(reactor_.descriptor(), events, 64, 0);
        std::vector<void*> waiting;
        for (int i = 0; i < n; ++i) waiting.push_back(events[i].data.ptr);
        if (waiting.empty() || !gate_.tryWatch()) continue;
        look_(waiting);
        gate_.endWatch();
    }
}

}  // namespace sorma
