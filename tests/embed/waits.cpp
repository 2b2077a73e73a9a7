// waits.cpp -- how long does the owner of a daemon wait for his calls, and how long because of the daemon?
//
// waits SOCKET PID OBJECT: calls OBJECT each 2 ms by the daemon's Unix-domain socket. For each call it prints its time [us], and
// for how long of that the daemon, process PID, has computed [us]. The rest is other work on this machine.
//
// waits -raw: the same with a process that does nothing but compute, and looks for a byte each 20 us. So long the machine alone
// makes a caller wait.
//
// Both begin with a line, and end with their standard input. Where they may, they run before all other processes ("first"):
// then what the daemon has computed ends with its answer. Else ("begins") it may have gone on while we waited for a processor.

#include <poll.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "comm/wire.h"

namespace {

using namespace sorma;

std::int64_t now(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

// The other side of -raw.
[[noreturn]] void compute(int fd) {
    for (;;) {
        for (const std::int64_t end = now(CLOCK_MONOTONIC) + 20'000; now(CLOCK_MONOTONIC) < end;) {}
        char byte;
        const ssize_t n = recv(fd, &byte, 1, MSG_DONTWAIT);
        if (n == 0 || (n > 0 && send(fd, &byte, 1, MSG_NOSIGNAL) != 1)) _exit(0);
    }
}

bool receive(int fd, char* to, std::size_t size) {
    while (size > 0) {
        const ssize_t n = recv(fd, to, size, 0);
        if (n <= 0) return false;
        to += n;
        size -= std::size_t(n);
    }
    return true;
}

// Send the bytes each 2 ms, and wait for the answer: a record, or one byte.
int measure(int fd, pid_t other, const Buffer& call, bool record) {
    clockid_t clock;
    if (clock_getcpuclockid(other, &clock) != 0) return std::fputs("waits: there is no such process\n", stderr), 1;
    const sched_param least{sched_get_priority_min(SCHED_FIFO)};
    std::puts(sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &least) == 0 ? "first" : "begins");
    std::fflush(stdout);
    struct Wait {
        std::int64_t all, computed;
    };
    std::vector<Wait> waits;
    char answer[65536];
    pollfd end{STDIN_FILENO, POLLIN, 0};
    while (poll(&end, 1, 2) == 0) {
        const std::int64_t computed = now(clock), start = now(CLOCK_MONOTONIC);
        if (send(fd, call.data(), call.size(), MSG_NOSIGNAL) < 0 || !receive(fd, answer, record ? 4 : 1)) return std::perror("waits"), 1;
        if (record) {
            const auto at = reinterpret_cast<unsigned char*>(answer);
            const std::size_t size = std::size_t(at[0] & 0x7f) << 24 | std::size_t(at[1]) << 16 | std::size_t(at[2]) << 8 | at[3];
            if (size > sizeof answer || !receive(fd, answer, size)) return std::perror("waits"), 1;
        }
        waits.push_back({now(CLOCK_MONOTONIC) - start, now(clock) - computed});
    }
    for (auto& wait : waits) std::printf("%.1f %.1f\n", double(wait.all) / 1000, double(wait.computed) / 1000);
    return 0;
}

int raw() {
    int pair[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) < 0) return std::perror("waits"), 1;
    const pid_t child = fork();
    if (child == 0) {
        close(pair[0]);
        compute(pair[1]);
    }
    close(pair[1]);
    Buffer byte;
    byte.append("x", 1);
    const int code = measure(pair[0], child, byte, false);
    close(pair[0]);
    waitpid(child, nullptr, 0);
    return code;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc == 2 && std::string(argv[1]) == "-raw") return raw();
    if (argc != 4) return std::fputs("usage: waits SOCKET PID OBJECT | -raw\n", stderr), 2;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    std::strncpy(to.sun_path, argv[1], sizeof to.sun_path - 1);
    if (connect(fd, reinterpret_cast<sockaddr*>(&to), sizeof to) < 0) return std::perror("waits: cannot connect"), 1;
    Buffer call;
    wire::writeCall(call, 1, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, argv[3]}, {});
    return measure(fd, pid_t(std::atoi(argv[2])), call, true);
}
