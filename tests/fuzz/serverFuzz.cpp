// serverFuzz.cpp -- a whole daemon and its clients, in any order.
//
// Connections come and go, say HELLO once, twice or never, call, subscribe, cancel, and cut records in two. Services answer at once,
// later or never, publish, hold leases, remove objects, run the event loop, and end the daemon. Yet a call is executed once at most, a
// request is answered once at most, and when all have gone nothing is left of them.
//
// The input is a program: a byte for the operation, and bytes for its arguments. There is one thread, and no time passes but that of
// the grace, nothing or for ever. So an input does the same each time. The health responder is an operation like the others.
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <set>

#include "bus/sorm.h"
#include "comm/reactor.h"
#include "comm/server.h"
#include "comm/wire.h"
#include "fuzz.h"

using namespace sorma;

namespace {

constexpr int kOperations = 100;        // of one input
constexpr int kLines = 4;               // connections at a time
constexpr std::int64_t kOwn = std::int64_t{1} << 40;     // tokens from here on: calls without numbers
constexpr int kDepth = 3;               // of event loops in each other

// ---- the daemon ----

struct World {
    Sorm sorm;
    Settings settings;
    ServerLock lock;
    Reactor reactor{sorm.mailbox()};
    std::unique_ptr<Server> server;
    std::vector<Reply> owed;
    std::vector<ClientPointer> holders;             // each with a lease, until lost() is called
    std::map<std::int64_t, int> executed;           // by token
    int depth = 0;

    void turn() {
        if (depth >= kDepth) return;
        ++depth;
        reactor.poll(0);
        --depth;
    }
    void look() {
        epoll_event events[64];
        int n = epoll_wait(reactor.descriptor(), events, 64, 0);
        std::vector<void*> waiting;
        for (int i = 0; i < n; ++i) {
            void* const watcher = events[i].data.ptr;       // which is not aligned there
            waiting.push_back(watcher);
        }
        demand(lock.tryLook(), "the lock is held");
        server->peek(waiting);
        lock.endLook();
    }
    void answerOne() {
        if (owed.empty()) return;
        Reply reply = owed.front();
        owed.erase(owed.begin());
        reply.complete();
    }
};
World* world = nullptr;

const Prototype kThrown{Severity::error, "FUZZ THROWN", 1, "{}: as asked"};
const char* const kNames[] = {"many.a", "many.b", "one.a", "own.a", "many.c", "none.x", "", "many.a@there", "MANY", "sorm"};     // the last one is no actor
enum Act : std::int64_t { quick, late, thrown, told, hold, answerNow, removeSelf, removeOther, turns, lateThrown, ends, looks, large, chained, answers, kActs };

// Does what the request says: ints are token, act, and what the act is done with.
class Actor : public Service {
public:
    static Class describe(const char* name, Concurrency concurrency) {
        return Class::of<Actor>(name, "does what it is told").concurrency(concurrency)
            .integer("-x", &Actor::x_).reads(Field::ints, {3, 3}, "", "token, act, with what").writes(Field::ints, {3, 3}, "", "the same")
            .writes(Field::text, {}, "", "");
    }

    void exec(Message& m) override {
        World& w = *world;
        const std::int64_t act = std::uint64_t(m.ints[1]) % kActs, with = m.ints[2];
        ++w.executed[m.ints[0]];
        Reference self(this);
        switch (act) {
            case late: w.owed.push_back(later(m)); break;
            case thrown: fail(kThrown, name());
            case told: publish(with & 1 ? "told.odd" : "told.even", m); break;
            case hold:
                if (auto client = CallContext::currentClient()) {
                    w.holders.push_back(client);
                    client->hold(name(), [&w, c = client.get()] { forget(w, c); });
                }
                break;
            case answerNow: w.answerOne();
                break;
            case removeSelf: sorm().remove(name(), Permit::owner()); break;
            case removeOther: sorm().remove(kNames[std::uint64_t(with) % std::size(kNames)], Permit::owner()); break;
            case turns:
                w.turn(), w.turn();
                if (with & 1) w.look();                     // this request goes on computing
                break;
            case lateThrown: w.owed.push_back(later(m)); fail(kThrown, name());
            case ends: w.server->stop("as asked"); break;
            case looks: w.look(); break;
            case large: m.text.assign(5000, 'x'); break;
            case chained: {
                Reply reply = later(m);
                Message inner;
                inner.ints = {0, with, with / 4};
                sorm().get(kNames[std::uint64_t(with) % 4])->async(Method::exec, std::move(inner)).then([reply](Future) { reply.complete(); });
                break;
            }
            case answers:                                   // before it has said that it takes the request over
                later(m).complete();
                w.turn();
                break;
            default: break;
        }
    }
    void removing() override { Message m; m.ints = {0, 0, 0}; publish("leaving", m); }

private:
    static void forget(World& w, const Client* client) {
        for (auto at = w.holders.begin(); at != w.holders.end(); ++at)
            if (at->get() == client) return void(w.holders.erase(at));
        demand(false, "a lease ends twice");
    }
    std::int64_t x_ = 0;
};

// ---- where it listens: two sockets for all inputs, neither of which leaves a file ----

struct Socket {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    int fd;

    explicit Socket(bool tcp) {
        fd = socket(tcp ? AF_INET : AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        address.ss_family = tcp ? AF_INET : AF_UNIX;
        if (tcp) reinterpret_cast<sockaddr_in&>(address).sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        // Only the family of the Unix domain: the kernel chooses a name that is no file.
        int failed = bind(fd, reinterpret_cast<sockaddr*>(&address), tcp ? sizeof(sockaddr_in) : sizeof(sa_family_t));
        demand(!failed && listen(fd, 64) == 0, "cannot listen", errno);
        getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    }
    int copy() const { return dup(fd); }
    int connected() const {
        int c = socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
        demand(c >= 0, "cannot make a socket", errno);
        // libFuzzer's own alarm interrupts now and then.
        while (connect(c, reinterpret_cast<const sockaddr*>(&address), size) != 0 && errno != EISCONN)
            demand(errno == EINTR || errno == EALREADY, "cannot connect", errno);
        linger now{1, 0};
        setsockopt(c, SOL_SOCKET, SO_LINGER, &now, sizeof now);         // no TIME_WAIT: there are many
        return c;
    }
    void forgetOthers() const {
        for (int c; (c = accept4(fd, nullptr, nullptr, SOCK_CLOEXEC)) >= 0;) close(c);
    }
};

// ---- the clients ----

struct Numbers {                            // of the calls of one session
    std::uint32_t last[4] = {};
};

struct Line {
    int fd = -1;
    bool tcp = false;
    int session = -1;                       // what it said HELLO with
    std::string rest;                       // of a record that was cut in two
    std::string in;
    std::map<std::uint32_t, std::int64_t> asked;    // xid to token
    std::map<std::uint32_t, std::uint64_t> heard;   // subscription to the number of its last event
};

class Clients {
public:
    Clients(World& w, const Socket& local, const Socket& network) : world_(w), local_(local), network_(network) {}
    ~Clients() {
        for (auto& line : lines_) shut(line, false);
    }

    void operation(Input& in) {
        Line& line = lines_[in.below(kLines)];
        Buffer out;
        switch (const int op = in.below(20)) {
            case 0: case 1:
                if (line.fd < 0) open(line, in.below(2));
                else if (op == 1) shut(line, in.byte() & 1);
                break;
            case 2: case 3: {
                const int n = in.below(3);
                if (line.session < 0) line.session = n;
                wire::writeHello(out, ask(line, 0), wire::kProgram,
                                 {std::uint64_t(n) + 1, "u", "h", "p", 1, in.byte() & 1 ? 2000u : 0u});
                break;
            }
            case 4: {
                const std::uint32_t id = std::uint32_t(in.below(3));
                wire::Behalf behalf{true, 7, "somebody"};
                static const char* const patterns[] = {"*", "told.odd", "leaving", "["};
                wire::writeSubscribe(out, ask(line, 0), wire::kProgram, {id, name(in), patterns[in.below(4)], std::uint32_t(in.below(4))},
                                     in.byte() & 1 ? &behalf : nullptr);
                break;
            }
            case 5:
                wire::writeUnsubscribe(out, wire::kProgram, std::uint32_t(in.below(3)));
                ordered_ = false;                                   // its numbers may begin anew
                break;
            case 6: case 7: case 8: case 9: call(in, line, out, wire::kCall); break;
            case 10: call(in, line, out, wire::kOneway); break;
            case 11: {
                const std::uint32_t slot = std::uint32_t(in.below(5));
                wire::writeCancel(out, wire::kProgram, {slot, line.session >= 0 && slot < 4 ? numbers(line).last[slot] - std::uint32_t(in.below(2)) : 0});
                break;
            }
            case 12: wire::writeHealthRequest(out, ask(line, 0), wire::kProgram); break;
            case 13: words(in, line, out); break;
            case 14: {                                              // whatever comes, or a record that is not what it was
                if (in.byte() & 1) call(in, line, out, wire::kCall);
                else for (int n = in.below(40); n > 0; --n) *out.extend(1) = char(in.byte());
                if (out.size() > 0) out.data()[std::size_t(in.byte()) % out.size()] ^= char(1 << in.below(8));
                trusted_ = false;
                break;
            }
            case 15: cut_ = 1 + in.byte(); break;
            case 16: read(line); break;
            case 17: world_.answerOne(); break;
            case 18: if (world_.depth == 0) world_.look(); break;
            default: world_.turn();
        }
        if (line.fd >= 0 && !out.empty()) send(line, {out.data(), out.size()});
    }

    void leave(bool reading) {
        for (auto& line : lines_) {
            if (line.fd >= 0 && reading) read(line);
            shut(line, false);
        }
    }
    void check() const {
        if (!trusted_) return;
        for (auto& [token, times] : world_.executed) demand(times == 1 || token == 0, "a call was executed more than once", token);
        for (auto token : done_) demand(world_.executed.contains(token), "a call was answered and not executed", token);
    }

private:
    static const char* name(Input& in, int except = 0) { return kNames[in.below(int(std::size(kNames)) - except)]; }
    Numbers& numbers(const Line& line) { return numbers_[line.tcp][line.session]; }
    std::uint32_t ask(Line& line, std::int64_t token) {
        line.asked[++xid_] = token;
        return xid_;
    }

    void open(Line& line, bool tcp) {
        line = Line{};
        line.tcp = tcp;
        line.fd = (tcp ? network_ : local_).connected();
    }
    void shut(Line& line, bool half) {
        if (line.fd < 0) return;
        if (half) return void(shutdown(line.fd, SHUT_WR));
        close(line.fd);
        line = Line{};
    }

    // A call of a session has the token of its numbers, so that asking again is the same; any other one has its own.
    void call(Input& in, Line& line, Buffer& out, std::uint32_t procedure) {
        wire::Request request;
        const int slot = in.below(6), step = in.below(8);
        std::int64_t token = kOwn + xid_;
        if (slot < 4) {
            // A client without a HELLO, or with a late one, has a slot that no call of a session uses.
            request.slot = line.session >= 0 && slot < 3 ? std::uint32_t(slot) : 3u;
            if (request.slot != 3) {
                auto& last = numbers(line).last[slot];
                request.sequence = step == 0 ? last : step == 1 ? last + 2 : step == 2 ? last - 1 : last + 1;
                if (step > 1) last = request.sequence;         // back, too: what was lost on its way must be sent again
                if (procedure == wire::kCall)
                    token = 1 + (((line.tcp * 3 + line.session) * 4 + slot) * (std::int64_t{1} << 33)) + request.sequence;
            }
        } else if (slot == 4) {
            request.slot = 1024;
        }
        request.name = name(in, 1);
        request.deadline = in.byte() & 1 ? 3'600'000 : 0;
        Message m;
        m.ints = {token, in.below(kActs), in.byte()};
        wire::Behalf behalf{(in.byte() & 1) != 0, 7, "somebody"};
        const bool of = in.byte() & 1;
        const bool answered = procedure == wire::kCall;
        wire::writeCall(out, answered ? ask(line, token) : ++xid_, wire::kProgram, request, m, procedure, of ? &behalf : nullptr);
    }
    void words(Input& in, Line& line, Buffer& out) {
        static const std::vector<std::string> all[] = {
            {"-lock"}, {"-unlock"}, {"-x", "7"}, {"-x", "y"}, {"-remove", "many.a"}, {"-remove", "one.a", "many.b"}, {"-create", "many.c", "-x", "3"},
            {"-alias", "many.z", "many.a"}, {"-allow", "anyone make"}, {"-undo"}, {"-dump"}, {"-help"}, {"-audit"}, {"-statistics"}, {"-inventory"}, {}};
        wire::Request request;
        static const char* const whom[] = {"own.a", "sorm", "many.a", "one.a"};
        request.name = whom[in.below(4)];
        request.method = in.byte() & 1 ? Method::dbx : Method::ctrl;
        Message m;
        m.words = all[in.below(int(std::size(all)))];
        wire::writeCall(out, ask(line, 0), wire::kProgram, request, m);
    }

    void send(Line& line, std::string bytes) {
        bytes.insert(0, std::exchange(line.rest, {}));
        if (const std::size_t cut = std::exchange(cut_, 0); cut != 0 && cut < bytes.size()) {
            line.rest = bytes.substr(cut);
            bytes.resize(cut);
        }
        ssize_t n = ::send(line.fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n != ssize_t(bytes.size())) shut(line, false);          // the daemon has ended it, or takes nothing
    }
    void read(Line& line) {
        char bytes[4096];
        for (ssize_t n; line.fd >= 0 && (n = recv(line.fd, bytes, sizeof bytes, MSG_DONTWAIT)) > 0;) line.in.append(bytes, std::size_t(n));
        std::string in = std::exchange(line.in, {});
        record::Reader records(in.data(), in.size(), 1 << 20);
        for (std::string_view bytes; records.next(bytes);) heard(line, bytes);
        demand(!records.wrong(), "no record comes");
        line.in.insert(0, in, std::size_t(records.at() - in.data()));
    }
    void heard(Line& line, std::string_view bytes) {
        XdrReader r(bytes);
        auto envelope = wire::readEnvelope(r);
        demand(r.good() && envelope.kind <= 1, "neither a call nor a reply comes", envelope.kind);
        if (envelope.kind == 0) return event(line, r, envelope.xid);
        if (!trusted_) return;
        auto asked = line.asked.find(envelope.xid);
        demand(asked != line.asked.end(), "an answer to nothing, or the second one", envelope.xid);
        const std::int64_t token = asked->second;
        line.asked.erase(asked);
        wire::Times times;
        Message m;
        if (token == 0 || !wire::readReplyHeader(r).empty()) return;
        demand(wire::readReply(r, times, m), "an answer that cannot be read", token);
        if (m.code >= 0 && token < kOwn) done_.insert(token);
    }
    void event(Line& line, XdrReader& r, std::uint32_t xid) {
        auto header = wire::readCallHeader(r, xid);
        demand(header.procedure == wire::kEvent || header.procedure == wire::kGoodbye, "a call of another procedure", header.procedure);
        if (header.procedure == wire::kGoodbye) return;
        wire::EventHeader h;
        wire::EventBody body;
        Message content;
        demand(wire::readEvent(r, h, body, content), "an event that cannot be read");
        auto& last = line.heard[h.id];
        demand(!trusted_ || !ordered_ || h.number > last, "events out of order", std::int64_t(h.number));
        last = h.number;
    }

    World& world_;
    const Socket& local_;
    const Socket& network_;
    Line lines_[kLines];
    std::map<int, Numbers> numbers_[2];
    std::set<std::int64_t> done_;
    std::uint32_t xid_ = 0;
    std::size_t cut_ = 0;
    bool ordered_ = true;
    bool trusted_ = true;               // false: bytes were sent of which nobody knows what they ask
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Socket local(false), network(true);
    Input in(data, size);
    const unsigned how = in.byte();
    World w;
    world = &w;
    w.settings.grace = how & 1 ? 0 : 3'600'000;
    w.settings.keepReply = 4000;
    w.settings.maxConnections = how & 2 ? 3 : 10;
    w.settings.inFlight = 4;
    w.settings.maxMessage = 8192;
    w.sorm.setLoop(&w.reactor);
    w.sorm.add(Actor::describe("many", Concurrency::concurrent));
    w.sorm.add(Actor::describe("one", Concurrency::serial));
    w.sorm.add(Actor::describe("own", Concurrency::exclusive));
    if (how & 4) w.sorm.access.add("allow anyone tune on many.*", "fuzz");
    if (how & 8) w.sorm.access.add("deny anyone call on one.*", "fuzz");
    Server::Wanted wanted;
    wanted.name = "fuzz";
    wanted.listen = {local.copy(), network.copy()};
    w.server = std::make_unique<Server>(w.sorm, w.reactor, w.lock, w.settings, wanted);
    {
        Clients clients(w, local, network);
        for (int i = 0; i < kOperations && !in.done(); ++i) clients.operation(in);
        if (how & 16) while (!w.owed.empty()) w.answerOne();
        for (int i = 0; i < 10; ++i) w.turn();
        clients.leave(true);
        for (int i = 0; i < 1000 && w.reactor.poll(0) > 0; ++i) {}
        clients.check();
    }
    demand(w.server->connections() == 0, "connections are left", std::int64_t(w.server->connections()));
    if (how & 1) demand(w.holders.empty(), "leases are left", std::int64_t(w.holders.size()));
    w.server.reset();
    for (int i = 0; i < 100 && w.reactor.poll(0) > 0; ++i) {}
    demand(w.holders.empty(), "leases are left when the daemon has ended", std::int64_t(w.holders.size()));
    w.owed.clear();
    w.sorm.setLoop(nullptr);
    local.forgetOthers();
    network.forgetOthers();
    return 0;
}
