// server.cpp -- the daemon of a hand controller, for tests/spacemouse.test: what is told on stdin is sent to who has connected.
//
//     spacemouseServer PATH
//
// Eight integers: a record. "piece" and eight: the record in two halves. "end": hang up, and take the next client. It says "ready",
// "client" for each client, "sent" for each record, and ends with stdin.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <sstream>
#include <string>

int main(int argc, char** argv) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (argc != 2 || std::strlen(argv[1]) >= sizeof address.sun_path) return 2;
    std::strcpy(address.sun_path, argv[1]);
    const int server = socket(AF_UNIX, SOCK_STREAM, 0);
    if (server < 0 || bind(server, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 || listen(server, 4) != 0) {
        std::perror(argv[1]);
        return 1;
    }
    std::cout << "ready" << std::endl;
    int client = -1;
    for (std::string line;;) {
        pollfd watched[] = {{0, POLLIN, 0}, {server, POLLIN, 0}};
        if (poll(watched, client < 0 ? 2 : 1, -1) < 0) return 1;
        if (watched[1].revents && client < 0) {
            client = accept(server, nullptr, nullptr);
            // The client asks for a version of the protocol and waits for the answer: 1.
            std::int32_t version = 0;
            if (recv(client, &version, sizeof version, MSG_WAITALL) != sizeof version) return 1;
            version = (version & ~0xff) | 1;
            if (send(client, &version, sizeof version, MSG_NOSIGNAL) < 0) return 1;
            std::cout << "client" << std::endl;
        }
        if (!watched[0].revents) continue;
        if (!std::getline(std::cin, line)) break;
        std::istringstream words(line);
        if (line == "end") {
            close(client);
            client = -1;
            continue;
        }
        const bool piece = line.starts_with("piece");
        if (piece) words.ignore(5);
        std::array<std::int32_t, 8> record{};
        for (auto& x : record) words >> x;
        const char* bytes = reinterpret_cast<const char*>(record.data());
        const std::size_t first = piece ? 13 : sizeof record;
        if (send(client, bytes, first, MSG_NOSIGNAL) != ssize_t(first)) return 1;
        if (piece && send(client, bytes + first, sizeof record - first, MSG_NOSIGNAL) < 0) return 1;
        std::cout << "sent" << std::endl;
    }
    unlink(argv[1]);
}
