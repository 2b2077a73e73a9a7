// The transport tcp: a port of a host, or a program that its rpcbind knows.

#include <linux/inet_diag.h>
#include <linux/netlink.h>
#include <linux/sock_diag.h>

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "bus/catalogue.h"
#include "comm/reactor.h"
#include "comm/rpcbind.h"
#include "comm/transport.h"

namespace sorma {

namespace {

const Prototype kHost{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: host \"{}\" is not known: {}"};
const Prototype kNotRegistered{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: rpcbind on {} knows no program 0x{} (0x20000000 + 0x{})"};
const Prototype kUnknownHost{Severity::error, "ADDRESS UNRESOLVED", 0, "host {} is not known: {}"};
const Prototype kUnknownProgram{Severity::error, "ADDRESS UNRESOLVED", 0, "rpcbind on {} knows no program {}"};

bool isProgram(const Address& address) { return address.kind == Address::Kind::program; }

bool mine(const Address& address) { return address.kind == Address::Kind::tcp || isProgram(address); }

// ---- addresses ----

using InfoList = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

// As getaddrinfo(3).
int infoOf(const std::string& host, const std::string& port, int flags, InfoList& found) {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = flags | AI_NUMERICSERV;
    addrinfo* list = nullptr;
    const int code = getaddrinfo(host.c_str(), port.empty() ? nullptr : port.c_str(), &hints, &list);
    found.reset(list);
    return code;
}

std::string bare(const std::string& host) {             // brackets of IPv6 go
    return host.size() > 2 && host.front() == '[' && host.back() == ']' ? host.substr(1, host.size() - 2) : host;
}

bool isLoopback(const std::string& host) { return host == "localhost" || host == "[::1]" || host.starts_with("127."); }

Transport::Found place(const Address& address) {
    unsigned char space[16];
    const std::string host = bare(address.host);
    const bool numeric = inet_pton(AF_INET, host.c_str(), space) == 1 || inet_pton(AF_INET6, host.c_str(), space) == 1;
    const bool known = !isProgram(address) && (numeric || isLoopback(address.host));
    return {known ? Transport::Found::State::known : Transport::Found::State::asks, address};
}

Address lookUp(const Address& address) {
    InfoList list(nullptr, freeaddrinfo);
    if (int code = infoOf(address.host, {}, 0, list)) fail(kUnknownHost, address.host, gai_strerror(code));
    Address found = address;
    char text[NI_MAXHOST];
    if (getnameinfo(list->ai_addr, list->ai_addrlen, text, sizeof text, nullptr, 0, NI_NUMERICHOST) == 0)
        found.host = list->ai_family == AF_INET6 ? "[" + std::string(text) + "]" : text;
    if (!isProgram(address)) return found;
    found.kind = Address::Kind::tcp;
    found.number = static_cast<std::uint32_t>(rpcbindLookup(address.host, address.number));
    if (found.number == 0) fail(kUnknownProgram, address.host, address.toText().substr(address.toText().rfind(':') + 1));
    return found;
}

std::string describeTcp(const Address& address) { return isProgram(address) ? address.toText() : address.host + ":" + std::to_string(address.number); }

bool leadsTo(const Address& address, const ListeningSocket& socket) {
    return socket.port > 0 && portOf(address) == socket.port && isLoopback(address.host);
}

// ---- the client ----

// The addresses of the host that were not tried yet.
struct Attempt : Line::Extra {
    InfoList list{nullptr, freeaddrinfo};
    addrinfo* next = nullptr;
    std::string where;
};

// Begin with the next address that does not refuse at once.   error: why the one before failed.
Line beginNext(std::unique_ptr<Attempt> attempt, const std::string& who, int error) {
    while (addrinfo* a = attempt->next) {
        attempt->next = a->ai_next;
        Descriptor s = newSocket(a->ai_family);
        if (!s) continue;
        tuneTcp(s.get(), false);
        if (connect(s.get(), a->ai_addr, a->ai_addrlen) == 0 || errno == EINPROGRESS)
            return {raiseDescriptor(std::move(s)), tcpTransport, std::move(attempt)};
        error = errno;
    }
    failConnect(who, attempt->where, error);
}

Line begin(const Address& address, const std::string& who) {
    int port = int(address.number);
    if (isProgram(address)) {
        port = rpcbindLookup(address.host, address.number);
        if (port == 0) fail(kNotRegistered, who, address.host, hex(0x20000000 + address.number), hex(address.number));
    }
    auto attempt = std::make_unique<Attempt>();
    attempt->where = address.host + ":" + std::to_string(port);
    const std::string host = bare(address.host), number = std::to_string(port);
    int code = infoOf(host, number, AI_NUMERICHOST, attempt->list);     // does not ask which interfaces there are
    if (code != 0) code = infoOf(host, number, AI_ADDRCONFIG, attempt->list);
    if (code != 0) code = infoOf(host, number, 0, attempt->list);       // without any interface but loopback, AI_ADDRCONFIG knows nothing
    if (code != 0) fail(kHost, who, address.host, gai_strerror(code));
    attempt->next = attempt->list.get();
    return beginNext(std::move(attempt), who, ECONNREFUSED);
}

bool finish(Line& line, const std::string& who) {
    std::unique_ptr<Attempt> attempt(static_cast<Attempt*>(line.extra.release()));
    if (const int error = pendingError(line.descriptor())) {
        line = Line(beginNext(std::move(attempt), who, error), line.row());
        return false;
    }
    makeBlocking(line.descriptor(), true);
    return true;
}

// ---- the server ----

ListeningSocket listen(const std::string& host, int port, bool) {
    const std::string where = host + ":" + std::to_string(port);
    InfoList list(nullptr, freeaddrinfo);
    if (int code = infoOf(host, std::to_string(port), AI_PASSIVE, list)) failListen(where, gai_strerror(code));
    Descriptor s = newSocket(list->ai_family);
    if (!s) failListen(where, std::strerror(errno));
    int on = 1;
    setsockopt(s.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    tuneTcp(s.get(), true);                             // lines that are accepted inherit it
    if (bind(s.get(), list->ai_addr, list->ai_addrlen) < 0) {
        if (errno == EADDRINUSE) failTaken(where, "another process");
        failListen(where, std::strerror(errno));
    }
    if (::listen(s.get(), SOMAXCONN) < 0) failListen(where, std::strerror(errno));
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    getsockname(s.get(), reinterpret_cast<sockaddr*>(&bound), &size);
    const auto number = bound.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(bound).sin6_port : reinterpret_cast<sockaddr_in&>(bound).sin_port;
    return {raiseDescriptor(std::move(s)), &tcpTransport, {}, ntohs(number)};
}

Line accept(int fd) {
    Descriptor came(accept4(fd, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!came) return {};
    return {raiseDescriptor(std::move(came)), tcpTransport};
}

// One end of a TCP connection; IPv4 as ::ffff:a.b.c.d.
struct End {
    Principal::Address address{};
    std::uint16_t port = 0;             // network order
    bool four() const { return Principal::isIPv4(address); }
    bool loopback() const {
        static const Principal::Address one = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
        return four() ? address[12] == 127 : address == one;
    }
};

End endOf(const sockaddr_storage& from) {
    End end;
    if (from.ss_family == AF_INET6) {
        auto& six = reinterpret_cast<const sockaddr_in6&>(from);
        std::memcpy(end.address.data(), &six.sin6_addr, 16);
        end.port = six.sin6_port;
    } else {
        auto& four = reinterpret_cast<const sockaddr_in&>(from);
        end.address = Principal::fromIPv4(&four.sin_addr);
        end.port = four.sin_port;
    }
    return end;
}

// Whose socket is at that end of a connection? False: the kernel does not say. A socket that has been closed meanwhile is
// shown as root's, without an inode: that is no answer either.
bool ownerOf(const End& peer, const End& ours, uid_t& uid) {
    const Descriptor netlink(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_SOCK_DIAG));
    const int fd = netlink.get();
    if (fd < 0) return false;
    struct {
        nlmsghdr header;
        inet_diag_req_v2 request;
    } question{};
    question.header.nlmsg_len = sizeof question;
    question.header.nlmsg_type = SOCK_DIAG_BY_FAMILY;
    question.header.nlmsg_flags = NLM_F_REQUEST;
    auto& r = question.request;
    const bool four = peer.four();
    const std::size_t skip = four ? 12 : 0;
    r.sdiag_family = four ? AF_INET : AF_INET6;
    r.sdiag_protocol = IPPROTO_TCP;
    r.idiag_states = ~0u;
    r.id.idiag_sport = peer.port;
    r.id.idiag_dport = ours.port;
    std::memcpy(r.id.idiag_src, peer.address.data() + skip, 16 - skip);
    std::memcpy(r.id.idiag_dst, ours.address.data() + skip, 16 - skip);
    r.id.idiag_cookie[0] = r.id.idiag_cookie[1] = INET_DIAG_NOCOOKIE;
    if (send(fd, &question, sizeof question, MSG_DONTWAIT) != ssize_t(sizeof question)) return false;
    alignas(nlmsghdr) char answer[4096];
    ssize_t n = recv(fd, answer, sizeof answer, MSG_DONTWAIT);      // the kernel has answered within send()
    auto* header = reinterpret_cast<const nlmsghdr*>(answer);
    if (n < ssize_t(NLMSG_LENGTH(sizeof(inet_diag_msg))) || header->nlmsg_type != SOCK_DIAG_BY_FAMILY) return false;
    auto* found = static_cast<const inet_diag_msg*>(NLMSG_DATA(header));
    bool same = found->id.idiag_sport == peer.port && found->id.idiag_dport == ours.port;
    if (!same || found->idiag_inode == 0 || found->idiag_uid == overflowUser()) return false;
    uid = found->idiag_uid;
    return true;
}

// From this host, by whatever address: the user who owns the other socket, which the kernel is asked for. From another host: its address.
Identity identify(const Line& line) {
    Identity out;
    sockaddr_storage from{}, to{};
    socklen_t size = sizeof from;
    if (getpeername(line.descriptor(), reinterpret_cast<sockaddr*>(&from), &size) != 0) {
        out.caller.address = "?";
        out.principal = Principal::anyone();
        out.gone = true;
        return out;
    }
    size = sizeof to;
    getsockname(line.descriptor(), reinterpret_cast<sockaddr*>(&to), &size);
    End peer = endOf(from), ours = endOf(to);
    out.caller.known = Principal::toText(peer.address);
    out.caller.address = out.caller.known + ":" + std::to_string(ntohs(peer.port));
    uid_t uid = 0;
    if (ownerOf(peer, ours, uid)) {
        out.principal = Principal::local(uid, peer.address);
        out.caller.known = userName(uid) + "@" + out.caller.known;
    } else if (peer.loopback() || peer.address == ours.address) {
        out.principal = Principal::anyone(peer.address);
    } else {
        out.principal = Principal::host(peer.address);
    }
    return out;
}

}  // namespace

void tuneTcp(int fd, bool accepted) {
    constexpr int kRtoMaxMs = 44;                       // TCP_RTO_MAX_MS, since Linux 6.15; older kernels refuse it
    auto set = [fd](int level, int option, int value) { setsockopt(fd, level, option, &value, sizeof value); };
    set(IPPROTO_TCP, TCP_NODELAY, 1);
    // After a pause of the net what is lost is sent again each second, not after as long as the pause was.
    set(IPPROTO_TCP, kRtoMaxMs, 1000);                  // [ms]
    // The kernel asks the other one after 30 s of silence, and each 10 s from then on. After three questions without an answer it gives up.
    set(SOL_SOCKET, SO_KEEPALIVE, 1);
    set(IPPROTO_TCP, TCP_KEEPIDLE, 30);                 // [s]
    set(IPPROTO_TCP, TCP_KEEPINTVL, 10);                // [s]
    set(IPPROTO_TCP, TCP_KEEPCNT, 3);
    // It asks nothing while bytes wait to be confirmed, so that has a limit of its own, also when the other end just reads nothing. A client's
    // bytes may wait longer, for a daemon that is busy.
    if (accepted) set(IPPROTO_TCP, TCP_USER_TIMEOUT, 60'000);      // [ms]
}

constexpr Transport tcpTransport{"tcp", false, mine, place, lookUp, describeTcp, leadsTo, begin, finish, readSocket, writeSocket, peekSocket, identify, listen, accept};

}  // namespace sorma
