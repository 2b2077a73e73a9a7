#include "comm/identity.h"

#include <arpa/inet.h>
#include <linux/inet_diag.h>
#include <linux/netlink.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

namespace sorma {

namespace {

constexpr unsigned char kMapped[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

// One end of a TCP connection; IPv4 as ::ffff:a.b.c.d.
struct End {
    Principal::Address address{};
    std::uint16_t port = 0;             // network order
    bool four() const { return std::memcmp(address.data(), kMapped, sizeof kMapped) == 0; }
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
        std::memcpy(end.address.data(), kMapped, sizeof kMapped);
        std::memcpy(end.address.data() + sizeof kMapped, &four.sin_addr, 4);
        end.port = four.sin_port;
    }
    return end;
}

// The user as whom the kernel shows those that a namespace does not know: nobody in particular.
uid_t overflowUser() {
    static const uid_t uid = [] {
        unsigned value = 65534;
        std::ifstream("/proc/sys/kernel/overflowuid") >> value;
        return uid_t(value);
    }();
    return uid;
}

// Whose socket is at that end of a connection? False: the kernel does not say. A socket that has been closed meanwhile is
// shown as root's, without an inode: that is no answer either.
bool ownerOf(const End& peer, const End& ours, uid_t& uid) {
    int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_SOCK_DIAG);
    if (fd < 0) return false;
    struct Closer {
        int fd;
        ~Closer() { close(fd); }
    } closer{fd};
    struct {
        nlmsghdr header;
        inet_diag_req_v2 request;
    } question{};
    question.header.nlmsg_len = sizeof question;
    question.header.nlmsg_type = SOCK_DIAG_BY_FAMILY;
    question.header.nlmsg_flags = NLM_F_REQUEST;
    auto& r = question.request;
    const bool four = peer.four();
    const std::size_t skip = four ? sizeof kMapped : 0;
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

std::vector<gid_t> groupsOf(int fd, gid_t first) {
    std::vector<gid_t> groups(64);
    socklen_t size = socklen_t(groups.size() * sizeof(gid_t));
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) {
        groups.resize(size / sizeof(gid_t));
        if (errno != ERANGE || getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) size = 0;
    }
    groups.resize(size / sizeof(gid_t));
    groups.push_back(first);
    return groups;
}

}  // namespace

Identity identify(int fd, bool tcp) {
    Identity out;
    if (!tcp) {
        ucred credentials{};
        socklen_t length = sizeof credentials;
        out.caller.address = "unix";
        out.caller.host = Caller::self().host;
        if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &credentials, &length) != 0 || credentials.uid == overflowUser()) {
            out.caller.user = "nobody";
            out.principal = Principal::anyone();
            return out;
        }
        out.caller.user = userName(credentials.uid);
        out.caller.process = credentials.pid;
        out.principal = Principal::user(credentials.uid, groupsOf(fd, credentials.gid));
        return out;
    }
    sockaddr_storage from{}, to{};
    socklen_t size = sizeof from;
    if (getpeername(fd, reinterpret_cast<sockaddr*>(&from), &size) != 0) {
        out.caller.address = "?";
        out.principal = Principal::anyone();
        return out;
    }
    size = sizeof to;
    getsockname(fd, reinterpret_cast<sockaddr*>(&to), &size);
    End peer = endOf(from), ours = endOf(to);
    out.caller.known = Principal::toText(peer.address);
    out.caller.address = out.caller.known + ":" + std::to_string(ntohs(peer.port));
    uid_t uid = 0;
    if (!peer.loopback()) {
        out.principal = Principal::host(peer.address);
    } else if (ownerOf(peer, ours, uid)) {
        out.principal = Principal::local(uid, peer.address);
        out.caller.known = userName(uid) + "@" + out.caller.known;
    } else {
        out.principal = Principal::anyone(peer.address);
    }
    return out;
}

}  // namespace sorma
