#include "comm/transport.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "bus/catalogue.h"
#include "comm/errors.h"

namespace sorma {

namespace {

using Kind = Address::Kind;

const Prototype kListen{Severity::error, "COMM REFUSED", 1, "cannot listen on {}: {}"};
const Prototype kTaken{Severity::error, "COMM REFUSED", 1, "{} is served already by {}; this is {}; end that one or choose another name"};

// One line for each row to which addresses lead.
std::vector<const Transport*>& rows() {
    static std::vector<const Transport*> all{
        &unixTransport,
        &tcpTransport,
    };
    return all;
}

}  // namespace

constexpr Transport noTransport{};

ssize_t Line::peek(char* room, std::size_t size) {
    errno = EAGAIN;
    return row_->peek ? row_->peek(*this, room, size) : -1;
}

std::uint32_t Line::means(std::uint32_t events) const {
    if (events == 0) return EPOLLIN;
    return row_->wants ? events | EPOLLIN | EPOLLOUT : events;
}

std::uint32_t Line::wait(std::uint32_t events, int milliseconds) const {
    if ((events & EPOLLIN) && (pending() || brought(true))) return EPOLLIN;
    pollfd p{descriptor(), short(wants(events)), 0};
    return poll(&p, 1, milliseconds) > 0 ? means(std::uint32_t(p.revents)) : 0;
}

bool isHere(const Address& address) { return address.kind == Kind::self; }

const Transport& transportOf(const Address& address) {
    return **std::find_if(rows().begin(), rows().end(), [&](auto* row) { return row->mine(address); });
}

const Transport& sharing(const Transport& row) { return &row == &unixTransport ? offeringTransport : row; }

void addTransport(const Transport& row) { rows().insert(rows().begin(), &row); }

std::string describe(const Address& address) { return isHere(address) ? address.toText() : transportOf(address).describe(address); }
std::string pathOf(const Address& address) { return address.kind == Kind::path ? address.host : std::string(); }
std::string hostOf(const Address& address) { return address.kind == Kind::tcp || address.kind == Kind::program ? address.host : std::string(); }
int portOf(const Address& address) { return address.kind == Kind::tcp ? int(address.number) : 0; }
Address addressOf(const std::string& path) { return {Kind::path, path, 0}; }
Address addressOf(const std::string& host, int port) { return {Kind::tcp, host, static_cast<std::uint32_t>(port)}; }
std::uint32_t programOf(const Address& address) { return address.kind == Kind::program ? address.number : 0; }

void failConnect(const std::string& who, const std::string& where, int error) {
    if (error == ETIMEDOUT) fail(errors::kConnectTimeout, who, where);
    const char* hint = error == ECONNREFUSED || error == ENOENT ? "no daemon listens there; is it started?"
                       : error == EACCES                        ? "it belongs to another user"
                       : error == EAGAIN                        ? "it has more connections waiting than it accepts"
                                                                : "check the network";
    fail(errors::kRefused, who, where, std::strerror(error), hint);
}

void failListen(const std::string& where, const std::string& why) { fail(kListen, where, why); }
void failTaken(const std::string& where, const std::string& by) { fail(kTaken, where, by, Caller::self().toText()); }

void makeBlocking(int fd, bool blocking) {
    int flags = fcntl(fd, F_GETFL);
    fcntl(fd, F_SETFL, blocking ? flags & ~O_NONBLOCK : flags | O_NONBLOCK);
}

Descriptor newSocket(int family) { return Descriptor(socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)); }

int pendingError(int fd) {
    int error = 0;
    socklen_t length = sizeof error;
    getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length);
    return error;
}

uid_t overflowUser() {
    static const uid_t uid = [] {
        unsigned value = 65534;
        std::ifstream("/proc/sys/kernel/overflowuid") >> value;
        return uid_t(value);
    }();
    return uid;
}

// The socket's own timeout is the limit, so that waiting costs no poll. It is set again only when it is longer: a shorter one
// just makes the caller look again.
ssize_t readSocket(Line& line, char* room, std::size_t size, std::int64_t wait) {
    if (wait == 0) return recv(line.descriptor(), room, size, MSG_DONTWAIT);
    if (line.patience == 0 || line.patience > wait) {
        constexpr std::int64_t kLeast = 1'000'000, kMost = 3'600'000'000'000;
        wait = std::clamp(wait, kLeast, kMost);
        timeval t{wait / 1'000'000'000, wait % 1'000'000'000 / 1000};
        setsockopt(line.descriptor(), SOL_SOCKET, SO_RCVTIMEO, &t, sizeof t);
        line.patience = wait;
    }
    ssize_t n = recv(line.descriptor(), room, size, 0);
    if (n < 0 && errno == EINTR) errno = EAGAIN;
    if (n < 0 && errno == EAGAIN) line.patience = 0;    // the next wait may be longer
    return n;
}

ssize_t writeSocket(Line& line, const char* data, std::size_t size) {
    return send(line.descriptor(), data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
}

ssize_t peekSocket(Line& line, char* room, std::size_t size) {
    return recv(line.descriptor(), room, size, MSG_PEEK | MSG_DONTWAIT);
}

}  // namespace sorma
