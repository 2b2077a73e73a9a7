// garbage.cpp -- records that are not what they were: bytes changed, cut off or added, words at their limits, or anything.
//
//     garbage PORT COUNT SEED      a client: sends so many by TCP to a daemon
//     garbage -serve COUNT SEED    a daemon: says "port N", and sends so many to its clients
//
// The client sends records of every procedure, takes answers without looking at them, and connects anew when the daemon has had enough.
// The daemon greets clients, answers most calls, and sends such records with each answer. It also ends with its standard input. Both print "records N connections N" at the end.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <utility>

#include "comm/wire.h"

namespace {

using namespace sorma;

class Dice {
public:
    explicit Dice(std::uint64_t seed) : engine_(seed) {}
    std::uint32_t operator()(std::uint32_t below) { return std::uint32_t(engine_() % below); }
    std::uint32_t word() { return std::uint32_t(engine_()); }

private:
    std::mt19937_64 engine_;
};

sockaddr_in loopback(int port) {
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_port = htons(std::uint16_t(port));
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return a;
}

// One record. Its mark is seldom touched: behind a wrong one everything is lost.
void spoil(Buffer& record, Dice& dice) {
    const std::size_t first = dice(500) == 0 ? 0 : record::kMarkSize;
    auto somewhere = [&] { return first + dice(std::uint32_t(record.size() - first)); };
    if (record.size() <= first) return;
    switch (dice(7)) {
        case 0: return;
        case 1:
            for (auto n = 1 + dice(4); n > 0; --n) record.data()[somewhere()] = char(dice.word());
            return;
        case 2: record.data()[somewhere()] ^= char(1 << dice(8)); return;
        case 3: {
            static const std::uint32_t limits[] = {0, 1, 2, 0x7fffffff, 0x80000000, 0xffffffff, 0xfffffffc, 0x10000};
            XdrWriter::put(record.data() + (somewhere() & ~std::size_t{3}), limits[dice(8)]);
            return;
        }
        case 4: record.resize(std::max(first, somewhere())); break;
        case 5:
            for (auto n = dice(64); n > 0; --n) *record.extend(1) = char(dice.word());
            break;
        default:
            record.resize(record::kMarkSize + dice(200));
            for (std::size_t i = record::kMarkSize; i < record.size(); ++i) record.data()[i] = char(dice.word());
    }
    if (first > 0) record::close(record, 0);
}

Message message(Dice& dice) {
    Message m;
    m.text.assign(dice(20), 't');
    m.floats.resize(dice(4));
    m.ints.resize(dice(4));
    m.any.resize(dice(4));
    return m;
}

// ---- to a daemon ----

void request(Buffer& out, Dice& dice) {
    static const char* const names[] = {"nop", "echo", "echo.a", "foo.a", "sorm", "dict", "none.a"};
    static const char* const words[] = {"-help", "-dump", "-tempo", "-info", "-inventory", "presto", "x"};
    const std::uint32_t xid = dice.word();
    switch (dice(12)) {
        case 0: return wire::writeHello(out, xid, wire::kProgram, {1 + dice(8), "u", "h", "p", 1, 60'000, "a clock", 5});
        case 1: return wire::writeSubscribe(out, xid, wire::kProgram, {dice(9), names[dice(7)], "*", dice(9)});
        case 2: return wire::writeUnsubscribe(out, wire::kProgram, dice(9));
        case 3: return wire::writeCancel(out, wire::kProgram, {dice(4), dice(100)});
        case 4: return wire::writeHealthRequest(out, xid, wire::kProgram);
        case 5: return wire::writeClock(out, wire::kProgram, std::int64_t(dice.word()));
        default: {
            Message m = message(dice);
            const Method method = dice(8) == 0 ? (dice(2) ? Method::ctrl : Method::dbx) : Method::exec;
            for (auto n = method == Method::exec ? 0 : dice(4); n > 0; --n) m.words.push_back(words[dice(7)]);
            wire::Behalf behalf{dice(2) == 1, dice.word(), "somebody"};
            wire::writeCall(out, xid, wire::kProgram, {dice(2) ? wire::kNoSlot : dice(4), dice(100), 0, method, names[dice(7)]}, m,
                            dice(8) == 0 ? wire::kOneway : wire::kCall, dice(4) == 0 ? &behalf : nullptr);
        }
    }
}

int attack(int port, long count, Dice dice) {
    const sockaddr_in to = loopback(port);
    static char dropped[1 << 16];
    long sent = 0, before = 0, connections = 0;     // before: in the last batch, which counts when the daemon has taken another one
    for (int fd = -1; sent < count;) {
        if (fd < 0) {
            before = 0;
            fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
            if (connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) < 0) return std::perror("garbage: cannot connect"), 1;
            ++connections;
        }
        Buffer batch;
        int records = 0;
        for (; batch.size() < 4096; ++records) {
            Buffer record;
            request(record, dice);
            spoil(record, dice);
            batch.append(record.data(), record.size());
        }
        for (std::size_t at = 0; fd >= 0 && at < batch.size();) {
            pollfd p{fd, POLLIN | POLLOUT, 0};
            if (poll(&p, 1, 60'000) <= 0) return std::fputs("garbage: the daemon takes nothing\n", stderr), 1;
            ssize_t n = 1;
            if (p.revents & POLLIN) n = recv(fd, dropped, sizeof dropped, MSG_DONTWAIT);
            if (n > 0 && p.revents & POLLOUT && (n = send(fd, batch.data() + at, batch.size() - at, MSG_DONTWAIT | MSG_NOSIGNAL)) > 0)
                at += std::size_t(n);
            if (n == 0 || (n < 0 && errno != EAGAIN)) close(std::exchange(fd, -1));
        }
        if (fd >= 0) sent += std::exchange(before, records);
    }
    std::printf("records %ld connections %ld\n", sent, connections);
    return 0;
}

// ---- to a client ----

void answer(Buffer& out, std::uint32_t xid, Dice& dice) {
    switch (dice(8)) {
        case 0: {
            Buffer body;
            wire::writeEventBody(body, {1, dice(9) == 0 ? "sorma.gone" : "told"}, message(dice));
            return wire::writeEvent(out, {1 + dice(3), dice.word(), dice(3)}, body);
        }
        case 1: return wire::writeRefusal(out, xid, wire::Refusal(1 + dice(4)));
        case 2: return wire::writeEmptyReply(out, xid);
        default: {
            Message m = message(dice);
            m.code = dice(4) == 0 ? -1 : 0;
            for (auto n = dice(8) == 0 ? dice(4) : 0; n > 0; --n) m.trail.add({Severity(dice(3)), "GARBAGE SAYS", {"d"}, "text", "so", "daemon", "f.cpp", 1, 1, {}});
            return wire::writeReply(out, xid, {1, 2, 3}, m);
        }
    }
}

int serve(long count, Dice dice) {
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in at = loopback(0);
    socklen_t size = sizeof at;
    if (bind(listener, reinterpret_cast<sockaddr*>(&at), size) < 0 || listen(listener, 64) < 0) return std::perror("garbage: cannot listen"), 1;
    getsockname(listener, reinterpret_cast<sockaddr*>(&at), &size);
    std::printf("port %d\n", ntohs(at.sin_port));
    std::fflush(stdout);
    long sent = 0, connections = 0;
    while (sent < count) {
        pollfd wanted[] = {{listener, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (poll(wanted, 2, -1) < 0 || wanted[1].revents != 0) return 1;
        int fd = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
        if (fd < 0) return std::perror("garbage: cannot accept"), 1;
        ++connections;
        Buffer in;
        long records = 0;                               // they count when the client has sent more
        while (sent < count) {
            ssize_t n = recv(fd, in.extend(65536), 65536, 0);
            in.resize(in.size() - 65536 + std::size_t(std::max<ssize_t>(n, 0)));
            if (n <= 0) break;
            sent += std::exchange(records, 0);
            Buffer out;
            std::size_t done = 0;
            for (record::Piece piece; (piece = record::front(in.data() + done, in.data() + in.size())).whole;) {
                XdrReader r(piece.text());
                done += piece.size();
                auto envelope = wire::readEnvelope(r);
                auto header = wire::readCallHeader(r, envelope.xid);
                if (header.procedure == wire::kHello) {
                    wire::writeWelcome(out, header.xid, {1, "garbage", "u", "h", "p", 0, 1, 60'000, 200, true});
                    continue;
                }
                if (header.procedure != wire::kCall && header.procedure != wire::kSubscribe && header.procedure != wire::kHealth) continue;
                // Slots are the low bits: most of what follows is for one of ours.
                for (auto k = dice(40); k > 0; --k, ++records) {
                    Buffer record;
                    answer(record, dice(4) == 0 ? header.xid : (1 + dice(200)) << 16 | dice(40), dice);
                    spoil(record, dice);
                    out.append(record.data(), record.size());
                }
                if (dice(64) == 0) continue;
                Message m;
                if (header.procedure == wire::kSubscribe) m.ints = {0, 0, 0};
                wire::writeReply(out, header.xid, {}, m);
                ++records;
            }
            in.drop(done);
            std::size_t taken = 0;
            while (taken < out.size() && (n = send(fd, out.data() + taken, out.size() - taken, MSG_NOSIGNAL)) > 0) taken += std::size_t(n);
            if (taken < out.size()) break;
        }
        close(fd);
    }
    std::printf("records %ld connections %ld\n", sent, connections);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return std::fputs("usage: garbage PORT|-serve COUNT SEED\n", stderr), 2;
    const long count = std::atol(argv[2]);
    Dice dice(std::strtoull(argv[3], nullptr, 0));
    return std::strcmp(argv[1], "-serve") == 0 ? serve(count, dice) : attack(std::atoi(argv[1]), count, dice);
}
