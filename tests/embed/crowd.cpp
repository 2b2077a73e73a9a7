// crowd.cpp -- crowd SOCKET OBJECT CLIENTS REQUESTS: many clients of one daemon, each with many requests in flight.
//
// Every client has a connection and an identity of its own. It sends all its EXECs of OBJECT at once, with the ints (client,
// request); OBJECT answers with the same. Prints "sent N" when all are on their way, "answered N" when each has come
// back with its own ints, once; else what is wrong, and exits with 1.
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/wire.h"
#include "sorma.h"

namespace {

using namespace sorma;

constexpr int kPatience = 60'000;                       // [ms] without any byte
constexpr std::uint32_t kHello = 1u << 20, kPing = kHello + 1;      // xids; requests are numbered from 0

struct Member {
    int number = 0, fd = -1;
    std::string in;
    std::vector<bool> answered;                         // by request
    std::size_t count = 0;
    bool welcome = false, over = false;
};

[[noreturn]] void wrong(const Member& c, const std::string& what) {
    throw std::runtime_error("client " + std::to_string(c.number) + ": " + what);
}

void send(const Member& c, const Buffer& out) {
    for (std::size_t done = 0; done < out.size();) {
        ssize_t n = ::send(c.fd, out.data() + done, out.size() - done, MSG_NOSIGNAL);
        if (n <= 0) wrong(c, std::string("cannot send: ") + std::strerror(errno));
        done += std::size_t(n);
    }
}

void connect(Member& c, const std::string& path) {
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    if (path.size() >= sizeof to.sun_path) wrong(c, "the path is too long: " + path);
    std::memcpy(to.sun_path, path.data(), path.size());
    c.fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (c.fd < 0 || ::connect(c.fd, reinterpret_cast<sockaddr*>(&to), sizeof to) < 0)
        wrong(c, "cannot connect: " + std::string(std::strerror(errno)));
    Buffer out;
    wire::Hello hello{std::uint64_t(getpid()) << 32 | std::uint32_t(c.number), "somebody", "somewhere", "crowd", getpid(), 1 << 20};
    wire::writeHello(out, kHello, wire::kProgram, hello);
    send(c, out);
}

void begin(Member& c, const std::string& object, std::size_t requests) {
    Buffer out;
    Message m;
    for (std::uint32_t i = 0; i < requests; ++i) {
        m.ints = {c.number, std::int64_t(i)};
        wire::writeCall(out, i, wire::kProgram, {i, 1, 0, Method::exec, object}, m);
    }
    c.answered.resize(requests);
    send(c, out);
}

// A record. After the last answer a ping is sent, and its reply must be all that still comes.
void take(Member& c, std::string_view record) {
    XdrReader r(record);
    auto envelope = wire::readEnvelope(r);
    std::string objection = wire::readReplyHeader(r);
    if (envelope.kind != 1 || !objection.empty()) wrong(c, "no reply: " + objection);
    if (envelope.xid == kHello && !c.welcome) {
        c.welcome = true;
        return;
    }
    if (envelope.xid == kPing && c.count == c.answered.size() && !c.over) {
        c.over = true;
        return;
    }
    std::string name = "request " + std::to_string(envelope.xid);
    if (envelope.xid >= c.answered.size()) wrong(c, name + " was never made");
    if (c.answered[envelope.xid]) wrong(c, name + " is answered twice");
    Message m;
    wire::Times times;
    if (!wire::readReply(r, times, m)) wrong(c, name + " is answered with nonsense");
    if (m.code != 0) wrong(c, name + " failed: " + m.trail.toText());
    if (m.ints.size() != 2 || m.ints[0] != c.number || m.ints[1] != std::int64_t(envelope.xid))
        wrong(c, name + " got the answer of another one");
    c.answered[envelope.xid] = true;
    if (++c.count < c.answered.size()) return;
    Buffer out;
    wire::writeNull(out, kPing, wire::kProgram);
    send(c, out);
}

void receive(Member& c) {
    char bytes[16384];
    ssize_t n = recv(c.fd, bytes, sizeof bytes, 0);
    if (n <= 0) wrong(c, "the daemon has closed the connection");
    c.in.append(bytes, std::size_t(n));
    record::Reader records(c.in.data(), c.in.size(), SIZE_MAX);
    for (std::string_view record; records.next(record);) take(c, record);
    c.in.erase(0, std::size_t(records.at() - c.in.data()));
}

// Serve all clients until this is true of each of them.
template <class Done> void until(std::vector<Member>& clients, Done done) {
    for (;;) {
        std::vector<pollfd> wanted;
        std::vector<Member*> whose;
        for (auto& c : clients) {
            if (done(c)) continue;
            wanted.push_back({c.fd, POLLIN, 0});
            whose.push_back(&c);
        }
        if (wanted.empty()) return;
        if (poll(wanted.data(), wanted.size(), kPatience) <= 0)
            throw std::runtime_error("nothing comes; " + std::to_string(wanted.size()) + " clients wait");
        for (std::size_t i = 0; i < wanted.size(); ++i)
            if (wanted[i].revents != 0) receive(*whose[i]);
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 5 || std::atoi(argv[3]) < 1 || std::atoi(argv[4]) < 1)
        return std::fputs("usage: crowd SOCKET OBJECT CLIENTS REQUESTS\n", stderr), 2;
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    try {
        std::vector<Member> clients(std::size_t(std::atoi(argv[3])));
        std::size_t requests = std::size_t(std::atoi(argv[4]));
        for (std::size_t i = 0; i < clients.size(); ++i) {
            clients[i].number = int(i);
            connect(clients[i], argv[1]);
        }
        until(clients, [](const Member& c) { return c.welcome; });
        for (auto& c : clients) begin(c, argv[2], requests);
        std::printf("sent %zu\n", clients.size() * requests);
        std::fflush(stdout);
        until(clients, [](const Member& c) { return c.over; });
        for (auto& c : clients) close(c.fd);
        std::printf("answered %zu\n", clients.size() * requests);
    } catch (const std::exception& e) {
        std::fprintf(stderr, "crowd: %s\n", e.what());
        return 1;
    }
    return 0;
}
