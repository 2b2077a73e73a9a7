// activate ?option ?value?? ... -- CMD ...  -- starts a program with open sockets, as systemd or inetd would.
//
// Sockets, passed as 3, 4, ... in this order:
//     -unix PATH    -abstract NAME    -tcp    -tcp6       listening; "port N" is printed for TCP
//     -datagram PATH    -bound PATH    -pipe              such as are not wanted
//     -connection PATH                                    listen there, and pass the first connection
// -names A:B    LISTEN_FDNAMES          -count TEXT   LISTEN_FDS, whatever there is          -foreign   a wrong LISTEN_PID
// -stdin        pass the first one as standard input, output and error instead, and no LISTEN_...
// -demand       print "listening", begin when somebody connects, and again each time the program has ended
// -notify PATH  NOTIFY_SOCKET (@NAME: abstract); prints "notify TEXT", newlines as |           -watchdog MICROSECONDS
// Prints "ended STATUS" when the program has ended. SIGTERM to it when standard input ends.
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace {

[[noreturn]] void giveUp(const char* what) {
    std::printf("activate: %s: %s\n", what, std::strerror(errno));
    std::exit(1);
}

int checked(int value, const char* what) {
    if (value < 0) giveUp(what);
    return value;
}

// A Unix-domain socket that is bound; @NAME is of the abstract namespace.
int bound(const std::string& path, int type) {
    sockaddr_un a{};
    a.sun_family = AF_UNIX;
    if (path.size() >= sizeof a.sun_path) giveUp("the path is too long");
    std::memcpy(a.sun_path, path.data(), path.size());
    bool abstract = path[0] == '@';
    if (abstract) a.sun_path[0] = 0;
    int fd = checked(socket(AF_UNIX, type | SOCK_CLOEXEC, 0), "socket");
    socklen_t size = socklen_t(offsetof(sockaddr_un, sun_path) + path.size() + (abstract ? 0 : 1));
    checked(bind(fd, reinterpret_cast<sockaddr*>(&a), size), path.c_str());
    return fd;
}

int listening(int fd) {
    checked(listen(fd, 10), "listen");
    return fd;
}

int tcp(int family) {
    sockaddr_storage a{};
    a.ss_family = sa_family_t(family);
    reinterpret_cast<sockaddr_in&>(a).sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(sockaddr_in);
    if (family == AF_INET6) {
        reinterpret_cast<sockaddr_in6&>(a).sin6_addr = in6addr_loopback;
        size = sizeof(sockaddr_in6);
    }
    int fd = checked(socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket");
    checked(bind(fd, reinterpret_cast<sockaddr*>(&a), size), "bind");
    getsockname(fd, reinterpret_cast<sockaddr*>(&a), &size);
    std::printf("port %d\n", ntohs(reinterpret_cast<sockaddr_in&>(a).sin_port));      // at the same place in both families
    return listening(fd);
}

int firstConnection(const std::string& path) {
    int listener = listening(bound(path, SOCK_STREAM));
    std::printf("listening\n");
    std::fflush(stdout);
    int fd = checked(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC), "accept");
    close(listener);
    return fd;
}

struct Start {
    std::vector<int> sockets;
    std::string names, count, notify, watchdog;
    bool foreign = false, standard = false, demand = false;
    char** command = nullptr;
};

[[noreturn]] void become(const Start& s) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (s.standard) {
        for (int fd : {0, 1, 2}) dup2(s.sockets[0], fd);
    } else if (!s.sockets.empty() || !s.count.empty()) {
        std::vector<int> copies;
        for (int fd : s.sockets) copies.push_back(fcntl(fd, F_DUPFD, 100));
        for (std::size_t i = 0; i < copies.size(); ++i) {
            dup2(copies[i], int(3 + i));
            close(copies[i]);
        }
        setenv("LISTEN_FDS", s.count.empty() ? std::to_string(copies.size()).c_str() : s.count.c_str(), 1);
        setenv("LISTEN_PID", std::to_string(getpid() + s.foreign).c_str(), 1);
        if (!s.names.empty()) setenv("LISTEN_FDNAMES", s.names.c_str(), 1);
    }
    if (!s.notify.empty()) setenv("NOTIFY_SOCKET", s.notify.c_str(), 1);
    if (!s.watchdog.empty()) {
        setenv("WATCHDOG_USEC", s.watchdog.c_str(), 1);
        setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
    }
    execvp(s.command[0], s.command);
    _exit(127);
}

// Wait for the first of these. Returns its index, -1 for none.
int waitFor(std::vector<pollfd> fds) {
    while (poll(fds.data(), fds.size(), -1) < 0 && errno == EINTR) {}
    for (std::size_t i = 0; i < fds.size(); ++i)
        if (fds[i].revents) return int(i);
    return -1;
}

// False: they are wrong, as has been told.
bool takeOptions(int argc, char** argv, Start& s) {
    for (int at = 1; at < argc; ++at) {
        std::string option = argv[at];
        auto value = [&] { return std::string(++at < argc ? argv[at] : ""); };
        if (option == "--") {
            s.command = argv + at + 1;
            break;
        }
        if (option == "-unix") s.sockets.push_back(listening(bound(value(), SOCK_STREAM)));
        else if (option == "-abstract") s.sockets.push_back(listening(bound("@" + value(), SOCK_STREAM)));
        else if (option == "-tcp") s.sockets.push_back(tcp(AF_INET));
        else if (option == "-tcp6") s.sockets.push_back(tcp(AF_INET6));
        else if (option == "-datagram") s.sockets.push_back(bound(value(), SOCK_DGRAM));
        else if (option == "-bound") s.sockets.push_back(bound(value(), SOCK_STREAM));
        else if (option == "-connection") s.sockets.push_back(firstConnection(value()));
        else if (option == "-pipe") {
            int ends[2];
            checked(pipe2(ends, O_CLOEXEC), "pipe");
            s.sockets.push_back(ends[0]);
        }
        else if (option == "-names") s.names = value();
        else if (option == "-count") s.count = value();
        else if (option == "-foreign") s.foreign = true;
        else if (option == "-stdin") s.standard = true;
        else if (option == "-demand") s.demand = true;
        else if (option == "-notify") s.notify = value();
        else if (option == "-watchdog") s.watchdog = value();
        else {
            std::printf("activate: unknown option %s\n", option.c_str());
            return false;
        }
    }
    if (s.command && *s.command) return true;
    std::printf("usage: activate ?option? ... -- CMD ...\n");
    return false;
}

// Print what the program tells, until it has ended.   input: is there still standard input?
void follow(pid_t child, int told, bool& input) {
    int end = checked(int(syscall(SYS_pidfd_open, child, 0)), "pidfd");
    for (;;) {
        int which = waitFor({{told, POLLIN, 0}, {end, POLLIN, 0}, {input ? STDIN_FILENO : -1, POLLIN, 0}});
        if (which == 0) {
            char text[4096];
            ssize_t n = recv(told, text, sizeof text, 0);
            for (ssize_t i = 0; i < n; ++i)
                if (text[i] == '\n') text[i] = '|';
            std::printf("notify %.*s\n", int(n), text);
            std::fflush(stdout);
        } else if (which == 1) {
            break;
        } else {
            char text[100];
            if (read(STDIN_FILENO, text, sizeof text) > 0) continue;
            input = false;
            kill(child, SIGTERM);
        }
    }
    close(end);
    int status = 0;
    waitpid(child, &status, 0);
    std::printf("ended %d\n", WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status));
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    Start s;
    if (!takeOptions(argc, argv, s)) return 2;
    int told = s.notify.empty() ? -1 : bound(s.notify, SOCK_DGRAM);
    if (s.demand) std::printf("listening\n");
    std::fflush(stdout);
    bool input = true;
    do {
        if (s.demand) {
            std::vector<pollfd> fds{{STDIN_FILENO, POLLIN, 0}};
            for (int fd : s.sockets) fds.push_back({fd, POLLIN, 0});
            if (waitFor(fds) == 0) break;
        }
        pid_t child = fork();
        if (child == 0) become(s);
        follow(child, told, input);
    } while (s.demand && input);
    return 0;
}
