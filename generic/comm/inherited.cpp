// The transport inherited: a socket that another program has opened for us (socket activation, inetd). We serve a copy of it. Its
// connections have the row of its family.

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>

#include "bus/catalogue.h"
#include "comm/reactor.h"
#include "comm/transport.h"

namespace sorma {

namespace {

const Prototype kInherited{Severity::error, "COMM REFUSED", 1, "descriptor {} must be {}, but it is {}"};

// Copy the descriptor. It must be a stream that listens (listener), or one that is connected.
ListeningSocket inherit(int fd, bool listener) {
    const char* wanted = listener ? "a socket that listens" : "a connection";
    auto property = [&](int which, const char* otherwise) {
        int value = 0;
        socklen_t size = sizeof value;
        if (getsockopt(fd, SOL_SOCKET, which, &value, &size) < 0)
            fail(kInherited, fd, wanted, errno == EBADF ? "not open" : errno == ENOTSOCK ? "no socket" : otherwise);
        return value;
    };
    int domain = property(SO_DOMAIN, "of no known kind");
    if (domain != AF_UNIX && domain != AF_INET && domain != AF_INET6) fail(kInherited, fd, wanted, "neither of TCP nor of the Unix domain");
    if (property(SO_TYPE, "of no known kind") != SOCK_STREAM) fail(kInherited, fd, wanted, "no stream");
    bool listens = property(SO_ACCEPTCONN, "of no known kind");
    sockaddr_storage peer{}, own{};
    socklen_t size = sizeof peer;
    if (listener && !listens) fail(kInherited, fd, wanted, "a connection, or not yet either; one connection is served by sormad -inetd");
    if (!listener && listens) fail(kInherited, fd, wanted, "a socket that listens");
    if (!listener && getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &size) < 0) fail(kInherited, fd, wanted, "not connected");
    size = sizeof own;
    getsockname(fd, reinterpret_cast<sockaddr*>(&own), &size);
    ListeningSocket found{Descriptor(), domain == AF_UNIX ? &unixTransport : &tcpTransport, {}, 0};
    if (domain == AF_INET) found.port = ntohs(reinterpret_cast<sockaddr_in&>(own).sin_port);
    else if (domain == AF_INET6) found.port = ntohs(reinterpret_cast<sockaddr_in6&>(own).sin6_port);
    else if (size > offsetof(sockaddr_un, sun_path)) {
        auto& a = reinterpret_cast<sockaddr_un&>(own);
        found.path.assign(a.sun_path, size - offsetof(sockaddr_un, sun_path));
        if (found.path[0] == 0) found.path[0] = '@';
        else found.path.resize(std::strlen(found.path.c_str()));
    }
    Descriptor copy(fcntl(fd, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
    if (!copy) failListen("descriptor " + std::to_string(fd), std::strerror(errno));
    makeBlocking(copy.get(), false);
    found.fd = raiseDescriptor(std::move(copy));
    return found;
}

ListeningSocket listen(const std::string&, int fd, bool) { return inherit(fd, true); }

Line accept(int fd) {
    ListeningSocket found = inherit(fd, false);
    if (!found.row->vouched) tuneTcp(found.fd.get(), true);
    return {std::move(found.fd), found.row == &unixTransport ? offeredTransport : *found.row};
}

}  // namespace

constexpr Transport inheritedTransport{"inherited", false, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, readSocket, writeSocket, peekSocket,
                                       nullptr, listen, accept};

}  // namespace sorma
