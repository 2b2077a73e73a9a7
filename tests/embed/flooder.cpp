// flooder.cpp -- clients that ask for much.
//
// PORT: of the daemon; or the path of its Unix-domain socket.
//
// flooder PORT OBJECT: sends EXECs of OBJECT by TCP as fast as the daemon takes them. For each line of its standard input
// it prints how many replies have come, and it ends with that.
//
// flooder PORT -records FILE ?CONNECTIONS?: the same with the records in that file, again and again, after a HELLO.
//
// flooder PORT -idle COUNT: opens connections and says nothing. Prints "open N". It prints each line of its
// standard input again, with the last words of a connection that is no longer open.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "comm/wire.h"

namespace {

using namespace sorma;

// A connection to a port of this host, or to a path; -1: there is none.
int connectTo(const char* where) {
    const bool path = where[0] == '/';
    sockaddr_in port{};
    port.sin_family = AF_INET;
    port.sin_port = htons(std::uint16_t(std::atoi(where)));
    port.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    sockaddr_un file{};
    file.sun_family = AF_UNIX;
    std::strncpy(file.sun_path, where, sizeof file.sun_path - 1);
    const int fd = socket(path ? AF_UNIX : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int failed = path ? connect(fd, reinterpret_cast<sockaddr*>(&file), sizeof file)
                            : connect(fd, reinterpret_cast<sockaddr*>(&port), sizeof port);
    if (failed == 0) return fd;
    std::perror("flooder: cannot connect");
    close(fd);
    return -1;
}

int idle(const char* where, int count) {
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    std::vector<int> open;
    for (int i = 0; i < count; ++i) {
        int fd = connectTo(where);
        if (fd < 0) return 1;
        // Answered when it has been taken in, or told that it is not.
        Buffer ping;
        wire::writeNull(ping, 1, wire::kProgram);
        char answer[1024];
        if (send(fd, ping.data(), ping.size(), MSG_NOSIGNAL) > 0 && recv(fd, answer, sizeof answer, 0) == 28) open.push_back(fd);
        else close(fd);
    }
    std::string words;
    do {
        std::printf("open %zu %s\n", open.size(), words.c_str());
        std::fflush(stdout);
        if (std::getchar() != '\n') return 0;
        std::erase_if(open, [&](int fd) {
            char said[1024];
            ssize_t n = recv(fd, said, sizeof said, MSG_DONTWAIT);
            if (n < 0) return false;
            if (n > 48) words.assign(said + 48, std::size_t(n) - 48);
            return true;
        });
    } while (true);
}

// Counts records in a stream of bytes.
class Counter {
public:
    void take(const char* data, std::size_t n) {
        while (n > 0) {
            const std::size_t now = std::min(n, left_);
            left_ -= now;
            data += now;
            n -= now;
            if (left_ > 0 || n == 0) continue;
            mark_ = mark_ << 8 | static_cast<unsigned char>(*data++);
            --n;
            if (++seen_ < record::kMarkSize) continue;
            left_ = mark_ & ~record::kLast;
            seen_ = 0;
            ++count;
        }
    }
    std::uint64_t count = 0;

private:
    std::uint32_t mark_ = 0;
    std::size_t seen_ = 0, left_ = 0;       // bytes of the mark; bytes of the record that are still to come
};

Buffer recordsOf(const char* file) {
    Buffer records;
    if (std::FILE* f = std::fopen(file, "rb")) {
        char some[65536];
        while (std::size_t n = std::fread(some, 1, sizeof some, f)) records.append(some, n);
        std::fclose(f);
    }
    return records;
}

// A connection that always sends.
struct Flood {
    int fd;
    std::size_t at = 0;         // [bytes] of the records that were sent
    Counter replies;

    // False: it has ended.
    bool take() {
        static char some[1 << 20];
        const ssize_t n = recv(fd, some, sizeof some, MSG_DONTWAIT);
        if (n > 0) replies.take(some, std::size_t(n));
        return n > 0;
    }
    void send(const Buffer& records) {
        const ssize_t n = ::send(fd, records.data() + at, records.size() - at, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n > 0) at = (at + std::size_t(n)) % records.size();
    }
};

bool greet(int fd, int number) {
    Buffer hello;
    const std::uint64_t client = std::uint64_t(getpid()) << 16 | std::uint64_t(number);
    wire::writeHello(hello, 1, wire::kProgram, {client, "somebody", "somewhere", "flooder", getpid(), 1 << 20});
    return send(fd, hello.data(), hello.size(), MSG_NOSIGNAL) > 0;
}

int flood(std::vector<Flood>& floods, const Buffer& records) {
    std::vector<pollfd> wanted{{STDIN_FILENO, POLLIN, 0}};
    for (auto& flood : floods) wanted.push_back({flood.fd, POLLIN | POLLOUT, 0});
    while (poll(wanted.data(), wanted.size(), -1) > 0) {
        if (wanted[0].revents != 0) {
            char line[16];
            if (read(STDIN_FILENO, line, sizeof line) <= 0) return 0;
            std::uint64_t count = 0;
            for (auto& flood : floods) count += flood.replies.count;
            std::printf("%llu\n", static_cast<unsigned long long>(count));
            std::fflush(stdout);
        }
        for (std::size_t i = 0; i < floods.size(); ++i) {
            const short events = wanted[i + 1].revents;
            if ((events & POLLIN) && !floods[i].take()) return 0;
            if (events & POLLOUT) floods[i].send(records);
        }
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const std::string kind = argc > 3 ? argv[2] : "";
    if (argc != 3 && (argc != 4 || kind != "-idle") && (argc > 5 || kind != "-records"))
        return std::fputs("usage: flooder PORT OBJECT | PORT -idle COUNT | PORT -records FILE ?CONNECTIONS?\n", stderr), 2;
    if (kind == "-idle") return idle(argv[1], std::atoi(argv[3]));
    Buffer records = kind == "-records" ? recordsOf(argv[3]) : Buffer();
    if (kind.empty())
        while (records.size() < 1 << 20) wire::writeCall(records, 1, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, argv[2]}, {});
    if (records.empty()) return std::fputs("flooder: there are no records\n", stderr), 1;
    std::vector<Flood> floods;
    for (int i = 0; i < (argc == 5 ? std::atoi(argv[4]) : 1); ++i) {
        const int fd = connectTo(argv[1]);
        if (fd < 0) return 1;
        if (!kind.empty() && !greet(fd, i)) return std::perror("flooder: cannot send"), 1;
        floods.push_back({fd, 0, {}});
    }
    return flood(floods, records);
}
