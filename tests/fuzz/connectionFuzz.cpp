// connectionFuzz.cpp -- a client's connection, and a daemon that says what it likes, when it likes.
//
// It sends a true welcome or none, answers to calls that were made or not, twice, cut, or with bytes changed. It sends events and a word
// of farewell, closes in the middle, and comes back as itself or as another. Yet each call is answered once at most, and nothing is left.
//
// The input is a program, as in serverFuzz.cpp. One thread: the calls are begun and the reactor brings them forward.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <vector>

#include "bus/sorm.h"
#include "comm/connection.h"
#include "comm/reactor.h"
#include "comm/wire.h"
#include "fuzz.h"

using namespace sorma;

namespace {

constexpr int kOperations = 60;

// Listens for all inputs at a name of the kernel's choice, which is no file: connections come by a socket pair of our own.
class Daemon {
public:
    Daemon() {
        char folder[] = "/tmp/sorma-fuzz-XXXXXX";
        demand(mkdtemp(folder) != nullptr, "no folder");
        folder_ = folder;
        path = folder_ + "/d";
        fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        sockaddr_un a{};
        a.sun_family = AF_UNIX;
        path.copy(a.sun_path, sizeof a.sun_path - 1);
        demand(bind(fd_, reinterpret_cast<sockaddr*>(&a), sizeof a) == 0 && ::listen(fd_, 64) == 0, "cannot listen");
    }
    ~Daemon() {
        close(fd_);
        unlink(path.c_str());
        rmdir(folder_.c_str());
    }
    void accept() {
        int c = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (c < 0) return;
        hangUp();
        line = c;
    }
    void hangUp() {
        if (line >= 0) close(line);
        line = -1;
    }
    void read() {
        char bytes[65536];
        while (line >= 0 && recv(line, bytes, sizeof bytes, MSG_DONTWAIT) > 0) {}
    }
    void say(const Buffer& out, Input& in, unsigned how) {
        if (line < 0) return;
        std::vector<char> bytes(out.data(), out.data() + out.size());
        for (unsigned i = how & 3; i > 0 && !bytes.empty(); --i) bytes[in.byte() % bytes.size()] = char(in.byte());
        if (how & 4) bytes.resize(bytes.size() - in.byte() % (bytes.size() + 1));
        (void)!send(line, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    void clear() {
        hangUp();
        for (int c; (c = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC)) >= 0;) close(c);
    }

    std::string path;
    int line = -1;

private:
    std::string folder_;
    int fd_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Daemon daemon;
    Input in(data, size);
    Sorm sorm;
    auto reactor = std::make_shared<Reactor>(sorm.mailbox());
    sorm.setLoop(reactor.get());
    auto settings = std::make_shared<Settings>();
    settings->maxMessage = 8192;
    settings->timeout = 1;               // [ms] a one-way request waits for the connection
    std::vector<int> answers;
    std::vector<std::unique_ptr<Listening>> listenings;
    {
        auto connection = std::make_shared<Connection>("fuzz", [] { return Address{Address::Kind::path, daemon.path, 0}; }, settings, reactor, sorm.mailbox());
        std::vector<PendingPointer> calls;
        std::uint64_t boot = 1;
        for (int i = 0; i < kOperations && !in.done(); ++i) {
            const unsigned operation = in.byte(), how = in.byte();
            Buffer out;
            switch (operation % 10) {
                case 0: {
                    auto pending = std::make_shared<Pending>(sorm, how & 1 ? Deadline::in(3'600'000) : Deadline(), nullptr, nullptr);
                    pending->message.text.assign(how, 'x');
                    answers.push_back(0);
                    pending->whenAnswered([&answers, n = answers.size() - 1] { demand(++answers[n] == 1, "answered twice"); });
                    calls.push_back(pending);
                    connection->begin(pending, "any.x", Method(how % 3));
                    break;
                }
                case 1:
                    if (!calls.empty()) Future(calls[how % calls.size()]).cancel();
                    break;
                case 2: daemon.accept(); break;
                case 3: {
                    wire::Welcome w{boot + (how & 8 ? in.byte() % 3 : 0), "fuzz", "u", "h", "p", 0, 0, 8192, how & 16 ? in.byte() : 4, (how & 32) != 0};
                    w.clocks = how & 64;
                    wire::writeWelcome(out, 0, w);
                    daemon.say(out, in, how & 128 ? how : 0);
                    break;
                }
                case 4: {                                   // an answer: slot and number, often those of a call
                    Message m;
                    m.code = how & 8 ? -1 : 0;
                    m.text.assign(in.byte() * (how & 16 ? 40u : 1u), 'y');
                    m.ints = {1, 0, 1};
                    if (how & 32) m.trail.add(Entry{});
                    wire::writeReply(out, std::uint32_t(1 + in.byte() % 4) << 16 | in.byte() % 5, {}, m);
                    daemon.say(out, in, how & 128 ? how : 0);
                    break;
                }
                case 5: wire::writeGoodbye(out, "as asked"), daemon.say(out, in, how); break;
                case 6: {
                    Buffer body;
                    wire::writeEventBody(body, {0, how & 8 ? "sorma.gone" : "e", 0}, {});
                    wire::writeEvent(out, {in.byte() % 3u, how, 0}, body);
                    daemon.say(out, in, how);
                    break;
                }
                case 7: daemon.read(), daemon.hangUp(); break;
                case 8: connection->oneway("any.x", Method::exec, {}); break;
                default: reactor->poll(how & 1 ? 3'000'000 : 0); break;
            }
            reactor->poll(0);
        }
        for (auto& call : calls) Future(call).cancel();
        connection->end();
    }
    daemon.clear();
    for (int i = 0; i < 100 && reactor->poll(0) > 0; ++i) {}
    for (int n : answers) demand(n == 1, "a call was not answered though it was cancelled");
    sorm.setLoop(nullptr);
    return 0;
}
