// rings.cpp -- comm/ring.h by itself, and ends of it that lie.
//
// rings alone BYTES SEED: one thread writes so many bytes in pieces of any size, the other one reads them. Both sleep when there is
// nothing to do, by a bell or at a futex, until the other one wakes them. Pages are given back meanwhile. Prints "BYTES bytes"; or what
// is wrong.
// rings dozes: a reader dozes until its time is over, then until its line has ended. Then a process that was forked does. Prints
// "the parent late ended", and the same of the child.
//
// rings offers SOCKET: offers a daemon memory that it must not take. Prints each answer, and "clear" when it serves the line all the same.
//
// rings hostile SOCKET LINES CHANGES SEED: agrees on memory with a daemon, and changes it anywhere. It does so until the daemon has ended so
// many lines, and there were so many changes. Prints "CHANGES changes LINES lines", as many as there were.
//
// rings killed SOCKET COUNT SEED: so many processes call a daemon by memory, each is killed at any instant. Prints "COUNT killed".
#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

#include "bus/deadline.h"
#include "bus/descriptor.h"
#include "comm/lookout.h"
#include "comm/ring.h"
#include "comm/wire.h"

namespace {

using namespace sorma;
using Dice = std::mt19937_64;

void check(bool good, const char* what) {
    if (!good) throw std::runtime_error(what);
}

struct Rings {
    RingMemory toDaemon, toClient;
};
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

Descriptor memoryOf(std::size_t size, int seals) {
    Descriptor fd(memfd_create("rings", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    check(fd && ftruncate(fd.get(), off_t(size)) == 0 && (seals == 0 || fcntl(fd.get(), F_ADD_SEALS, seals) == 0), "no memory");
    return fd;
}

Rings* map(const Descriptor& memory) {
    void* at = mmap(nullptr, sizeof(Rings), PROT_READ | PROT_WRITE, MAP_SHARED, memory.get(), 0);
    check(at != MAP_FAILED, "no memory");
    return static_cast<Rings*>(at);
}

// ---- alone ----

struct Bell {
    Descriptor fd{eventfd(0, EFD_CLOEXEC)};
    void ring() {
        const std::uint64_t one = 1;
        check(write(fd.get(), &one, sizeof one) == sizeof one, "a bell does not ring");
    }
    void wait() {
        pollfd p{fd.get(), POLLIN, 0};
        check(poll(&p, 1, 60'000) == 1, "nobody wakes it");
        std::uint64_t rung;
        check(read(fd.get(), &rung, sizeof rung) == sizeof rung, "a bell is not heard");
    }
};

char byteAt(std::uint64_t at) { return char(at * 0x9e3779b97f4a7c15 >> 56); }

void writeAll(RingMemory& memory, Bell& mine, Bell& other, std::uint64_t bytes, std::uint64_t seed) {
    RingWriter ring(memory);
    Dice dice(seed);
    std::vector<char> piece;
    for (std::uint64_t at = 0; at < bytes;) {
        piece.resize(std::min<std::uint64_t>(bytes - at, 1 + dice() % (dice() % 8 == 0 ? 3 * RingMemory::kSize : 300)));
        for (std::size_t i = 0; i < piece.size(); ++i) piece[i] = byteAt(at + i);
        for (std::size_t done = 0; done < piece.size();) {
            const auto n = ring.put(piece.data() + done, piece.size() - done);
            check(n >= 0, "the reader's count makes no sense");
            if (n > 0 && ring.wakes()) other.ring();
            if (dice() % 16 == 0) ring.rest();
            if (n == 0 && ring.waits()) mine.wait();
            done += std::size_t(n);
        }
        at += piece.size();
    }
}

void readAll(RingMemory& memory, Bell& mine, Bell& other, std::uint64_t bytes, std::uint64_t seed) {
    RingReader ring(memory);
    Dice dice(seed);
    std::vector<char> room(RingMemory::kSize);
    for (std::uint64_t at = 0; at < bytes;) {
        const auto n = ring.take(room.data(), 1 + dice() % room.size());
        check(n >= 0, "the writer's count makes no sense");
        for (std::size_t i = 0; i < std::size_t(n); ++i) check(room[i] == byteAt(at + i), "a byte is another one");
        at += std::uint64_t(n);
        if (n > 0 && ring.wakes()) other.ring();
        if (n > 0) continue;
        if (dice() % 2 == 0) ring.doze([] { return false; });
        else if (ring.sleeps()) mine.wait();
    }
}

void alone(std::uint64_t bytes, std::uint64_t seed) {
    const Descriptor file = memoryOf(sizeof(Rings), kSeals);
    RingMemory* const memory = &map(file)->toDaemon;
    Bell writer, reader;
    std::string wrong;
    std::thread writes([&] {
        try {
            writeAll(*memory, writer, reader, bytes, seed);
        } catch (const std::exception& e) {
            wrong = e.what();
        }
    });
    try {
        readAll(*memory, reader, writer, bytes, seed + 1);
    } catch (...) {
        writes.detach();
        throw;
    }
    writes.join();
    if (!wrong.empty()) throw std::runtime_error(wrong);
    std::printf("%llu bytes\n", static_cast<unsigned long long>(bytes));
}

// ---- dozing ----

std::string dozes() {
    const Descriptor file = memoryOf(sizeof(Rings), kSeals);
    RingReader reader(map(file)->toClient);
    int line[2];
    check(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, line) == 0, "no line");
    const Descriptor mine(line[0]);
    Descriptor other(line[1]);
    Dozer dozer(mine.get(), reader.mark());
    std::string said;
    const auto doze = [&](std::int64_t until) {
        dozer.begin(until);
        reader.doze([&] { return dozer.called(); });
        check(dozer.called(), "it was woken by nobody");
        dozer.end();
        said += dozer.ended() ? " ended" : monotonicNow() >= until ? " late" : " early";
    };
    doze(monotonicNow() + 20'000'000);
    std::thread closes([&] { other.close(); });
    doze(monotonicNow() + 60'000'000'000);
    closes.join();
    return said;
}

void forked() {
    std::printf("the parent%s\n", dozes().c_str());
    std::fflush(stdout);
    const pid_t child = fork();
    check(child >= 0, "no process");
    if (child == 0) {
        std::printf("the child%s\n", dozes().c_str());
        std::fflush(stdout);
        _exit(0);
    }
    int status = 0;
    check(waitpid(child, &status, 0) == child && status == 0, "the child has failed");
}

// ---- against a daemon ----

Descriptor reach(const char* path) {
    Descriptor fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_un a{};
    a.sun_family = AF_UNIX;
    std::strncpy(a.sun_path, path, sizeof a.sun_path - 1);
    check(connect(fd.get(), reinterpret_cast<sockaddr*>(&a), sizeof a) == 0, "nobody listens");
    return fd;
}

// The answer; 0: there is none.   memory: -1: none is sent.
char offer(int fd, int memory) {
    char text[] = {'S', 'h', 'm', '1'};
    iovec bytes{text, sizeof text};
    alignas(cmsghdr) char room[CMSG_SPACE(sizeof memory)] = {};
    msghdr message{};
    message.msg_iov = &bytes;
    message.msg_iovlen = 1;
    if (memory >= 0) {
        message.msg_control = room;
        message.msg_controllen = sizeof room;
        cmsghdr* head = CMSG_FIRSTHDR(&message);
        head->cmsg_len = CMSG_LEN(sizeof memory);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        std::memcpy(CMSG_DATA(head), &memory, sizeof memory);
    }
    check(sendmsg(fd, &message, MSG_NOSIGNAL) == sizeof text, "it takes no offer");
    char answer = 0;
    return recv(fd, &answer, 1, 0) == 1 ? answer : '\0';
}

bool servesInClear(int fd) {
    Buffer out;
    wire::writeNull(out, 7, wire::kProgram);
    char reply[28];
    return send(fd, out.data(), out.size(), MSG_NOSIGNAL) == ssize_t(out.size()) && recv(fd, reply, sizeof reply, MSG_WAITALL) == sizeof reply;
}

void offers(const char* path) {
    const Descriptor unsealed = memoryOf(sizeof(Rings), 0), small = memoryOf(4096, kSeals), large = memoryOf(sizeof(Rings) + 4096, kSeals);
    const Descriptor device(open("/dev/zero", O_RDWR | O_CLOEXEC));
    const std::pair<const char*, int> all[] = {{"none", -1}, {"unsealed", unsealed.get()}, {"small", small.get()}, {"large", large.get()}, {"device", device.get()}};
    for (auto& [what, memory] : all) {
        const Descriptor line = reach(path);
        const char answer = offer(line.get(), memory);
        std::printf("%s %c %s\n", what, answer ? answer : '-', servesInClear(line.get()) ? "clear" : "closed");
    }
}

class Liar {
public:
    explicit Liar(const char* path) : line_(reach(path)) {
        const Descriptor memory = memoryOf(sizeof(Rings), kSeals);
        rings_ = map(memory);
        writer_ = std::make_unique<RingWriter>(rings_->toDaemon);
        check(offer(line_.get(), memory.get()) == 'Y', "the daemon takes no memory");
    }
    ~Liar() { munmap(rings_, sizeof(Rings)); }
    // False: the daemon has closed the line.
    bool goOn(Dice& dice) {
        if (dice() % 4 == 0) ask(dice);
        else spoil(dice);
        if (dice() % 2 == 0) (void)send(line_.get(), "!", 1, MSG_NOSIGNAL | MSG_DONTWAIT);
        char bells[256];
        return recv(line_.get(), bells, sizeof bells, MSG_DONTWAIT) != 0;
    }

private:
    void ask(Dice& dice) {
        Buffer out;
        if (dice() % 2 == 0) wire::writeNull(out, 7, wire::kProgram);
        else wire::writeHello(out, 1, wire::kProgram, {dice(), "u", "h", "p", 1, 1 << 20});
        (void)writer_->put(out.data(), out.size());
    }
    void spoil(Dice& dice) {
        RingMemory& r = dice() % 2 == 0 ? rings_->toDaemon : rings_->toClient;
        const std::uint64_t values[] = {0, 1, dice() % (2 * RingMemory::kSize), dice(), UINT64_MAX, RingMemory::kSize};
        switch (dice() % 5) {
            case 0: r.written = values[dice() % 6]; break;
            case 1: r.taken = values[dice() % 6]; break;
            case 2: r.reader = std::uint32_t(values[dice() % 6]); break;
            case 3: r.writer = std::uint32_t(values[dice() % 6]); break;
            default: r.bytes[dice() % RingMemory::kSize] = char(dice());
        }
    }
    const Descriptor line_;
    Rings* rings_ = nullptr;
    std::unique_ptr<RingWriter> writer_;
};

void hostile(const char* path, long lines, long changes, std::uint64_t seed) {
    Dice dice(seed);
    long ended = 0, changed = 0;
    for (; ended < lines || changed < changes; ++ended) {
        Liar liar(path);
        for (++changed; liar.goOn(dice); ++changed) {}
    }
    std::printf("%ld changes %ld lines\n", changed, ended);
}

// Calls by memory, in pieces of any size, until it is killed.
[[noreturn]] void call(const char* path, std::uint64_t seed) {
    Dice dice(seed);
    const Descriptor line = reach(path), memory = memoryOf(sizeof(Rings), kSeals);
    Rings* const rings = map(memory);
    if (offer(line.get(), memory.get()) != 'Y') _exit(1);
    RingWriter writer(rings->toDaemon);
    RingReader reader(rings->toClient);
    const auto bell = [&] { (void)send(line.get(), "!", 1, MSG_NOSIGNAL | MSG_DONTWAIT); };
    Buffer out;
    wire::writeHello(out, 1, wire::kProgram, {dice(), "u", "h", "p", 1, 1 << 20});
    for (std::uint32_t xid = 2;; ++xid) {
        for (std::size_t done = 0; done < out.size();) {
            const auto n = writer.put(out.data() + done, std::min<std::size_t>(1 + dice() % 64, out.size() - done));
            if (n < 0) _exit(2);
            done += std::size_t(n);
            if (writer.wakes()) bell();
        }
        char room[1000];
        for (std::ptrdiff_t n = 0; n == 0;) {
            n = reader.take(room, 1 + dice() % sizeof room);
            if (n < 0) _exit(3);
            if (reader.wakes()) bell();
            if (n != 0) continue;
            writer.rest();
            if (dice() % 2 == 0) {
                reader.doze([] { return false; });
            } else if (reader.sleeps()) {
                if (recv(line.get(), room, sizeof room, 0) <= 0) _exit(4);
                reader.awake();
            }
        }
        out.release();
        wire::writeNull(out, xid, wire::kProgram);
    }
}

void killed(const char* path, long count, std::uint64_t seed) {
    Dice dice(seed);
    for (long i = 0; i < count; ++i) {
        const pid_t child = fork();
        check(child >= 0, "no process");
        if (child == 0) call(path, seed + std::uint64_t(i));
        usleep(useconds_t(dice() % 2000));
        check(kill(child, SIGKILL) == 0, "it cannot be killed");
        int status = 0;
        check(waitpid(child, &status, 0) == child && WIFSIGNALED(status), "a caller has ended by itself");
    }
    std::printf("%ld killed\n", count);
}

}  // namespace

int main(int argc, char** argv) {
    const std::string what = argc > 1 ? argv[1] : "";
    try {
        if (what == "alone" && argc == 4) return alone(std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10)), 0;
        if (what == "dozes" && argc == 2) return forked(), 0;
        if (what == "offers" && argc == 3) return offers(argv[2]), 0;
        if (what == "hostile" && argc == 6) return hostile(argv[2], std::atol(argv[3]), std::atol(argv[4]), std::strtoull(argv[5], nullptr, 10)), 0;
        if (what == "killed" && argc == 5) return killed(argv[2], std::atol(argv[3]), std::strtoull(argv[4], nullptr, 10)), 0;
    } catch (const std::exception& e) {
        std::printf("%s: %s\n", what.c_str(), e.what());
        return 1;
    }
    std::fputs("usage: rings alone BYTES SEED | dozes | offers SOCKET | hostile SOCKET LINES CHANGES SEED | killed SOCKET COUNT SEED\n", stderr);
    return 2;
}
