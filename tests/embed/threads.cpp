// threads.cpp FOLDER -- daemons and clients in threads of one process: everything that more than one thread touches.
//
// A daemon in a thread has services that answer from a worker thread, from a timer, and not at all for a while. Clients in other
// threads, each with a SORM of its own, use futures with and without an event loop. Built with
// ThreadSanitizer this is what CI runs; without, it is a test as any other. Prints "ok", or what went wrong.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bus/detached.h"
#include "comm/comm.h"
#include "comm/record.h"
#include "comm/wire.h"
#include "sorma.h"

using namespace sorma;

namespace {

std::mutex printing;
std::atomic<int> failures{0};

void check(bool right, const std::string& what) {
    if (right) return;
    ++failures;
    std::lock_guard lock(printing);
    std::printf("%s\n", what.c_str());
}

// Answers from a thread of its own, a moment later.
class Worker : public Service {
public:
    static Class describe() { return Class::of<Worker>("worker", "squares numbers in a thread").concurrency(Concurrency::concurrent); }
    void exec(Message& m) override {
        Reply reply = later(m);
        startDetached([reply] {
            for (double& x : reply.message().floats) x *= x;
            if (reply.message().text == "fail") reply.fail(std::runtime_error("as asked"));
            else if (reply.message().text != "drop") reply.complete();
        });
    }
};

// Answers from a timer, and publishes.
class Timer : public Service {
public:
    static Class describe() {
        return Class::of<Timer>("timer", "answers after so many seconds").real("-delay", &Timer::delay_, {}).concurrency(Concurrency::concurrent);
    }
    void exec(Message& m) override {
        Message event;
        event.text = m.text;
        publish("asked", event);
        Reply reply = later(m);
        ++begun_;
        auto timer = std::make_shared<::sorma::Timer>(
            sorm().loop().after(monotonicNow() + std::int64_t(delay_ * 1e9), [reply] { reply.complete(); }));
        reply.onCancel([this, timer] { timer->cancel(); ++cancelled_; });
    }
    void dumpState(std::string& out) const override { out += "# begun " + std::to_string(begun_) + " cancelled " + std::to_string(cancelled_); }

private:
    double delay_ = 0;
    int begun_ = 0, cancelled_ = 0;
};

// Keeps the daemon's thread for itself until it is told to stop, by nobody but the health responder.
class Busy : public Service {
public:
    static Class describe() { return Class::of<Busy>("busy", "computes until it is cancelled"); }
    void exec(Message&) override {
        while (!CallContext::current()->cancelled.load(std::memory_order_relaxed)) std::this_thread::yield();
    }
};

class Daemon {
public:
    explicit Daemon(std::string name) : name_(std::move(name)) {
        std::atomic<bool> ready{false};
        thread_ = std::thread([&] {
            Sorm sorm;
            for (auto describe : {Worker::describe, Timer::describe, Busy::describe}) sorm.add(describe());
            Comm comm(sorm);
            comm.settings.grace = 50;
            Server::Wanted wanted;
            wanted.name = name_;
            comm.serve(wanted);
            box_ = sorm.mailbox();
            ready = true;
            while (!ended_) comm.reactor().poll(-1);
        });
        while (!ready) std::this_thread::yield();
    }
    ~Daemon() {
        box_->post([this] { ended_ = true; });
        thread_.join();
    }
    const std::shared_ptr<Mailbox>& box() const { return box_; }

private:
    std::string name_;
    std::thread thread_;
    std::shared_ptr<Mailbox> box_;
    bool ended_ = false;                // of the daemon's thread
};

std::string codeOf(const std::function<void()>& body) {
    try {
        body();
    } catch (const Error& e) {
        return e.trail.cause()->symbol;
    }
    return "none";
}

// Futures without an event loop: begin many, do something else, collect.
void collects(const std::string& where) {
    Sorm sorm;
    Comm comm(sorm);
    Reference worker = sorm.get("worker@" + where);
    std::vector<Future> futures;
    for (int i = 0; i < 300; ++i) {
        Message m;
        m.floats = {double(i)};
        futures.push_back(worker->async(Method::exec, std::move(m)));
    }
    for (int i = 299; i >= 0; --i) check(futures[std::size_t(i)].wait().floats == std::vector{double(i) * i}, "a square is wrong");
    Message m;
    m.text = "fail";
    check(codeOf([&] { worker->exec(m); }) == "SERVICE FAILED", "a failure in a thread is told");
    m.text = "drop";
    check(codeOf([&] { worker->exec(m); }) == "SERVICE FAILED", "a dropped reply is told");
}

// Futures with callbacks, driven by the reactor; a subscription beside them.
void listens(const std::string& where) {
    Sorm sorm;
    Comm comm(sorm);
    Reference timer = sorm.get("timer@" + where);
    int events = 0, answers = 0;
    std::string mine = std::to_string(std::hash<std::thread::id>{}(std::this_thread::get_id()));
    auto listening = timer->listen("asked", 1000, [&](Received& e) { events += e.message.text == mine; });
    for (int i = 0; i < 100; ++i) {
        Message m;
        m.text = mine;
        timer->async(Method::exec, std::move(m)).then([&](Future f) { answers += f.result().text == mine; });
    }
    Deadline enough = Deadline::in(30'000);
    while ((events < 100 || answers < 100) && !enough.passed()) comm.reactor().poll(10'000'000);
    check(events == 100 && answers == 100, "events " + std::to_string(events) + ", answers " + std::to_string(answers) + ", not 100");
}

// Deadlines and cancellation reach the service.
void givesUp(const std::string& where) {
    Sorm sorm;
    Comm comm(sorm);
    std::string name = "timer.late@" + where;
    sorm.create(name, {"-delay", "3600"}, nullptr);
    Reference late = sorm.get(name);
    Deadline enough = Deadline::in(30'000);
    auto wait = [&](const char* what) {
        for (std::string dump; dump.find(what) == std::string::npos && !enough.passed();) {
            Message m;
            m.words = {"-dump"};
            late->invoke(Method::ctrl, m);
            dump = m.text;
        }
        check(!enough.passed(), std::string("the service has heard: ") + what);
    };
    // What is given up before it has begun is not begun: so it is waited for.
    Future timed = late->async(Method::exec, {}, Deadline::in(2000));
    wait("begun 1 ");
    check(codeOf([&] { timed.wait(); }) == "COMM TIMEOUT", "a deadline ends a call");
    wait("cancelled 1");
    Future f = late->async(Method::exec, {});
    wait("begun 2 ");
    check(f.cancel() && !f.cancel() && codeOf([&] { f.wait(); }) == "COMM CANCELLED", "a cancelled call says so");
    wait("cancelled 2");
    late->oneway(Method::exec, {});
}

// A daemon whose thread is taken answers for its health, greets newcomers, and hears of a cancellation.
void keepsBusy(const std::string& where) {
    Sorm sorm;
    Comm comm(sorm);
    Reference busy = sorm.get("busy@" + where);
    Future f = busy->async(Method::exec, {});
    {
        Sorm other;
        Comm otherComm(other);
        Reference sormThere = other.get("sorm@" + where, Probe::later);
        auto health = [&] { return static_cast<Proxy&>(*sormThere).connection().health(Deadline::in(20'000)); };
        wire::Health h = health();
        for (Deadline enough = Deadline::in(20'000); !h.busy && !enough.passed();) h = health();
        check(h.busy && h.what.starts_with("busy EXEC of "), "busy in \"" + h.what + "\"");
    }
    f.cancel();
    // The daemon's thread is free again when it answers this.
    Message m;
    m.words = {"-class"};
    busy->invoke(Method::dbx, m);
    check(!m.text.empty(), "the daemon goes on");
}

// A connection without a client: it asks for health, and reads the answers when it likes.
class Raw {
public:
    explicit Raw(const std::string& where) : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_un to{};
        to.sun_family = AF_UNIX;
        const std::string path = std::string(getenv("SORMA_RUNTIME_DIR")) + "/" + where + ".sock";
        path.copy(to.sun_path, sizeof to.sun_path - 1);
        check(connect(fd_, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0, "cannot connect to " + path);
    }
    ~Raw() { close(fd_); }
    void ask(std::uint32_t times) {
        Buffer out;
        for (std::uint32_t i = 0; i < times; ++i) wire::writeHealthRequest(out, i, wire::kProgram);
        check(send(fd_, out.data(), out.size(), MSG_NOSIGNAL) == ssize_t(out.size()), "cannot send");
    }
    void awaitAnswer() {
        pollfd wanted{fd_, POLLIN, 0};
        check(poll(&wanted, 1, 60'000) == 1, "nobody answers for the daemon");
    }
    std::size_t readAll(std::size_t answers) {
        Buffer in;
        for (std::size_t n = 0;; n = record::count(in)) {
            if (n >= answers) return n;
            awaitAnswer();
            char bytes[65536];
            const ssize_t got = recv(fd_, bytes, sizeof bytes, 0);
            if (got <= 0) return n;
            in.append(bytes, std::size_t(got));
        }
    }

private:
    int fd_;
};

// While a daemon's thread is elsewhere, the health responder queues answers that a peer does not read, and lets in others. Then
// the daemon's thread needs the lock to watch that peer. These numbers are relaxed, so that they order nothing.
void queuesMeanwhile(Daemon& daemon, const std::string& where) {
    std::atomic<int> begun{0}, released{0};
    auto post = [&](int until) {
        daemon.box()->post([&begun, &released, until] {
            begun.store(until, std::memory_order_relaxed);
            while (released.load(std::memory_order_relaxed) < until) std::this_thread::yield();
        });
    };
    auto await = [&](int which) {
        while (begun.load(std::memory_order_relaxed) < which) std::this_thread::yield();
    };
    Raw silent(where), other(where);
    post(1);
    await(1);
    post(2);                                    // before what the health responder posts
    silent.ask(2500);
    silent.awaitAnswer();
    other.ask(1);
    other.awaitAnswer();                        // then it has posted
    released.store(1, std::memory_order_relaxed);
    await(2);
    Raw newcomer(where);
    newcomer.ask(1);
    newcomer.awaitAnswer();
    released.store(2, std::memory_order_relaxed);
    check(silent.readAll(2500) == 2500, "who read late did not get each answer");
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: threads FOLDER\n"), 2;
    setenv("SORMA_RUNTIME_DIR", argv[1], 1);
    std::string where = "threads" + std::to_string(getpid()), second = where + "b";
    {
        Daemon daemon(where), other(second);
        std::vector<std::thread> clients;
        for (auto* d : {&where, &second})
            for (auto* client : {collects, listens, givesUp, collects, listens})
                clients.emplace_back([client, d] {
                    try {
                        client(*d);
                    } catch (const Error& e) {
                        check(false, e.trail.toText());
                    }
                });
        for (auto& c : clients) c.join();
        keepsBusy(where);
        keepsBusy(second);
        queuesMeanwhile(daemon, where);
    }
    if (failures == 0) std::puts("ok");
    return failures > 0;
}
