#include "comm/endpoint.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <utility>

#include "bus/catalogue.h"
#include "comm/errors.h"
#include "comm/reactor.h"

namespace sorma {

namespace {

const Prototype kFolder{Severity::error, "COMM DENIED", 1, "runtime folder {}: {}; set SORMA_RUNTIME_DIR to a folder of your own with mode 0700"};
const Prototype kHost{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: host \"{}\" is not known: {}"};
const Prototype kPath{Severity::error, "NAME SYNTAX", 1, "socket path {} has {} bytes, a Unix-domain socket takes at most {}"};
const Prototype kListen{Severity::error, "COMM REFUSED", 1, "cannot listen on {}: {}"};
const Prototype kLocked{Severity::error, "COMM REFUSED", 1,
    "cannot listen on {}: another process has had the lock on its folder {} for {} s; end that one (lslocks shows it), or choose a "
    "folder of your own"};
const Prototype kTaken{Severity::error, "COMM REFUSED", 1,
    "{} is served already by {}; this is {}; end that one or choose another name"};
const Prototype kInherited{Severity::error, "COMM REFUSED", 1, "descriptor {} must be {}, but it is {}"};
const Prototype kNotRegistered{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: rpcbind on {} knows no program 0x{} (0x20000000 + 0x{})"};

struct Closing {
    int fd;
    ~Closing() { if (fd >= 0) close(fd); }
    int release() { return std::exchange(fd, -1); }
};

std::string hex(std::uint32_t v) {
    char text[16];
    std::snprintf(text, sizeof text, "%x", v);
    return text;
}

sockaddr_un unixAddress(const std::string& path) {
    sockaddr_un a{};
    a.sun_family = AF_UNIX;
    if (path.size() >= sizeof a.sun_path) fail(kPath, path, path.size(), sizeof a.sun_path - 1);
    std::memcpy(a.sun_path, path.c_str(), path.size() + 1);
    return a;
}

// Connect within the deadline. Returns 0 or an errno.
int connectWithin(int fd, const sockaddr* address, socklen_t size, Deadline deadline) {
    if (connect(fd, address, size) == 0) return 0;
    if (errno == EAGAIN) return EAGAIN;         // Unix: the backlog is full
    if (errno != EINPROGRESS) return errno;
    for (;;) {
        pollfd p{fd, POLLOUT, 0};
        std::int64_t left = deadline.left() / 1'000'000;
        int n = poll(&p, 1, deadline.none() ? -1 : int(left > 1'000'000'000 ? 1'000'000'000 : left + 1));
        if (n < 0 && errno == EINTR) continue;
        if (n == 0 && deadline.passed()) return ETIMEDOUT;
        if (n <= 0) continue;
        int error = 0;
        socklen_t length = sizeof error;
        getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length);
        return error;
    }
}

// The process at the other end of a Unix-domain socket, as the kernel knows it.
std::string listenerOf(int fd) {
    ucred who{};
    socklen_t size = sizeof who;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) < 0) return "another process";
    Caller caller;
    caller.process = who.pid;
    caller.host = Caller::self().host;
    passwd entry, *found = nullptr;
    char space[1024];
    if (getpwuid_r(who.uid, &entry, space, sizeof space, &found) == 0 && found) caller.user = found->pw_name;
    std::ifstream program("/proc/" + std::to_string(who.pid) + "/comm");
    std::getline(program, caller.program);
    return "a live daemon, " + caller.toText();
}

void makeBlocking(int fd, bool blocking) {
    int flags = fcntl(fd, F_GETFL);
    fcntl(fd, F_SETFL, blocking ? flags & ~O_NONBLOCK : flags | O_NONBLOCK);
}

[[noreturn]] void failConnect(const std::string& who, const std::string& where, int error) {
    if (error == ETIMEDOUT) fail(errors::kConnectTimeout, who, where);
    const char* hint = error == ECONNREFUSED || error == ENOENT ? "no daemon listens there; is it started?"
                       : error == EACCES                        ? "it belongs to another user"
                       : error == EAGAIN                        ? "it has more connections waiting than it accepts"
                                                                : "check the network";
    fail(errors::kRefused, who, where, std::strerror(error), hint);
}

}  // namespace

std::string runtimeFolder() {
    std::string folder;
    if (const char* own = std::getenv("SORMA_RUNTIME_DIR"); own && *own) folder = own;
    else if (const char* xdg = std::getenv("XDG_RUNTIME_DIR"); xdg && *xdg) folder = std::string(xdg) + "/sorma";
    else folder = "/tmp/sorma-" + std::to_string(getuid());
    if (mkdir(folder.c_str(), 0700) < 0 && errno != EEXIST) fail(kFolder, folder, std::strerror(errno));
    struct stat s;
    if (lstat(folder.c_str(), &s) < 0) fail(kFolder, folder, std::strerror(errno));
    if (!S_ISDIR(s.st_mode)) fail(kFolder, folder, "is not a folder");
    if (s.st_uid != geteuid()) fail(kFolder, folder, "belongs to another user");
    if (s.st_mode & 066) fail(kFolder, folder, s.st_mode & 022 ? "others may write to it" : "others may look into it");
    return folder;
}

std::string runtimeSocket(const std::string& name) { return runtimeFolder() + "/" + name + ".sock"; }

std::string describe(const Address& address) {
    if (address.kind == Address::Kind::path) return address.host;
    if (address.kind == Address::Kind::tcp) return address.host + ":" + std::to_string(address.number);
    return address.toText();
}

namespace {

struct InfoList {
    addrinfo* list = nullptr;
    ~InfoList() { if (list) freeaddrinfo(list); }
};

// Where a TCP address, or a program registered with rpcbind, is to be found. Fails with ADDRESS UNRESOLVED.
void lookUp(const Address& address, const std::string& who, InfoList& found, std::string& where) {
    std::string host = address.host;
    int port = int(address.number);
    if (address.kind == Address::Kind::program) {
        port = rpcbindLookup(host, address.number);
        if (port == 0) fail(kNotRegistered, who, host, hex(0x20000000 + address.number), hex(address.number));
    }
    where = host + ":" + std::to_string(port);
    if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_ADDRCONFIG | AI_NUMERICSERV;
    int code = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found.list);
    if (code != 0) {                            // without any interface but loopback, AI_ADDRCONFIG knows nothing
        hints.ai_flags = AI_NUMERICSERV;
        code = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found.list);
    }
    if (code != 0) fail(kHost, who, host, gai_strerror(code));
}

void forTcp(int fd) {
    int on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
}

[[noreturn]] void failPath(const Address& given, const std::string& path, const std::string& who, int error) {
    if (error == ENOENT && given.kind == Address::Kind::alias) fail(errors::kUnresolved, who, given.host, path);
    failConnect(who, path, error);
}

}  // namespace

int connectTo(const Address& given, const std::string& who, Deadline deadline) {
    bool alias = given.kind == Address::Kind::alias;
    if (alias || given.kind == Address::Kind::path) {
        std::string path = alias ? runtimeSocket(given.host) : given.host;
        sockaddr_un a = unixAddress(path);
        Closing s{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
        if (s.fd < 0) failConnect(who, path, errno);
        if (int error = connectWithin(s.fd, reinterpret_cast<sockaddr*>(&a), sizeof a, deadline)) failPath(given, path, who, error);
        makeBlocking(s.fd, true);
        return raiseDescriptor(s.release());
    }
    InfoList found;
    std::string where;
    lookUp(given, who, found, where);
    int error = ECONNREFUSED;
    for (addrinfo* a = found.list; a; a = a->ai_next) {
        Closing s{socket(a->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
        if (s.fd < 0) continue;
        error = connectWithin(s.fd, a->ai_addr, a->ai_addrlen, deadline);
        if (error != 0) continue;
        makeBlocking(s.fd, true);
        forTcp(s.fd);
        return raiseDescriptor(s.release());
    }
    failConnect(who, where, error);
}

int beginConnect(const Address& given, const std::string& who) {
    bool alias = given.kind == Address::Kind::alias;
    if (alias || given.kind == Address::Kind::path) {       // at once, or not at all
        std::string path = alias ? runtimeSocket(given.host) : given.host;
        sockaddr_un a = unixAddress(path);
        Closing s{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
        if (s.fd < 0 || connect(s.fd, reinterpret_cast<sockaddr*>(&a), sizeof a) < 0) failPath(given, path, who, errno);
        return raiseDescriptor(s.release());
    }
    InfoList found;
    std::string where;
    lookUp(given, who, found, where);
    int error = ECONNREFUSED;
    for (addrinfo* a = found.list; a; a = a->ai_next) {     // the first that does not refuse at once
        Closing s{socket(a->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
        if (s.fd < 0) continue;
        forTcp(s.fd);
        if (connect(s.fd, a->ai_addr, a->ai_addrlen) == 0 || errno == EINPROGRESS) return raiseDescriptor(s.release());
        error = errno;
    }
    failConnect(who, where, error);
}

void endConnect(int fd, const Address& address, const std::string& who) {
    int error = 0;
    socklen_t length = sizeof error;
    getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length);
    if (error != 0) failConnect(who, describe(address), error);
    makeBlocking(fd, true);
}

int listenTcp(const std::string& host, int port, int& boundPort) {
    std::string where = host + ":" + std::to_string(port);
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
    addrinfo* list = nullptr;
    if (int code = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list)) fail(kListen, where, gai_strerror(code));
    std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(list, freeaddrinfo);
    Closing s{socket(list->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    if (s.fd < 0) fail(kListen, where, std::strerror(errno));
    int on = 1;
    setsockopt(s.fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(s.fd, list->ai_addr, list->ai_addrlen) < 0) {
        if (errno == EADDRINUSE) fail(kTaken, where, "another process", Caller::self().toText());
        fail(kListen, where, std::strerror(errno));
    }
    if (listen(s.fd, SOMAXCONN) < 0) fail(kListen, where, std::strerror(errno));
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    getsockname(s.fd, reinterpret_cast<sockaddr*>(&bound), &size);
    boundPort = ntohs(bound.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(&bound)->sin6_port
                                                  : reinterpret_cast<sockaddr_in*>(&bound)->sin_port);
    return raiseDescriptor(s.release());
}

// Take the lock on a folder. Any process that may read the folder can take it and keep it, so waiting for it has a limit.
static void takeTurn(int folder, const std::string& name, const std::string& path) {
    constexpr std::int64_t kPatience = 3000;            // [ms] several times what a start needs
    for (Deadline deadline = Deadline::in(kPatience); flock(folder, LOCK_EX | LOCK_NB) < 0; poll(nullptr, 0, 10)) {
        if (errno != EWOULDBLOCK && errno != EINTR) fail(kListen, path, std::strerror(errno));
        if (deadline.passed()) fail(kLocked, path, name, kPatience / 1000);
    }
}

// Remove the files of a daemon that died: its socket, and its .tcp file (siblings.h).
static bool removeDead(const std::string& path) {
    if (path.ends_with(".sock")) unlink((path.substr(0, path.size() - 5) + ".tcp").c_str());
    return unlink(path.c_str()) == 0;
}

bool sweepSocket(const std::string& path) {
    sockaddr_un a = unixAddress(path);
    Closing lock{open(path.substr(0, path.rfind('/') + 1).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
    if (lock.fd < 0 || flock(lock.fd, LOCK_EX | LOCK_NB) < 0) return false;       // somebody is about to listen
    Closing probe{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    if (connectWithin(probe.fd, reinterpret_cast<sockaddr*>(&a), sizeof a, Deadline::in(100)) != ECONNREFUSED) return false;
    return removeDead(path);
}

int listenUnix(const std::string& path, bool share) {
    sockaddr_un a = unixAddress(path);
    auto slash = path.rfind('/');
    std::string folder = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
    // Two daemons that start at the same moment must not each remove the other's socket.
    Closing lock{open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
    if (lock.fd < 0) fail(kListen, path, std::strerror(errno));
    takeTurn(lock.fd, folder, path);
    struct stat found;
    if (lstat(path.c_str(), &found) == 0) {
        if (!S_ISSOCK(found.st_mode)) fail(kListen, path, "there is a file of that name which is no socket");
        Closing probe{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
        int error = connectWithin(probe.fd, reinterpret_cast<sockaddr*>(&a), sizeof a, Deadline::in(1000));
        if (error == 0) fail(kTaken, path, listenerOf(probe.fd), Caller::self().toText());
        if (error == EAGAIN) fail(kTaken, path, "a busy daemon", Caller::self().toText());
        if (error == EACCES) fail(kListen, path, "it belongs to another user");
        removeDead(path);
    }
    Closing s{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    mode_t mask = umask(0077);
    int failed = bind(s.fd, reinterpret_cast<sockaddr*>(&a), sizeof a) < 0 ? errno : 0;
    umask(mask);
    if (failed) fail(kListen, path, std::strerror(failed));
    if (listen(s.fd, SOMAXCONN) < 0) fail(kListen, path, std::strerror(errno));
    if (share) {
        if (chmod(path.c_str(), 0666) < 0) fail(kListen, path, std::strerror(errno));
        if (folder == runtimeFolder() && chmod(folder.c_str(), 0711) < 0) fail(kListen, folder, std::strerror(errno));
    }
    return raiseDescriptor(s.release());
}

namespace {

Inherited inherit(int fd, bool listener) {
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
    Inherited found{-1, domain != AF_UNIX, 0, {}};
    if (domain == AF_INET) found.port = ntohs(reinterpret_cast<sockaddr_in&>(own).sin_port);
    else if (domain == AF_INET6) found.port = ntohs(reinterpret_cast<sockaddr_in6&>(own).sin6_port);
    else if (size > offsetof(sockaddr_un, sun_path)) {
        auto& a = reinterpret_cast<sockaddr_un&>(own);
        found.path.assign(a.sun_path, size - offsetof(sockaddr_un, sun_path));
        if (found.path[0] == 0) found.path[0] = '@';
        else found.path.resize(std::strlen(found.path.c_str()));
    }
    int copy = fcntl(fd, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    if (copy < 0) fail(kListen, "descriptor " + std::to_string(fd), std::strerror(errno));
    makeBlocking(copy, false);
    found.fd = raiseDescriptor(copy);
    return found;
}

}  // namespace

Inherited inheritListener(int fd) { return inherit(fd, true); }
Inherited inheritConnection(int fd) { return inherit(fd, false); }

}  // namespace sorma
