#include "comm/healthResponder.h"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "bus/signalsBlocked.h"

namespace sorma {

namespace {

constexpr int kPatience = 50;       // [ms] that requests may wait before we look

}  // namespace

HealthResponder::HealthResponder(Reactor& reactor, ServerLock& lock, Look look) : reactor_(reactor), lock_(lock), look_(std::move(look)) {
    bell_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (bell_ < 0) throw std::system_error(errno, std::generic_category(), "cannot start the health responder");
    SignalsBlocked blocked;
    thread_ = std::thread([this] { watch(); });
}

HealthResponder::~HealthResponder() {
    ended_ = true;
    std::uint64_t one = 1;
    ssize_t ignored = write(bell_, &one, sizeof one);
    (void)ignored;
    thread_.join();
    reactor_.setSleeper(-1);
    close(bell_);
}

void HealthResponder::watch() {
    // The reactor's epoll set is a descriptor that can be read while one of its descriptors has events.
    pollfd waits[] = {{bell_, POLLIN, 0}, {reactor_.descriptor(), POLLIN, 0}};
    auto waitFor = [&](int descriptors, int milliseconds) {
        if (poll(waits, nfds_t(descriptors), milliseconds) <= 0) return;
        std::uint64_t rung;
        ssize_t ignored = waits[0].revents ? read(bell_, &rung, sizeof rung) : 0;
        (void)ignored;
    };
    std::uint64_t turns = reactor_.turns();
    while (!ended_) {
        waitFor(1, kPatience);
        std::uint64_t now = reactor_.turns();
        if (ended_ || now != std::exchange(turns, now)) continue;       // the reactor makes turns, so there is nothing to do
        epoll_event events[64];
        int n = epoll_wait(reactor_.descriptor(), events, 64, 0);
        std::vector<void*> waiting;
        for (int i = 0; i < n; ++i) {
            void* watcher = events[i].data.ptr;     // epoll_event is packed: no reference to its parts
            waiting.push_back(watcher);
        }
        bool busy = true;
        if (lock_.tryLook()) {
            busy = look_(waiting);
            lock_.endLook();
        }
        if (busy || !waiting.empty()) continue;
        reactor_.setSleeper(bell_);
        if (reactor_.turns() == turns) waitFor(2, -1);
        reactor_.setSleeper(-1);
    }
}

}  // namespace sorma
