// flooder.cpp -- flooder PORT OBJECT: sends EXECs of OBJECT by TCP as fast as the daemon takes them, and takes the replies
// without looking at them. Ends with its standard input.
// flooder PORT -idle COUNT: opens connections and says nothing. Prints "open N"; then for each line that it is given "open N",
// and the last words of one that is not open any more.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "comm/wire.h"

namespace {

using namespace sorma;

int idle(const sockaddr_in& to, int count) {
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    std::vector<int> open;
    for (int i = 0; i < count; ++i) {
        int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (fd < 0 || connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) < 0) return std::perror("flooder: cannot connect"), 1;
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

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3 && argc != 4) return std::fputs("usage: flooder PORT OBJECT | PORT -idle COUNT\n", stderr), 2;
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(std::uint16_t(std::atoi(argv[1])));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (argc == 4) return idle(to, std::atoi(argv[3]));
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(fd, reinterpret_cast<sockaddr*>(&to), sizeof to) < 0) return std::perror("flooder: cannot connect"), 1;
    Buffer calls;
    while (calls.size() < 1 << 20) wire::writeCall(calls, 1, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, argv[2]}, {});
    static char dropped[1 << 20];
    std::size_t at = 0;
    for (;;) {
        pollfd wanted[] = {{fd, POLLIN | POLLOUT, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (poll(wanted, 2, -1) < 0 || wanted[1].revents != 0) return 0;
        if (wanted[0].revents & POLLIN && recv(fd, dropped, sizeof dropped, MSG_DONTWAIT) <= 0) return 0;
        if (!(wanted[0].revents & POLLOUT)) continue;
        ssize_t n = send(fd, calls.data() + at, calls.size() - at, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n > 0) at = (at + std::size_t(n)) % calls.size();
    }
}
