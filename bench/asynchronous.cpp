// asynchronous.cpp -- what need not wait: futures, events, and requests to an object that is at work.
#include "rows.h"

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "interpreter.h"
#include "process.h"
#include "remote.h"
#include "subscribers.h"

namespace bench {

namespace {

using sorma::Message;
using sorma::Method;

constexpr std::int64_t kBatch = 1'000'000, kLong = 20'000'000;
constexpr int kProcesses = 10, kEach = 10, kSubscribers = kProcesses * kEach;
constexpr int kEvents = 200;                    // that one CTRL publishes
constexpr int kFew = 100, kMany = 10'000;       // calls under way
constexpr int kCancelled = 16;                  // in one operation
constexpr double kMostBytes = 1000;             // of the caller's memory for a pending future
constexpr double kDelivery = 1e9 / 150'000, kDeliveryByMemory = 120;        // [ns]

constexpr std::int64_t kTimer = 5'000'000;      // [ns]
constexpr int kInFlight = 64;

constexpr const char* kRaw = "raw sockets, as many bytes to ten processes";

const Case kFuture = {"FUTURE_unix", "Tcl: async nop@robot EXEC, wait, destroy", "nop@robot EXEC in the same interpreter", 1.3, 0, 0,
                      Interpreter::kUnrolled, kBatch};
const Case kBusy = {"CTRL_busy", "CTRL of an object whose EXEC is under way", "CTRL of an idle one", 2, 0, 0, 1, kBatch};
const Case kLate = {"TIMER_busy", "lateness of a 5 ms timer, p99; 64 calls in flight", "of an idle daemon; one CPU", 0, 0, 0, 1, 50'000'000, 3};
const std::vector<Case> kStreams = {
    {"STREAM", "events to 100 subscribers, each; one CPU", kRaw, 0, kDelivery, 0, kEvents * kSubscribers, kLong, 5},
    {"STREAM_shm", "the same by memory; one CPU", kRaw, 0, kDeliveryByMemory, 0, kEvents * kSubscribers, kLong, 5},
    {"STREAM_single", "the same, one event at a time; one CPU", kRaw, 0, kDelivery, 0, kSubscribers, kBatch, 20},
};
const Case kPublish = {"PUBLISH", "my publish, 100 subscribers; one CPU", "nobody listens", 0, 0, 0, kEvents, kLong, 5};
const Case kDeaf = {"PUBLISH_deaf", "my publish, 100 subscribers that never read", "PUBLISH", 1.2, 0, 0, kEvents, kLong, 5};
const std::vector<Case> kCrowds = {
    {"FUTURES_call", "CTRL as a future, 10 000 calls pending", "100 calls pending", 1.5, 0, 0, 1, kBatch},
    {"FUTURES_cancel", "one of 10 000 cancelled, another begun", "one of 100", 1.5, 0, 0, kCancelled, kBatch},
};
const Case kMemory = {"FUTURES", "a pending future, memory of the caller"};

std::vector<Case> allCases() {
    std::vector<Case> all = {kFuture, kBusy, kLate, kPublish, kDeaf, kMemory};
    for (auto* more : {&kStreams, &kCrowds}) all.insert(all.end(), more->begin(), more->end());
    return all;
}

// Those that never read stay connected, however long it takes.
const char* const kTicker = R"(
package require sorma
sorma::configure -replytime 3600000
oo::class create ticker {
    superclass sorma::Service
    sorma::action -tick count "publish so many events" {
        for {set i 0} {$i < $count} {incr i} {
            my publish tick -ints $i
        }
    }
    method exec message {
        return $message
    }
}
oo::class create metronome {
    superclass sorma::Service
    variable Due Late
    constructor {} {
        set Due [expr {[clock microseconds] + 5000}]
        set Late {}
        after 5 [namespace code {my Tick}]
    }
    method Tick {} {
        set now [clock microseconds]
        lappend Late [expr {$now - $Due}]
        set Due [expr {$now + 5000}]
        after 5 [namespace code {my Tick}]
    }
    method exec message {
        set late $Late
        set Late {}
        return [dict create ints $late]
    }
}
)";

// A request with words, again and again.
class Words {
public:
    Words(Bus& bus, const std::string& object, std::vector<std::string> words) : service_(bus.sorm.get(object)), words_(std::move(words)) {}
    void call() {
        message_.clear();
        message_.words = words_;
        service_->invoke(Method::ctrl, message_);
    }

private:
    sorma::Reference service_;
    std::vector<std::string> words_;
    Message message_;
};

// ---- from Tcl ----

void futures(Table& table, const Daemon& daemon) {
    if (!table.wants(kFuture.row)) return;
    Interpreter interpreter;
    std::string call = "nop@" + daemon.name() + " EXEC";
    std::string begun = interpreter.loop("set f [sorma::async " + call + "]\n$f wait\n$f destroy"), blocking = interpreter.loop(call);
    auto running = [&](const std::string& loop) -> Body {
        return [&interpreter, loop](std::int64_t count) {
            std::int64_t start = now();
            interpreter.run(loop, count);
            return now() - start;
        };
    };
    table.measure(kFuture, running(begun), running(blocking));
}

// ---- calls that take an hour ----

// So many EXECs under way at once, from one client. The daemon takes about a thousand of them; the others wait here.
class Crowd {
public:
    Crowd(const std::string& address, int count) : slow_(bus_.sorm.get("echo.slow@" + address)), quick_(bus_.sorm.get("echo.quick@" + address)) {
        futures_.reserve(std::size_t(count));
        Message m;
        m.words = {"-delay", "3600"};
        slow_->invoke(Method::ctrl, m);
        call();
        std::size_t before = mallinfo2().uordblks;
        for (int i = 0; i < count; ++i) futures_.push_back(begin());
        bytes_ = double(mallinfo2().uordblks - before) / count;
        call();                         // what was sent before has been executed, too
    }

    // Our heap for a future, without the 16 bytes of sorma::Future itself.
    double bytes() const { return bytes_; }

    // Begin a request and wait for its answer.
    void call() {
        Message m;
        m.words = {"-delay", "0"};
        quick_->async(Method::ctrl, std::move(m)).wait();
    }
    // Cancel the oldest, which are under way at the daemon, and begin as many; the call makes room for them there.
    void replace() {
        for (int i = 0; i < kCancelled; ++i) {
            if (!futures_[oldest_].cancel()) throw std::runtime_error("FUTURES: a call that takes an hour was over");
            futures_[oldest_] = begin();
            oldest_ = (oldest_ + 1) % futures_.size();
        }
        call();
    }
    bool pending() const {
        return std::none_of(futures_.begin(), futures_.end(), [](auto& f) { return f.done(); });
    }

private:
    sorma::Future begin() { return slow_->async(Method::exec, {}, sorma::Deadline::in(3'600'000)); }

    Bus bus_;
    sorma::Reference slow_, quick_;
    std::vector<sorma::Future> futures_;
    std::size_t oldest_ = 0;
    double bytes_ = 0;
};

void busy(Table& table, const Daemon& daemon) {
    if (!table.wants(kBusy.row)) return;
    Bus bus, other;
    std::string object = "echo.busy@" + daemon.unixAddress();
    Words working(bus, object, {"-delay", "3600"}), idle(bus, "echo.idle@" + daemon.unixAddress(), {"-delay", "3600"});
    working.call();
    auto future = other.sorm.get(object)->async(Method::exec, {}, sorma::Deadline::in(3'600'000));
    Words(other, object, {"-delay", "3600"}).call();        // the same connection: executed after it
    table.measure(kBusy, repeat([&] { working.call(); }), repeat([&] { idle.call(); }));
    if (future.done()) throw std::runtime_error("CTRL_busy: the object was idle");
    future.cancel();
}

void crowds(Table& table, const Daemon& daemon) {
    if (!table.wants(kMemory.row) && !table.wantsAny(kCrowds)) return;
    Daemon second("second", cpus().first);
    Crowd many(daemon.unixAddress(), kMany), few(second.unixAddress(), kFew);
    table.size(kMemory, many.bytes(), kMostBytes);
    table.measure(kCrowds[0], repeat([&] { many.call(); }), repeat([&] { few.call(); }));
    table.measure(kCrowds[1], repeat([&] { many.replace(); }), repeat([&] { few.replace(); }));
    if (!many.pending() || !few.pending()) throw std::runtime_error("FUTURES: a call that takes an hour was over");
}

// How late the timers of a daemon come that has calls to answer all the time, and of one that has none. They are asked for what
// has come since they were asked before [us].
void timers(Table& table, Bus& bus, const Daemon& daemon, const std::string& script) {
    if (!table.wants(kLate.row)) return;
    Daemon idle("idle", cpus().first, {"-script", script});
    Remote load(bus, daemon.unixAddress(), false);
    auto lateness = [&bus](const Daemon& of, std::int64_t count, const std::function<void(std::int64_t until)>& meanwhile) {
        sorma::Reference timer = bus.sorm.get("metronome.m@" + of.unixAddress());
        Message m;
        timer->invoke(Method::exec, m);
        meanwhile(now() + std::max<std::int64_t>(count, 20) * kTimer);
        m.clear();
        timer->invoke(Method::exec, m);
        if (m.ints.empty()) throw std::runtime_error("TIMER_busy: no timer came");
        return std::int64_t(1000 * quantile({m.ints.begin(), m.ints.end()}, 0.99)) * count;
    };
    auto busy = [&](std::int64_t count) {
        return lateness(daemon, count, [&](std::int64_t until) { load.pipeline(kInFlight, [&](std::size_t) { return now() < until; }); });
    };
    auto quiet = [&](std::int64_t count) {
        return lateness(idle, count, [](std::int64_t until) { std::this_thread::sleep_for(std::chrono::nanoseconds(until - now())); });
    };
    table.measure(kLate, busy, quiet);
}

// ---- events ----

// On the wire.
std::size_t eventSize() {
    Message m;
    m.ints = {0};
    sorma::Buffer body, out;
    sorma::wire::writeEventBody(body, {0, "tick"}, m);
    sorma::wire::writeEvent(out, {1, 1, 0}, body);
    return out.size();
}

// One CTRL publishes; the next one is made when all subscribers have what it did.
void streams(Table& table, Bus& bus, const Daemon& daemon) {
    auto object = [&](const char* name) { return name + ("@" + daemon.unixAddress()); };
    auto ticker = [&](const char* name, int events) { return Words(bus, object(name), {"-tick", std::to_string(events)}); };
    auto subscribers = [&](Subscribers::Kind kind, const char* name, int events) {
        return std::make_unique<Subscribers>(kind, object(name), kProcesses, kEach, events, cpus().first);
    };
    for (auto& c : kStreams) {
        if (!table.wants(c.row)) continue;
        int events = c.per / kSubscribers;
        Words publish = ticker("ticker.stream", events);
        auto all = subscribers(named(c, "shm") ? Subscribers::Kind::sharing : Subscribers::Kind::reading, "ticker.stream", events);
        std::vector<std::unique_ptr<RawServer>> raw;
        for (int i = 0; i < kProcesses; ++i)
            raw.push_back(std::make_unique<RawServer>(Kind::unixSocket, cpus().first, eventSize() * kEach * std::size_t(events), 1));
        auto row = [&] {
            publish.call();
            all->await();
        };
        auto floor = [&] {
            for (auto& server : raw) server->call();
        };
        table.measure(c, repeat(row), repeat(floor));
    }
    if (!table.wants(kPublish.row) && !table.wants(kDeaf.row)) return;
    auto all = subscribers(Subscribers::Kind::reading, "ticker.read", kEvents);
    auto deaf = subscribers(Subscribers::Kind::deaf, "ticker.unread", kEvents);
    Words read = ticker("ticker.read", kEvents), unread = ticker("ticker.unread", kEvents), alone = ticker("ticker.alone", kEvents);
    auto publishing = [&](std::int64_t count) {
        std::int64_t spent = 0;
        for (; count > 0; --count) {
            std::int64_t start = now();
            read.call();
            spent += now() - start;
            all->await();
        }
        return spent;
    };
    // The room of the sockets and of each subscriber's queue: from then on events are dropped.
    for (int i = 0; i < 50; ++i) unread.call();
    table.measure(kPublish, publishing, repeat([&] { alone.call(); }));
    table.measure(kDeaf, repeat([&] { unread.call(); }), publishing);
}

}  // namespace

void asynchronous(Table& table) {
    std::vector<Case> all = allCases();
    if (!table.wantsAny(all)) return;
    try {
        Folder folder;
        const std::string script = folder.file("ticker.tcl", kTicker);
        Daemon daemon("bench", cpus().first, {"-script", script});
        Bus bus;
        futures(table, daemon);
        busy(table, daemon);
        timers(table, bus, daemon, script);
        streams(table, bus, daemon);
        crowds(table, daemon);
    } catch (const Interrupted&) {
        throw;
    } catch (const std::exception& e) {
        table.failed(all, e.what());
    }
}

}  // namespace bench
