#include "comm/acceptor.h"

#include <fcntl.h>
#include <sys/epoll.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace sorma {

namespace {

constexpr int kBatch = 64;                              // connections in one turn, at most
constexpr std::int64_t kPause = 250'000'000;            // [ns] without descriptors

Descriptor openSpare() { return Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)); }
bool scarce(int error) { return error == EMFILE || error == ENFILE; }

}  // namespace

class Acceptor::Listener : public Reactor::Watcher {
public:
    Listener(Acceptor& acceptor, ListeningSocket what) : socket(std::move(what)), acceptor_(acceptor) {
        acceptor_.reactor_.add(socket.fd.get(), EPOLLIN, this);
    }
    ~Listener() override { acceptor_.reactor_.remove(socket.fd.get(), this); }
    void ready(std::uint32_t) override {
        ServerLock::Held held(acceptor_.lock_);
        acceptor_.take(*this);
    }
    Line accept() { return socket.row->accept(socket.fd.get()); }
    const ListeningSocket socket;

private:
    Acceptor& acceptor_;
};

Acceptor::Acceptor(Reactor& reactor, ServerLock& lock, std::function<void(Line line, bool scarce)> came)
    : reactor_(reactor), lock_(lock), came_(std::move(came)), spare_(openSpare()) {}

Acceptor::~Acceptor() { close(); }

void Acceptor::add(ListeningSocket socket) { listeners_.push_back(std::make_unique<Listener>(*this, std::move(socket))); }

void Acceptor::close() {
    pause_.cancel();
    listeners_.clear();
    spare_.close();
}

bool Acceptor::at(const Address& address) const {
    auto& row = transportOf(address);
    return std::any_of(listeners_.begin(), listeners_.end(), [&](auto& listener) { return row.leadsTo(address, listener->socket); });
}

void Acceptor::take(Listener& listener) {
    reactor_.seen(monotonicNow());
    for (int i = 0; i < kBatch; ++i) {
        Line line = listener.accept();
        const bool last = !line.open() && scarce(errno) && spare_;
        if (last) {
            spare_.close();
            line = listener.accept();
        }
        const int error = errno;
        const bool came = line.open();
        if (came) came_(std::move(line), last);
        if (last) spare_ = openSpare();
        if (came) continue;
        if (!scarce(error)) return;
        // Other code of this process has taken the spare one, too. Connections wait in the backlog; look again later, do not spin.
        Listener* waiting = &listener;
        reactor_.change(listener.socket.fd.get(), 0, waiting);
        pause_ = reactor_.after(monotonicNow() + kPause, [this, waiting] {
            if (!spare_) spare_ = openSpare();
            for (auto& l : listeners_)
                if (l.get() == waiting) reactor_.change(l->socket.fd.get(), EPOLLIN, waiting);
        });
        return;
    }
}

void Acceptor::takeWaiting(const std::vector<void*>& watchers, const std::function<bool(bool vouched)>& room) {
    for (auto& listener : listeners_) {
        if (std::find(watchers.begin(), watchers.end(), static_cast<Reactor::Watcher*>(listener.get())) == watchers.end()) continue;
        while (room(listener->socket.row->vouched)) {
            Line line = listener->accept();
            if (!line.open()) break;
            came_(std::move(line), false);
        }
    }
}

}  // namespace sorma
