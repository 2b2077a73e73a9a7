// The transport unix: a socket in the file system.

#include <fcntl.h>
#include <sys/file.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

#include "bus/catalogue.h"
#include "bus/deadline.h"
#include "bus/nearest.h"
#include "comm/errors.h"
#include "comm/reactor.h"
#include "comm/runtimeFolder.h"
#include "comm/transport.h"

namespace sorma {

namespace {

// Why a daemon's name leads nowhere.
std::string nobodyListens(const std::string& name, const std::string& path) {
    const auto known = namesIn(path.substr(0, path.rfind('/')), kSocketEnding);
    return "the dictionary has no entry @" + name + didYouMean(name, known) + ", and no daemon of this user listens on " + path;
}

const Prototype kPath{Severity::error, "NAME SYNTAX", 1, "socket path {} has {} bytes, a Unix-domain socket takes at most {}"};
const Prototype kLocked{Severity::error, "COMM REFUSED", 1,
    "cannot listen on {}: another process has had the lock on its folder {} for {} s; end that one (lslocks shows it), or choose a "
    "folder of your own"};

bool isAlias(const Address& address) { return address.kind == Address::Kind::alias; }

bool mine(const Address& address) { return address.kind == Address::Kind::path || isAlias(address); }

std::string where(const Address& address) { return isAlias(address) ? runtimeSocket(address.host) : address.host; }

void needShort(const std::string& path) {
    constexpr std::size_t kMost = sizeof(sockaddr_un::sun_path) - 1;
    if (path.size() > kMost) fail(kPath, path, path.size(), kMost);
}

// call: connect(2) or bind(2). A Unix-domain socket is connected at once, or not at all.
int at(const std::string& path, int (*call)(int, const sockaddr*, socklen_t), int fd) {
    sockaddr_un a{};
    a.sun_family = AF_UNIX;
    needShort(path);
    std::memcpy(a.sun_path, path.c_str(), path.size() + 1);
    return call(fd, reinterpret_cast<sockaddr*>(&a), sizeof a);
}

bool peerOf(int fd, ucred& who) {
    socklen_t size = sizeof who;
    return getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0;
}

// The process at the other end, as the kernel knows it.
std::string listenerOf(int fd) {
    ucred who{};
    if (!peerOf(fd, who)) return "another process";
    Caller caller;
    caller.process = who.pid;
    caller.host = Caller::self().host;
    caller.user = userName(who.uid);
    std::ifstream program("/proc/" + std::to_string(who.pid) + "/comm");
    std::getline(program, caller.program);
    return "a live daemon, " + caller.toText();
}

// Take the lock on a folder. Any process that may read the folder can take it and keep it, so waiting for it has a limit.
void takeTurn(int folder, const std::string& name, const std::string& path) {
    constexpr std::int64_t kPatience = 3000;            // [ms] several times what a start needs
    for (Deadline deadline = Deadline::in(kPatience); flock(folder, LOCK_EX | LOCK_NB) < 0; poll(nullptr, 0, 10)) {
        if (errno != EWOULDBLOCK && errno != EINTR) failListen(path, std::strerror(errno));
        if (deadline.passed()) fail(kLocked, path, name, kPatience / 1000);
    }
}

// Remove the files of a daemon that died: its socket, and its .tcp file (siblings.h).
bool removeDead(const std::string& path) {
    if (path.ends_with(kSocketEnding)) unlink((path.substr(0, path.size() - kSocketEnding.size()) + ".tcp").c_str());
    return unlink(path.c_str()) == 0;
}

Transport::Found place(const Address& address) {
    using State = Transport::Found::State;
    if (!isAlias(address)) return {State::known, address};
    try {
        const std::string path = where(address);
        const Address target{Address::Kind::path, path, 0, address.wait};
        if (access(path.c_str(), F_OK) == 0) return {State::known, target};
        return {State::absent, target, nobodyListens(address.host, path)};
    } catch (const Error& e) {
        return {State::absent, address, e.what()};
    }
}

Address lookUp(const Address& address) { return place(address).target; }

bool leadsTo(const Address& address, const ListeningSocket& socket) { return !socket.path.empty() && place(address).target.host == socket.path; }

// Between bind and listen a daemon looks dead, but it has the lock on its folder until it listens. Returns as connect does.
int reach(const std::string& path, int fd) {
    if (at(path, connect, fd) == 0) return 0;
    if (errno != ECONNREFUSED) return -1;
    const Descriptor lock(open(path.substr(0, path.rfind('/') + 1).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    for (int ms = 0; ms < 50 && lock && flock(lock.get(), LOCK_SH | LOCK_NB) < 0; ++ms) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return at(path, connect, fd);
}

Line begin(const Address& address, const std::string& who) {
    const std::string path = where(address);
    Descriptor s = newSocket(AF_UNIX);
    if (!s || reach(path, s.get()) < 0) {
        if (errno == ENOENT && isAlias(address)) fail(errors::kUnresolved, who, nobodyListens(address.host, path));
        failConnect(who, path, errno);
    }
    return {raiseDescriptor(std::move(s)), unixTransport};
}

bool finish(Line& line, const std::string&) {
    makeBlocking(line.descriptor(), true);
    return true;
}

// The socket file of a daemon that died is removed. When a live one answers, that one stays.
ListeningSocket listen(const std::string& path, int, bool share) {
    needShort(path);
    auto slash = path.rfind('/');
    std::string folder = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
    // Two daemons that start at the same moment must not each remove the other's socket.
    const Descriptor lock(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock) failListen(path, std::strerror(errno));
    takeTurn(lock.get(), folder, path);
    struct stat found;
    if (lstat(path.c_str(), &found) == 0) {
        if (!S_ISSOCK(found.st_mode)) failListen(path, "there is a file of that name which is no socket");
        const Descriptor probe = newSocket(AF_UNIX);
        const int error = at(path, connect, probe.get()) == 0 ? 0 : errno;
        if (error == 0) failTaken(path, listenerOf(probe.get()));
        if (error == EAGAIN) failTaken(path, "a busy daemon");
        if (error == EACCES) failListen(path, "it belongs to another user");
        removeDead(path);
    }
    Descriptor s = newSocket(AF_UNIX);
    mode_t mask = umask(0077);
    int failed = at(path, bind, s.get()) < 0 ? errno : 0;
    umask(mask);
    if (failed) failListen(path, std::strerror(failed));
    if (::listen(s.get(), SOMAXCONN) < 0) failListen(path, std::strerror(errno));
    if (share) {
        if (chmod(path.c_str(), 0666) < 0) failListen(path, std::strerror(errno));
        if (folder == runtimeFolder() && chmod(folder.c_str(), 0711) < 0) failListen(folder, std::strerror(errno));
    }
    return {raiseDescriptor(std::move(s)), &unixTransport, path, 0};
}

Line accept(int fd) {
    Descriptor came(accept4(fd, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    return came ? Line(raiseDescriptor(std::move(came)), offeredTransport) : Line();
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

// User, groups and process of the peer, as they were when it connected.
Identity identify(const Line& line) {
    Identity out;
    ucred who{};
    out.caller.address = "unix";
    out.caller.host = Caller::self().host;
    if (!peerOf(line.descriptor(), who) || who.uid == overflowUser()) {
        out.caller.user = "nobody";
        out.principal = Principal::anyone();
        return out;
    }
    out.caller.user = userName(who.uid);
    out.caller.process = who.pid;
    out.principal = Principal::user(who.uid, groupsOf(line.descriptor(), who.gid));
    return out;
}

}  // namespace

bool sweepSocket(const std::string& path) {
    const Descriptor lock(open(path.substr(0, path.rfind('/') + 1).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock || flock(lock.get(), LOCK_EX | LOCK_NB) < 0) return false;       // somebody is about to listen
    const Descriptor probe = newSocket(AF_UNIX);
    if (at(path, connect, probe.get()) == 0 || errno != ECONNREFUSED) return false;
    return removeDead(path);
}

constexpr Transport unixTransport{"unix", true, mine, place, lookUp, where, leadsTo, begin, finish, readSocket, writeSocket, peekSocket, identify, listen, accept};

}  // namespace sorma
