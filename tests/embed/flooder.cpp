// flooder.cpp -- flooder PORT OBJECT: sends EXECs of OBJECT by TCP as fast as the daemon takes them, and takes the replies
// without looking at them. Ends with its standard input.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "comm/wire.h"

int main(int argc, char** argv) {
    using namespace sorma;
    if (argc != 3) return std::fputs("usage: flooder PORT OBJECT\n", stderr), 2;
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(std::uint16_t(std::atoi(argv[1])));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
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
