// secureCall.cpp -- calls with TLS beside calls in clear to the same daemon, and handshakes.
#include "rows.h"

#include <sys/epoll.h>

#include <cstdlib>

#include "comm/keys.h"
#include "comm/tls.h"
#include "comm/transport.h"
#include "process.h"
#include "rawHandshake.h"
#include "remote.h"

namespace bench {

namespace {

constexpr std::int64_t kBatch = 1'000'000, kHandshakes = 20'000'000;
constexpr int kBig = 200'000, kLearning = 2000, kPatience = 10'000;     // kPatience [ms]: for an answer of the daemon
constexpr const char* kAlone = "OpenSSL alone: both ends in one thread";

const Case kCall = {"P_tls", "call with TLS, empty; one CPU", "P_tcp: in clear", 1.8, 0, 0, 1, kBatch};
const Case kLong = {"BIG_tls", "200 000 floats there and back with TLS; one CPU", "BIG_tcp: in clear", 2.5, 0, 0, 1, kBatch, 20};
// Targets: 800 and 2000 a second.
const Case kFull = {"HANDSHAKE_full", "a connection with TLS, both ends show P-256; one CPU", kAlone, 0, 1'250'000, 0, 1, kHandshakes, 20};
const Case kResumed = {"HANDSHAKE_resumed", "the same with a ticket of the last one", kAlone, 0, 500'000, 0, 1, kHandshakes, 20};

// Names of the daemon in our dictionary; a certificate has the first one.
constexpr const char* kSecure = "lab";
constexpr const char* kClear = "clear";

// An authority and one key, for both ends.
void makeKeys() {
    if (std::system("{ sorma-keys new-authority bench && sorma-keys new lab; } >/dev/null") != 0) throw std::runtime_error("sorma-keys has made no keys");
}

// The transport's functions alone, as a client uses them before it says HELLO.
class Connecting {
public:
    explicit Connecting(const Daemon& daemon) : address_(sorma::Address::parse(daemon.tcpAddress())) {
        address_.as = kSecure;
        address_.tls = sorma::Address::Tls::yes;
    }

    // ticket: take the one that comes after the handshake; the next connection resumes with it.
    void secure(bool ticket) {
        sorma::Line line = connect();
        while (!line.row().upgrade(line, sorma::Transport::Stage::connected, kWho)) wait(line);
        wait(line);                     // it comes when the daemon has judged our certificate
        char room[64];
        if (ticket && line.read(room, sizeof room) >= 0) throw std::runtime_error("the daemon speaks without being asked");
    }

private:
    static constexpr const char* kWho = "bench";

    sorma::Line connect() {
        sorma::Line line = sorma::tls::rowFor(sorma::transportOf(address_), address_, kWho).begin(address_, kWho);
        while (!line.row().finish(line, kWho)) wait(line, EPOLLOUT);
        return line;
    }
    static void wait(const sorma::Line& line, std::uint32_t events = EPOLLIN) {
        if (line.wait(events, kPatience) == 0) throw std::runtime_error("no answer to the handshake");
    }

    sorma::Address address_;
};

void calls(Table& table, Bus& bus) {
    if (!table.wants(kCall.row)) return;
    Remote secure(bus, kSecure, false), clear(bus, kClear, false);
    for (int n = 0; n < kLearning; ++n) secure.call(), clear.call();
    table.measure(kCall, repeat([&] { secure.call(); }), repeat([&] { clear.call(); }));
}

void bigOnes(Table& table, Bus& bus) {
    if (!table.wants(kLong.row)) return;
    sorma::Message there, beside;
    for (int i = 0; i < kBig; ++i) there.floats.push_back(i + 1 / 3.0);
    beside = there;
    const std::vector<double> expected = there.floats;
    auto secure = bus.sorm.get(std::string("echo@") + kSecure), clear = bus.sorm.get(std::string("echo@") + kClear);
    table.measure(kLong, repeat([&] { secure.exec(there); }), repeat([&] { clear.exec(beside); }));
    if (there.floats != expected || beside.floats != expected) throw std::runtime_error("BIG_tls: not the numbers that were sent");
}

void handshakes(Table& table, const Daemon& daemon) {
    Connecting connecting(daemon);
    RawHandshake raw(sorma::keys::file("lab.pem"), sorma::keys::file("authority.pem"));
    for (auto& c : {kFull, kResumed}) {
        if (!table.wants(c.row)) continue;
        const bool resumed = named(c, "resumed");
        connecting.secure(resumed);
        table.measure(c, repeat([&] { connecting.secure(resumed); }), repeat([&] { resumed ? raw.resumed() : raw.full(); }));
    }
}

}  // namespace

void secureCall(Table& table) {
    const std::vector<Case> all = {kCall, kLong, kFull, kResumed};
    if (!table.wantsAny(all)) return;
    try {
        Folder folder;
        makeKeys();
        Daemon daemon("benchtls", cpus().first, {"-tls", "yes"});
        Bus bus;
        bus.sorm.dictionary().add("@lab", {daemon.tcpAddress(), "-tls", "yes"}, "bench");
        bus.sorm.dictionary().add("@clear", {daemon.tcpAddress(), "-tls", "no"}, "bench");
        calls(table, bus);
        bigOnes(table, bus);
        handshakes(table, daemon);
    } catch (const Interrupted&) {
        throw;
    } catch (const std::exception& e) {
        table.failed(all, e.what());
    }
}

}  // namespace bench
