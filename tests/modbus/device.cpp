// device.cpp -- a Modbus device for tests: the server's side of libmodbus, with faults on purpose.
//
//     modbusDevice tcp            prints its port; listens on 127.0.0.1
//     modbusDevice rtu PATH       unit 1 of a serial line, with 115200 bits a second; prints the path
//
// It has 400 of each kind of register and coil; others are refused as illegal. Lines on standard input, each answered with a line:
//     fault NAME ?NUMBER?         what becomes of answers from now on: none, exception NUMBER, silent, half, transaction (of another one), garbage,
//                                 twice, drip (a byte now and then), hangup, longer, late, checksum (wrong, RTU), unit (another one, RTU)
//     set TABLE ADDRESS VALUE     TABLE: coil discrete input holding
//     get TABLE ADDRESS
//     heard                       requests so far, FUNCTION@ADDRESS+COUNT of each (of a single write +VALUE); then it forgets them
//     release                     send the answers that `late` has kept
//     clients                     how many there are
//     hangup                      close all lines (TCP)
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <modbus/modbus.h>

namespace {

constexpr int kEach = 400, kDrip = 30;      // [ms] between two bytes

struct Client {
    int fd;
    std::string drips;                      // bytes that come one after another
    std::string kept;                       // of `late`
};

modbus_mapping_t* map = nullptr;
std::string fault = "none";
int number = 0;
std::string heard;
std::vector<Client> clients;
std::string path;                           // of the serial line; empty: TCP

modbus_t* fresh() {
    modbus_t* context = path.empty() ? modbus_new_tcp("127.0.0.1", 0) : modbus_new_rtu(path.c_str(), 115200, 'N', 8, 1);
    modbus_set_slave(context, 1);
    return context;
}

// The bytes of libmodbus's answer. It goes into a pair of sockets first.
std::string answerTo(const std::uint8_t* request, int length) {
    int pair[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0) std::abort();
    modbus_t* context = fresh();
    modbus_set_socket(context, pair[0]);
    if (fault == "noMask" && request[path.empty() ? 7 : 1] == 22) modbus_reply_exception(context, request, 1);
    else if (fault == "exception") modbus_reply_exception(context, request, unsigned(number));
    else modbus_reply(context, request, length, map);
    char bytes[MODBUS_TCP_MAX_ADU_LENGTH];
    const ssize_t n = recv(pair[1], bytes, sizeof bytes, MSG_DONTWAIT);
    modbus_close(context);
    modbus_free(context);
    close(pair[1]);
    return std::string(bytes, n > 0 ? std::size_t(n) : 0);
}

void say(int fd, const std::string& bytes) {
    if (!bytes.empty() && write(fd, bytes.data(), bytes.size()) < 0) std::perror("device");
}

// A request has come, or the line has ended: false.
bool serve(Client& c) {
    modbus_t* context = fresh();
    modbus_set_socket(context, c.fd);
    std::uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    const int length = modbus_receive(context, request);
    modbus_free(context);                   // leaves the socket open
    if (length < 0) return false;
    if (length == 0) return true;           // a serial line: for another unit
    const int head = path.empty() ? 7 : 1;  // bytes before the function
    auto two = [&](int at) { return std::to_string(request[head + at] << 8 | request[head + at + 1]); };
    heard += (heard.empty() ? "" : " ") + std::to_string(request[head]) + "@" + two(1) + "+" + two(3);
    std::string answer = answerTo(request, length);
    if (fault == "silent") return true;
    if (fault == "hangup") return false;
    if (fault == "half") answer.resize(answer.size() / 2);
    if (fault == "transaction") ++answer[1];
    if (fault == "checksum") ++answer.back();
    if (fault == "unit") ++answer[0];
    if (fault == "garbage") answer = std::string("\xff\x00\x80 garbage garbage", 19);
    if (fault == "twice") answer += answer;
    if (fault == "longer" && path.empty()) {                // a byte more, and the counts say so
        ++answer[5], ++answer[8];
        answer += '\0';
    }
    if (fault == "late") c.kept += answer;
    else if (fault == "drip") c.drips += answer;
    else say(c.fd, answer);
    return true;
}

std::uint16_t* cell(const std::string& table, int at, std::uint8_t** bit) {
    if (at < 0 || at >= kEach) std::abort();
    *bit = table == "coil" ? map->tab_bits + at : table == "discrete" ? map->tab_input_bits + at
                                                                      : nullptr;
    return table == "input" ? map->tab_input_registers + at : map->tab_registers + at;
}

std::string obey(const std::string& line) {
    std::istringstream words(line);
    std::string word, table;
    int at = 0, value = 0;
    words >> word;
    if (word == "fault") {
        words >> fault >> number;
    } else if (word == "set" || word == "get") {
        std::uint8_t* bit;
        words >> table >> at;
        std::uint16_t* whole = cell(table, at, &bit);
        if (word == "get") return std::to_string(bit ? *bit : *whole);
        while (words >> value) {
            whole = cell(table, at++, &bit);
            if (bit) *bit = std::uint8_t(value);
            else *whole = std::uint16_t(value);
        }
    } else if (word == "heard") {
        return std::exchange(heard, {});
    } else if (word == "release") {
        for (auto& c : clients) say(c.fd, std::exchange(c.kept, {}));
    } else if (word == "clients") {
        return std::to_string(clients.size());
    } else if (word == "hangup") {
        for (auto& c : clients) close(c.fd);
        clients.clear();
    }
    return "ok";
}

// Listens, and prints its port.
int listening() {
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof here;
    if (bind(listener, reinterpret_cast<sockaddr*>(&here), size) != 0 || listen(listener, 16) != 0 ||
        getsockname(listener, reinterpret_cast<sockaddr*>(&here), &size) != 0) {
        std::perror("device");
        std::exit(1);
    }
    std::cout << ntohs(here.sin_port) << std::endl;
    return listener;
}

// Opens the serial line, and prints its path.
void opened() {
    static modbus_t* line = fresh();
    if (modbus_connect(line) != 0) {
        std::perror(path.c_str());
        std::exit(1);
    }
    clients.push_back({modbus_get_socket(line), {}, {}});
    std::cout << path << std::endl;
}

}  // namespace

int main(int count, char** words) {
    signal(SIGPIPE, SIG_IGN);
    map = modbus_mapping_new(kEach, kEach, kEach, kEach);
    if (count > 2) path = words[2];
    const int listener = path.empty() ? listening() : -1;
    if (!path.empty()) opened();
    std::string input;
    for (;;) {
        std::vector<pollfd> fds{{0, POLLIN, 0}, {listener, POLLIN, 0}};
        bool drips = false;
        for (auto& c : clients) {
            fds.push_back({c.fd, POLLIN, 0});
            drips = drips || !c.drips.empty();
        }
        if (poll(fds.data(), fds.size(), drips ? kDrip : -1) < 0) return 1;
        for (std::size_t i = fds.size(); i-- > 2;) {
            Client& c = clients[i - 2];
            if (!c.drips.empty()) {
                say(c.fd, c.drips.substr(0, 1));
                c.drips.erase(0, 1);
            }
            if (fds[i].revents != 0 && !serve(c)) {
                close(c.fd);
                clients.erase(clients.begin() + long(i - 2));
            }
        }
        if (fds[1].revents != 0) clients.push_back({accept(listener, nullptr, nullptr), {}, {}});
        if (fds[0].revents == 0) continue;
        char bytes[4096];
        const ssize_t n = read(0, bytes, sizeof bytes);
        if (n <= 0) return 0;               // who has started it has ended
        input.append(bytes, std::size_t(n));
        for (std::size_t end; (end = input.find('\n')) != std::string::npos; input.erase(0, end + 1))
            std::cout << obey(input.substr(0, end)) << std::endl;
    }
}
