// transports.cpp -- transports ROW CASE FOLDER: what each row of comm/transport.h must be good for.
//
// The cases of the client are in transportClients.cpp; those of the daemon are here. Both ends use the functions of the row alone. Prints what is wrong and exits with 1; prints nothing when all is well.
// `transports` alone prints the rows and the cases. No case waits for a time, but for what must happen.
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "comm/tls.h"
#include "transports.h"
#include "sorma.h"

using namespace transports;

namespace {

// ---- a row: how to listen, and which address leads there ----

std::string folder;

std::string newPath() {
    static std::atomic<int> number{0};
    return folder + "/transports" + std::to_string(getpid()) + "." + std::to_string(number++);
}

ListeningSocket inherit(ListeningSocket from) {
    return inheritedTransport.listen({}, from.fd.get(), false);
}

// The memory row for addresses of its own: elsewhere a setting of the client chooses it.
const Transport sharedTransport = [] {
    Transport row = offeringTransport;
    row.mine = [](const Address& address) { return pathOf(address).ends_with(".shared"); };
    return row;
}();

// TLS over TCP, in both ends of this process: one authority and one key, as sorma-keys makes them.
const tls::Offer offer{"", nullptr};
const Transport secureTransport = [] {
    Transport row = tcpTransport;
    row.name = "tls";
    row.begin = [](const Address& address, const std::string& who) {
        Address to = address;
        to.as = "transports", to.tls = Address::Tls::yes;
        return tls::rowFor(tcpTransport, to, who).begin(to, who);
    };
    row.listen = [](const std::string& at, int port, bool share) {
        ListeningSocket socket = tcpTransport.listen(at, port, share);
        socket.row = &secureTransport;
        return socket;
    };
    row.accept = [](int fd) { return tls::offered(tcpTransport.accept(fd), offer); };
    return row;
}();

struct Keys {
    Keys() {
        setenv("SORMA_KEYS", path.c_str(), 1);
        check(std::system("{ sorma-keys new-authority transports && sorma-keys new transports; } >/dev/null") == 0, "sorma-keys has made no keys");
    }
    ~Keys() { std::filesystem::remove_all(path); }
    const std::string path = newPath() + ".keys";
};

// Without OpenSSL there is no such row.
bool haveTls() {
    try {
        tls::check("");
        return true;
    } catch (const Error& e) {
        return !e.is("TLS REFUSED");
    }
}

// One line for each row.
const std::map<std::string, Row> rows{
    {"tcp", {tcpTransport, [] { return tcpTransport.listen("127.0.0.1", 0, false); }}},
    {"unix", {unixTransport, [] { return unixTransport.listen(newPath(), 0, false); }}},
    {"inherited", {inheritedTransport, [] { return inherit(unixTransport.listen(newPath(), 0, false)); }}},
    {"shm", {sharedTransport, [] { return sharedTransport.listen(newPath() + ".shared", 0, false); }, true}},
    {"tls", {secureTransport, [] { return secureTransport.listen("127.0.0.1", 0, false); }}},
    {"sealed", {sealedTransport, [] { return sealedTransport.listen(newPath() + ".sealed", 0, false); }, true}},
};

// ---- the daemon's side ----

Buffer hello(std::uint64_t client) {
    Buffer out;
    wire::writeHello(out, 1, wire::kProgram, {client, "u", "h", "p", 1, std::uint32_t(kLimit)});
    return out;
}

struct Daemon {
    Sorm sorm;
    Comm comm{sorm};
    Server* server = nullptr;
    Address address;

    explicit Daemon(const Row& row) {
        static int number = 0;
        comm.settings.maxMessage = kLimit;
        ListeningSocket socket = row.listen();
        address = addressOf(socket);
        Server::Wanted wanted;
        wanted.name = "transports" + std::to_string(getpid()) + "." + std::to_string(number++);
        if (row.own) socket.fd.close(), wanted.socket = socket.path;
        else wanted.listen = {socket.fd.release()};
        path_ = socket.path;
        server = &comm.serve(wanted);
    }
    ~Daemon() { unlink(path_.c_str()); }
    End connect() {
        Line line = transportOf(address).begin(address, "test");
        while (!line.row().finish(line, "test")) {}
        End end(std::move(line));
        serveUntil([&] { return end.upgraded(Transport::Stage::connected); });
        return end;
    }
    // Says HELLO, and has the answer.
    std::string greet(End& end, std::uint64_t client) {
        end.say(hello(client));
        std::string welcome = answer(end);
        serveUntil([&] { return end.upgraded(Transport::Stage::greeted); });
        return welcome;
    }
    template <class Done> void serveUntil(Done done) {
        for (Deadline enough = Deadline::in(60'000); !done(); sorm.turn(Deadline::in(10))) check(!enough.passed(), "it waits in vain");
    }
    // The next record; empty: the daemon has closed.
    std::string answer(End& end) {
        std::string record;
        bool closed = false;
        serveUntil([&] {
            char room[65536];
            for (ssize_t n; (n = end.line.read(room, sizeof room)) >= 0;) {
                if (n == 0) closed = true;
                if (n <= 0) break;
                end.in.append(room, std::size_t(n));
            }
            return record::front(end.in.data(), end.in.data() + end.in.size()).whole || closed;
        });
        return record::front(end.in.data(), end.in.data() + end.in.size()).whole ? end.record() : std::string();
    }
    bool works() {
        End end = connect();
        Buffer out;
        wire::writeNull(out, 9, wire::kProgram);
        end.say(out);
        return !answer(end).empty();
    }

private:
    std::string path_;
};

std::vector<Buffer> everyRequest() {
    std::vector<Buffer> all;
    all.push_back(hello(77));
    Message m;
    m.words = {"-info", "name"};
    for (auto procedure : {wire::kCall, wire::kOneway}) wire::writeCall(all.emplace_back(), 2, wire::kProgram, {wire::kNoSlot, 0, 0, Method::dbx, "sorm"}, m, procedure);
    wire::writeCancel(all.emplace_back(), wire::kProgram, {0, 1});
    wire::writeHealthRequest(all.emplace_back(), 3, wire::kProgram);
    wire::writeSubscribe(all.emplace_back(), 4, wire::kProgram, {1, "sorm", "*", 1});
    wire::writeUnsubscribe(all.emplace_back(), wire::kProgram, 1);
    wire::writeClock(all.emplace_back(), wire::kProgram, 1);
    wire::writeNull(all.emplace_back(), 5, wire::kProgram);
    return all;
}

// Each request is cut at each byte: the daemon forgets that peer, and serves the next one.
void cutRequests(const Row& row) {
    Daemon daemon(row);
    for (auto& bytes : everyRequest())
        for (std::size_t at = 0; at <= bytes.size(); ++at) daemon.connect().say(bytes, at);
    daemon.serveUntil([&] { return daemon.server->connections() == 0; });
    check(daemon.works(), "it serves nobody any more");
    daemon.serveUntil([&] { return daemon.server->connections() == 0; });
}

void twoHellos(const Row& row) {
    Daemon daemon(row);
    End end = daemon.connect();
    check(!daemon.greet(end, 1).empty(), "the first one is not answered");
    end.say(hello(1));
    expect(daemon.answer(end), "HELLO was said twice");
    check(daemon.answer(end).empty(), "the connection goes on");
    check(daemon.works(), "it serves nobody any more");
}

// A request that is too long is refused before it has come, and the connection goes on.
void refusedRecord(const Row& row) {
    Daemon daemon(row);
    End end = daemon.connect();
    daemon.greet(end, 1);
    Buffer out;
    Message m;
    m.text.assign(kLimit + 1, 'x');
    wire::writeCall(out, 2, wire::kProgram, {wire::kNoSlot, 0, 0, Method::exec, "sorm"}, m);
    end.say(out, 100);
    expect(daemon.answer(end), "TOO_BIG");
    wire::writeNull(out, 3, wire::kProgram);
    std::size_t at = 100;
    daemon.serveUntil([&] {
        if (ssize_t n = end.line.write(out.data() + at, out.size() - at); n > 0) at += std::size_t(n);
        return at == out.size();
    });
    const std::string answer = daemon.answer(end);
    check(!answer.empty() && XdrReader(answer).u32() == 3, "the request after it is not served");
}

// A probe of RFC 9289 is a NULL with the credentials AUTH_TLS. The verifier of the answer is empty: STARTTLS would promise TLS. Inside TLS
// the probe is denied: AUTH_ERROR, AUTH_BADCRED.
void probe(const Row& row) {
    Daemon daemon(row);
    End end = daemon.connect();
    constexpr std::size_t kFlavor = 31;             // the last byte of the flavor
    Buffer out;
    wire::writeNull(out, 9, wire::kProgram);
    const_cast<char*>(out.data())[kFlavor] = 7;
    end.say(out);
    const std::string answer = daemon.answer(end);
    XdrReader r(answer);
    const bool inside = row.transport.name == secureTransport.name;
    const bool accepted = r.u32() == 9 && r.u32() == 1 && (inside ? r.u32() == 1 && r.u32() == 1 && r.u32() == 1 : r.skipZeros(16)) && r.atEnd();
    check(accepted && r.good(), inside ? "the probe is not denied" : "the answer to the probe is not an empty one");
    check(!daemon.greet(end, 1).empty(), "the connection does not go on");
}

void identity(const Row& row) {
    ListeningSocket socket = row.listen();
    const Address address = addressOf(socket);
    Line line = transportOf(address).begin(address, "test");
    pollfd p{socket.fd.get(), POLLIN, 0};
    check(poll(&p, 1, 60'000) == 1, "nobody connects");
    Line came = socket.row->accept(socket.fd.get());
    const Identity who = came.row().identify(came);
    unlink(socket.path.c_str());
    const std::string me = userName(geteuid());
    if (came.row().vouched) check(!who.principal && who.caller.user == me && who.caller.process == getpid(), "it takes us for " + who.caller.toText());
    else check(who.principal && who.principal->uid() == geteuid() && who.caller.known.starts_with(me + "@"), "it takes us for " + who.caller.known);
}

// [s] of silence after which a line breaks, by the options of its socket; 0: it does not.
int breaksAfter(int fd) {
    auto get = [fd](int level, int option) {
        int value = 0;
        socklen_t size = sizeof value;
        check(getsockopt(fd, level, option, &value, &size) == 0, std::strerror(errno));
        return value;
    };
    if (get(SOL_SOCKET, SO_DOMAIN) == AF_UNIX || get(SOL_SOCKET, SO_KEEPALIVE) == 0) return 0;
    return get(IPPROTO_TCP, TCP_KEEPIDLE) + get(IPPROTO_TCP, TCP_KEEPCNT) * get(IPPROTO_TCP, TCP_KEEPINTVL);
}
// [ms] in which the other end has to confirm what was sent; 0: no limit.
int confirmedWithin(int fd) {
    int value = 0;
    socklen_t size = sizeof value;
    return getsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &value, &size) == 0 ? value : 0;
}

// A host may be gone without a word. Where the kernel vouches for the other end it is on this host, and the kernel tells its end.
void goneHost(const Row& row) {
    ListeningSocket socket = row.listen();
    const Address address = addressOf(socket);
    auto look = [&](const Line& line, bool accepted) {
        const int after = line.row().vouched ? 0 : 60;
        const int silent = breaksAfter(line.descriptor()), within = confirmedWithin(line.descriptor());
        check(silent == after, "it breaks after " + std::to_string(silent) + " s of silence");
        check(within == (accepted ? 1000 * after : 0), "what was sent is to be confirmed in " + std::to_string(within) + " ms");
    };
    for (bool inetd : {false, true}) {
        Line line = transportOf(address).begin(address, "test");
        while (!line.row().finish(line, "test")) check(line.wait(EPOLLOUT, 60'000) != 0, "it does not connect");
        pollfd p{socket.fd.get(), POLLIN, 0};
        check(poll(&p, 1, 60'000) == 1, "nobody connects");
        const Descriptor raw(inetd ? accept4(socket.fd.get(), nullptr, nullptr, SOCK_CLOEXEC) : -1);
        const Line came = inetd ? inheritedTransport.accept(raw.get()) : socket.row->accept(socket.fd.get());
        look(line, false);
        look(came, true);
    }
    unlink(socket.path.c_str());
}

void manyConnections(const Row& row) {
    Daemon daemon(row);
    constexpr std::size_t kMany = 1000;
    std::vector<End> ends;
    for (std::size_t i = 0; i < kMany; ++i) {
        ends.push_back(daemon.connect());
        ends.back().say(hello(i + 1));
        if (i % 50 == 0) daemon.serveUntil([&] { return daemon.server->connections() > i; });
    }
    for (auto& end : ends) check(!daemon.answer(end).empty(), "one of them is not greeted");
    check(daemon.server->connections() == kMany, std::to_string(daemon.server->connections()) + " are connected");
    ends.clear();
    daemon.serveUntil([&] { return daemon.server->connections() == 0; });
}

// One peer reads no answers, until the daemon stops reading its requests. Others are served meanwhile; and when
// it reads, all answers are there.
void slowPeer(const Row& row) {
    Daemon daemon(row);
    End slow = daemon.connect();
    daemon.greet(slow, 1);
    constexpr std::uint32_t kRequests = 3000;
    Buffer asked;
    Message m;
    m.words = {"-help"};
    for (std::uint32_t i = 0; i < kRequests; ++i) wire::writeCall(asked, i, wire::kProgram, {wire::kNoSlot, 0, 0, Method::ctrl, "sorm"}, m);
    std::size_t at = 0;
    auto ask = [&] {
        ssize_t n = at < asked.size() ? slow.line.write(asked.data() + at, asked.size() - at) : 0;
        if (n > 0) at += std::size_t(n);
        return n > 0;
    };
    for (std::uint64_t served = 0, before = 1; ask() || served != before;) {
        before = std::exchange(served, daemon.server->served());
        daemon.sorm.turn(Deadline::in(10));
    }
    check(daemon.server->served() < kRequests, "it answers without end");
    check(daemon.works(), "it serves nobody else");
    std::uint32_t answers = 0;
    daemon.serveUntil([&] {
        char room[65536];
        while (ask()) {}
        for (ssize_t n; (n = slow.line.read(room, sizeof room)) > 0;) slow.in.append(room, std::size_t(n));
        record::Reader records(slow.in);
        for (std::string_view record; records.next(record);) answers += XdrReader(record).u32() == answers;
        slow.in.drop(std::size_t(records.at() - slow.in.data()));
        return answers == kRequests;
    });
}

Cases daemonCases{
    {"cutRequests", cutRequests}, {"twoHellos", twoHellos}, {"refusedRecord", refusedRecord},
    {"identity", identity}, {"goneHost", goneHost}, {"manyConnections", manyConnections}, {"probe", probe}, {"slowPeer", slowPeer},
};

}  // namespace

int main(int argc, char** argv) {
    Cases cases = clientCases;
    cases.merge(daemonCases);
    if (argc == 1) {
        for (auto& [name, row] : rows)
            if (name != "tls" || haveTls()) std::printf("row %s\n", name.c_str());
        for (auto& [name, function] : cases) std::printf("case %s\n", name.c_str());
        return 0;
    }
    if (argc != 4 || !rows.contains(argv[1]) || !cases.contains(argv[2])) return std::fprintf(stderr, "usage: transports ?ROW CASE FOLDER?\n"), 2;
    folder = argv[3];
    setenv("SORMA_RUNTIME_DIR", folder.c_str(), 1);
    addTransport(sealedTransport);
    addTransport(sharedTransport);
    try {
        std::optional<Keys> keys;
        if (argv[1] == secureTransport.name) addTransport(secureTransport), keys.emplace();
        cases.at(argv[2])(rows.at(argv[1]));
        return 0;
    } catch (const std::exception& e) {
        std::printf("%s: %s\n", argv[2], e.what());
        return 1;
    }
}
