// lifetimes.cpp FOLDER -- what is kept, cancelled or removed at a moment that callers seldom choose. FOLDER is the runtime
// folder. Exits 0 when all is well; AddressSanitizer sees more of it.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>

#include "comm/clock.h"
#include "comm/comm.h"
#include "comm/wire.h"
#include "sorma.h"

using namespace sorma;

namespace {

int failures = 0;

void check(bool right, const std::string& what) {
    if (right) return;
    std::printf("%s\n", what.c_str());
    ++failures;
}

int removed = 0;

// Removes itself while it is being removed.
class Leaver : public Service {
public:
    static Class describe() { return Class::of<Leaver>("leaver", "removes itself when it is removed"); }
    void exec(Message&) override {}
    void removing() override {
        if (++removed < 10) sorm().remove(name(), sorma::Permit::owner());
    }
};

void removesOnce(Sorm& sorm) {
    sorm.get("leaver.a");
    sorm.alias("leaver.b", "leaver.a", nullptr);
    sorm.remove("leaver.a", sorma::Permit::owner());
    check(removed == 1, "removing() was called " + std::to_string(removed) + " times");
    check(!sorm.find("leaver.a") && !sorm.find("leaver.b"), "a name of it is left");
}

// A context that is kept after its caller has cancelled it is cancelled; so is what is begun in it.
void staysCancelled(Sorm& sorm) {
    Reference leaver = sorm.get("leaver.c");
    const ClientPointer client;
    const std::string nobody;
    CallContext context(client, {}, 0, nobody);
    context.cancel();
    check(CallContext::keep()->cancelled(), "a call that was cancelled before it was kept is not cancelled");
    Future future = leaver->async(Method::exec, {});
    check(future.pending()->failed() && Error(future.pending()->failure).is("COMM CANCELLED"), "what it begins then goes on");
}

// A deadline is within 25 days of its mark, also when the peer says nonsense of its clock.
void boundsClocks() {
    constexpr std::int64_t kDays = 25 * 86'400'000'000'000;
    const std::int64_t arrived[] = {1, 1'000'000'000'000, 40'000'000'000'000};
    const std::int64_t sent[] = {INT64_MIN, INT64_MIN + 1, -1, 0, 1, 999'000'000'000, INT64_MAX / 4, INT64_MAX / 2, INT64_MAX - 1, INT64_MAX};
    const std::uint32_t marks[] = {1, 2, 0x7fffffff, 0x80000000, 0xffffffff};
    for (std::int64_t first : sent)
        for (std::int64_t second : sent)
            for (std::int64_t now : arrived)
                for (std::uint32_t mark : marks) {
                    PeerClock clock;
                    clock.sample(first, now);
                    clock.sample(second, now + 11'000'000'000);
                    std::int64_t when = clock.deadline(mark, now).when();
                    bool near = when < now ? std::uint64_t(now) - std::uint64_t(when) < kDays : std::uint64_t(when) - std::uint64_t(now) < kDays;
                    check(near, "clock " + std::to_string(first) + ", then " + std::to_string(second) + ": mark " + std::to_string(mark) +
                                    " came at " + std::to_string(now) + " and means " + std::to_string(when));
                }
    PeerClock silent;
    check(silent.deadline(7, 1'000'000).when() == 7'000'000, "without a word of its clock a peer's time is ours");
}

// ---- a daemon and its peer in one thread: the peer writes, then the daemon has its turn ----

bool freed = false;
std::function<void()> whileItWaits, whenCancelled;

void turnUntilFreed(Sorm& sorm) {
    for (Deadline enough = Deadline::in(10'000); !freed && !enough.passed();) sorm.turn(Deadline::in(10));
}

// Serves other requests until one of them frees it; then it fails, as after a call to another process.
class Waits : public Service {
public:
    static Class describe() { return Class::of<Waits>("waits", "serves others until it is freed, and fails").concurrency(Concurrency::concurrent); }
    void exec(Message&) override {
        if (whileItWaits) std::exchange(whileItWaits, nullptr)();
        turnUntilFreed(sorm());
        CallContext::current()->subTime += 5;
        throw std::runtime_error("it has waited");
    }
};

class Frees : public Service {
public:
    static Class describe() { return Class::of<Frees>("frees", "frees who waits").concurrency(Concurrency::concurrent); }
    void exec(Message&) override { freed = true; }
};

// Answers when it is cancelled, and serves others before.
class Pauses : public Service {
public:
    static Class describe() { return Class::of<Pauses>("pauses", "waits to be cancelled").concurrency(Concurrency::concurrent); }
    void exec(Message& m) override {
        Reply reply = later(m);
        reply.onCancel([this] {
            if (whenCancelled) whenCancelled();
            turnUntilFreed(sorm());
        });
        kept_ = reply;
    }

private:
    std::optional<Reply> kept_;
};

class Peer {
public:
    explicit Peer(const std::string& path) : fd_(socket(AF_UNIX, SOCK_STREAM, 0)) {
        int size = 1 << 20;
        setsockopt(fd_, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
        sockaddr_un a{};
        a.sun_family = AF_UNIX;
        std::memcpy(a.sun_path, path.data(), std::min(path.size(), sizeof a.sun_path - 1));
        check(connect(fd_, reinterpret_cast<sockaddr*>(&a), sizeof a) == 0, "cannot connect to " + path);
    }
    ~Peer() { ::close(fd_); }
    void say(const Buffer& bytes) { check(write(fd_, bytes.data(), bytes.size()) == ssize_t(bytes.size()), "cannot write"); }
    // All that has come when the daemon has sent so many records.
    std::string heard(Sorm& sorm, int records) {
        for (Deadline enough = Deadline::in(10'000); count() < records && !enough.passed();) {
            sorm.turn(Deadline::in(10));
            char bytes[4096];
            ssize_t n = recv(fd_, bytes, sizeof bytes, MSG_DONTWAIT);
            if (n > 0) came_.append(bytes, std::size_t(n));
        }
        check(count() == records, std::to_string(count()) + " records came, not " + std::to_string(records));
        return came_;
    }

private:
    int count() const {
        int n = 0;
        std::string_view record;
        for (record::Reader records(came_.data(), came_.size(), SIZE_MAX); records.next(record);) ++n;
        return n;
    }

    int fd_;
    std::string came_;
};

// While a long request runs others are served, out of the buffer in which its bytes are. Its name is still right in the
// trail.
void namesLongRequests(Sorm& sorm, const std::string& socket) {
    freed = false;
    Peer peer(socket);
    Message m;
    m.text = std::string(70'000, 'x');
    Buffer hello, bytes;
    wire::writeHello(hello, 9, wire::kProgram, {4710, "somebody", "somewhere", "lifetimes", 1, 1 << 20, {}, 0});   // long records need it
    peer.say(hello);
    peer.heard(sorm, 1);
    wire::writeCall(bytes, 1, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, "waits.long"}, m);
    wire::writeCall(bytes, 2, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, "frees.all.others"}, m);
    peer.say(bytes);
    check(peer.heard(sorm, 3).find("waits.long: a call that it made has failed") != std::string::npos, "the request has lost its name");
}

// A call that waits is cancelled. A callback of that serves a call of the same client, for which its session gets more
// slots.
void cancelsBesideNewSlots(Sorm& sorm, const std::string& socket) {
    freed = false;
    Peer peer(socket);
    Buffer bytes, cancel, another;
    wire::writeHello(bytes, 1, wire::kProgram, {4711, "somebody", "somewhere", "lifetimes", 1, 1 << 20, {}, 0});
    wire::writeCall(bytes, 2, wire::kProgram, {0, 1, 0, Method::exec, "waits.cancelled"}, {});
    wire::writeCancel(cancel, wire::kProgram, {0, 1});
    wire::writeCall(another, 3, wire::kProgram, {40, 1, 0, Method::exec, "frees"}, {});
    Future begun;
    whileItWaits = [&] {
        begun = sorm.get("pauses")->async(Method::exec, {});
        sorm.turn(Deadline::in(10));
        peer.say(cancel);
    };
    whenCancelled = [&] { peer.say(another); };
    peer.say(bytes);
    peer.heard(sorm, 3);
    whenCancelled = nullptr;
    check(begun.pending()->failed(), "what it had begun was not cancelled with it");
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: lifetimes FOLDER\n"), 2;
    setenv("SORMA_RUNTIME_DIR", argv[1], 1);
    Sorm sorm;
    for (auto describe : {Leaver::describe, Waits::describe, Frees::describe, Pauses::describe}) sorm.add(describe());
    removesOnce(sorm);
    staysCancelled(sorm);
    boundsClocks();
    Comm comm(sorm);
    Server::Wanted wanted;
    wanted.name = "lifetimes" + std::to_string(getpid());
    const std::string socket = comm.serve(wanted).socket();
    namesLongRequests(sorm, socket);
    cancelsBesideNewSlots(sorm, socket);
    return failures == 0 ? 0 : 1;
}
