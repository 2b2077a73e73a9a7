#include "comm/server.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/listText.h"
#include "bus/statistics.h"
#include "comm/endpoint.h"
#include "comm/errors.h"
#include "comm/identity.h"
#include "comm/random.h"
#include "comm/serverParts.h"
#include "comm/siblings.h"

namespace sorma {

namespace {

constexpr std::int64_t kSweep = 250'000'000;            // [ns]
constexpr std::size_t kOrphans = 1000;                  // sessions without a connection that are remembered
constexpr std::int64_t kOrphanAge = 600'000'000'000;    // [ns]
constexpr std::int64_t kCrowd = 2'000'000;              // [ns] two peers had requests not longer ago than this
constexpr std::int64_t kSlowTurn = 1'000'000;           // [ns]
constexpr std::size_t kReserved = 32;                   // places for the owner, where nobody can be told to leave
constexpr rlim_t kDescriptors = 256;                    // that connections do not take
constexpr std::uint64_t kCrowdedTurns = 8;              // or than so many turns: where requests take long, one turn takes longer

const Prototype kPassedOn{Severity::error, "COMM PASSED", 1, "{}: a call that it made has failed; {} here, of which {} waiting for others"};
const Prototype kClientGone{Severity::error, "COMM CANCELLED", 1, "{}: its client has ended, or was disconnected for too long"};

}  // namespace

Server::Listener::Listener(Server& server, int fd, bool tcp) : server_(server), fd_(fd), tcp_(tcp) {
    server_.reactor_.add(fd_, EPOLLIN, this);
}

Server::Listener::~Listener() {
    server_.reactor_.remove(fd_, this);
    close(fd_);
}

void Server::Listener::ready(std::uint32_t) {
    ServerLock::Held held(server_.lock_);
    server_.accept(fd_, tcp_);
}

Server::Activity::Activity(Server& server, std::string_view name, Method method, const Caller& caller, std::int64_t since)
    : server(server), name(name), method(method), caller(caller), since(since), outer(server.activity_) {
    server.activity_ = this;
}

// Keep the buffer of a long message for the next one: getting a page from the kernel costs more than writing it.
void Server::giveBack(Buffer& buffer) {
    if (buffer.capacity() > spare_.capacity() && buffer.capacity() <= kKeepSpare) std::swap(buffer, spare_);
    buffer.release();
}

void Server::handBack() {
    ServerLock::Held held(lock_);
    for (Frame* f = frames_; f; f = f->outer) f->peer->spill(*f);
}

Server::Server(Sorm& sorm, Reactor& reactor, ServerLock& lock, const Settings& settings, const Wanted& wanted)
    : sorm_(sorm), reactor_(reactor), lock_(lock), settings_(settings), name_(wanted.name), boot_(randomNumber()), started_(wallNow()) {
    setLimits(sorm_, settings_);
    spareDescriptor_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
    ServerLock::Held held(lock_);
    try {
        for (int fd : wanted.listen) {
            Inherited found = inheritListener(fd);
            listeners_.push_back(std::make_unique<Listener>(*this, found.fd, found.tcp));
            if (found.tcp && port_ == 0) port_ = found.port;
            if (!found.tcp && socket_.empty()) socket_ = found.path;
        }
        if (wanted.connection < 0) listen(wanted);
        else adopt(inheritConnection(wanted.connection));
    } catch (...) {
        stop({});
        throw;
    }
    if (port_ > 0) sibling_ = std::make_unique<SiblingFile>(socket_, wanted.host, port_);
    for (int fd : wanted.listen) close(fd);
    if (wanted.connection >= 0) close(wanted.connection);
}

// Open the sockets that were not inherited.
void Server::listen(const Wanted& wanted) {
    if (socket_.empty()) {
        std::string path = wanted.socket.empty() ? runtimeSocket(name_) : wanted.socket;
        listeners_.push_back(std::make_unique<Listener>(*this, listenUnix(path, wanted.share), false));
        socket_ = path;
        ownSocket_ = true;
    }
    int port = wanted.port;
    if (port < 0 && wanted.rpcbind) port = 0;           // rpcbind registers a TCP port
    if (port >= 0 && port_ == 0) listeners_.push_back(std::make_unique<Listener>(*this, listenTcp(wanted.host, port, port_), true));
    if (wanted.rpcbind) program_ = rpcbindRegister(wanted.program, wanted.host, port_);
}

Server::~Server() {
    stop("the daemon ends");
    ServerLock::Held held(lock_);
    while (!peers_.empty()) closePeer(peers_.begin()->first, "the daemon ends", true);
}

void Server::stop(const std::string& reason) {
    stopping_ = true;
    self_ = std::make_shared<Server*>(this);            // services that answer now find no server
    std::vector<PendingPointer> pending;
    {
        ServerLock::Held held(lock_);
        for (auto& [number, session] : sessions_)
            for (auto& slot : session->slots)
                if (slot.pending) pending.push_back(std::move(slot.pending));
    }
    for (auto& p : pending) p->cancel(Trail(makeEntry(kClientGone, {MessageArg::of(p->who)})));
    std::vector<ClientPointer> clients;
    {
        ServerLock::Held held(lock_);
        for (auto& [number, session] : sessions_) clients.push_back(session->client);
        for (auto& [peer, owned] : peers_) clients.push_back(peer->client);
    }
    for (auto& client : clients) client->end();
    for (auto& [number, session] : sessions_) session->subscriptions.clear();
    ServerLock::Held held(lock_);
    listeners_.clear();
    sibling_.reset();
    if (ownSocket_) unlink(socket_.c_str());
    ownSocket_ = false;
    socket_.clear();
    if (program_ != 0) rpcbindUnregister(program_);
    program_ = 0;
    // A peer whose request is being executed, perhaps the one that asked for this stop, gets its reply first: see
    // Peer::serve.
    std::vector<Peer*> leaving;
    for (auto& [peer, owned] : peers_) {
        if (peer->onStack()) peer->closeAfterReply(reason);
        else leaving.push_back(peer);
    }
    for (Peer* peer : leaving) closePeer(peer, reason, true);
    sweepTimer_.cancel();
    acceptTimer_.cancel();
    if (spareDescriptor_ >= 0) close(std::exchange(spareDescriptor_, -1));
    if (depth_ == 0) closedPeers_.clear();
}

void Server::accept(int listener, bool tcp) {
    reactor_.seen(monotonicNow());
    for (int i = 0; i < kBatch; ++i) {
        int fd = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd >= 0) {
            adopt(fd, tcp);
            continue;
        }
        if (errno != EMFILE && errno != ENFILE) return;
        // The spare descriptor lets us accept one more connection: another one is closed for it, or it is told that we are
        // full.
        if (spareDescriptor_ >= 0) {
            close(std::exchange(spareDescriptor_, -1));
            fd = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
            if (fd >= 0) adopt(fd, tcp, true);
            spareDescriptor_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
            if (fd >= 0) continue;
            if (errno != EMFILE && errno != ENFILE) return;
        }
        // Other code of this process has taken that one, too. New connections wait in the backlog; look again later, do not
        // spin.
        Listener* waiting = nullptr;
        for (auto& l : listeners_)
            if (l->descriptor() == listener) waiting = l.get();
        reactor_.change(listener, 0, waiting);
        acceptTimer_ = reactor_.after(monotonicNow() + kSweep, [this, waiting] {
            if (spareDescriptor_ < 0) spareDescriptor_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
            for (auto& l : listeners_)
                if (l.get() == waiting) reactor_.change(l->descriptor(), EPOLLIN, waiting);
        });
        return;
    }
}

void Server::adopt(const Inherited& connection) { adopt(connection.fd, connection.tcp); }

// scarce: there is no other descriptor.
void Server::adopt(int fd, bool tcp, bool scarce) {
    if (!scarce) fd = raiseDescriptor(fd);
    if (tcp) {
        int on = 1;
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    }
    Identity who = identify(fd, tcp);
    if ((scarce || peers_.size() >= places()) && !makeRoom(*sorm_.budget.of(who.principal))) return sayFull(fd);
    std::int64_t user = SessionKey::kByNumber;
    if (!tcp) user = !who.principal ? std::int64_t(geteuid()) : std::int64_t(who.principal->uid());
    auto peer = std::make_unique<Peer>(*this, fd, std::make_shared<Client>(std::move(who.caller), std::move(who.principal)), user);
    peers_.emplace(peer.get(), std::move(peer));
}

// Connections that may be open at a time. Some descriptors stay for what services open.
std::size_t Server::places() const {
    std::size_t most = static_cast<std::size_t>(settings_.maxConnections);
    rlimit limit{};
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return most;
    return std::min<std::size_t>(most, limit.rlim_cur - std::min<rlim_t>(limit.rlim_cur / 4, kDescriptors));
}

// There is no place. The principal with most connections loses one if the newcomer has fewer: of its idle ones, the one that
// was idle longest. Connections of the owner stay, and a new one of the owner is accepted as long as others have any.
bool Server::makeRoom(const Account& newcomer) {
    if (watched_) return newcomer.owner() && peers_.size() < places() + kReserved;      // only the SORM's thread ends connections
    const Account* most = nullptr;
    for (auto& [peer, owned] : peers_) {
        const Account* account = peer->account_.get();
        if (!account->owner() && (!most || account->connections > most->connections)) most = account;
    }
    if (!most || (!newcomer.owner() && most->connections <= newcomer.connections + 1)) return false;
    Peer* leaves = nullptr;
    auto rank = [](const Peer& p) { return std::pair(!p.idle(), p.lastHeard()); };
    for (auto& [peer, owned] : peers_)
        if (peer->account_.get() == most && (!leaves || rank(*peer) < rank(*leaves))) leaves = peer;
    ++refused_;
    closePeer(leaves, "daemon " + name_ + " is full, and most of its connections are of " + most->name() + ": this one, which was silent for " +
                       durationText(double(monotonicNow() - leaves->lastHeard())) + ", makes room for another client", true);
    return true;
}

void Server::sayFull(int fd) {
    ++refused_;
    Buffer out;
    const bool descriptors = places() < static_cast<std::size_t>(settings_.maxConnections);
    wire::writeGoodbye(out, "daemon " + name_ + " is full: it serves " + std::to_string(peers_.size()) + " connections; raise it there: " +
                                (descriptors ? "ulimit -n N" : "sorma::configure -maxconnections N"));
    ssize_t ignored = send(fd, out.data(), out.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    (void)ignored;
    shutdown(fd, SHUT_WR);
    close(fd);
}

// The only place where a session gets a peer, or loses it (null).
void Server::link(Session& s, Peer* peer) {
    Peer* old = std::exchange(s.peer, peer);
    if (old && old != peer) old->session = nullptr;
    if (peer) peer->session = &s;
}

Server::Session& Server::session(Peer& peer, const wire::Hello& hello, bool& known) {
    Caller who = peer.client->caller;
    if (peer.user_ == SessionKey::kByNumber) {
        who.user = hello.user;
        who.host = hello.host;
        who.process = hello.process;
    }
    who.program = hello.program;
    const SessionKey key{peer.user_, hello.client};
    auto& mine = sessions_[key];
    known = mine != nullptr;
    if (!mine) {
        mine = std::make_unique<Session>();
        mine->key = key;
        mine->client = peer.client;
        mine->held = Charge(peer.account_, Account::Use::replies);
        mine->held.force(sizeof(Session) + 1024);
    }
    Session& s = *mine;
    Peer* old = s.peer;
    if (old)                                            // as when its connection had broken: what waits there is lost
        for (auto& [id, subscription] : s.subscriptions) subscription->stopKeeping();
    link(s, &peer);
    if (old) closePeer(old, "the same client has come by another connection", false);
    s.client->caller = std::move(who);
    s.client->principal = peer.principal_;
    if (peer.client != s.client)                        // what the client held before its HELLO
        sorm_.mailbox()->post([before = peer.client] { before->end(); });
    peer.client = s.client;
    s.lastSeen = monotonicNow();
    sorm_.mailbox()->post([&sorm = sorm_, who = s.client->caller.toText()] { sorm.announce("connection.opened", who); });
    if (!watched_) {
        s.graceTimer.cancel();
        removeOldSessions();
    }
    return s;
}

// Is it a client that we have not seen? The health responder greets no others.
bool Server::newcomer(const Peer& peer, XdrReader hello) const {
    wire::Hello h;
    return wire::readHello(hello, h) && !sessions_.contains({peer.user_, h.client});
}

// The connection of a session was closed. Its client may come back; what it holds, and its calls, stay for a while.
void Server::suspend(Session& s) {
    link(s, nullptr);
    s.lastSeen = monotonicNow();
    for (auto& [id, subscription] : s.subscriptions) subscription->stopKeeping();
    if (!s.graceTimer && !stopping_)
        s.graceTimer = reactor_.after(s.lastSeen + settings_.grace * 1'000'000, [this, key = s.key] {
            ServerLock::Held held(lock_);
            auto found = sessions_.find(key);
            if (found == sessions_.end() || found->second->peer) return;
            found->second->graceTimer.cancel();
            removeClient(key);
        });
}

// A client has ended, or was disconnected for too long: release what it holds, and cancel its calls. Its last replies
// are still kept.
void Server::removeClient(const SessionKey& key) {
    Session& s = *sessions_.find(key)->second;
    auto client = std::exchange(s.client, std::make_shared<Client>(s.client->caller, s.client->principal));
    std::vector<PendingPointer> pending;
    std::vector<CallContext*> running;      // on the stack below, and so it stays
    for (auto& slot : s.slots) {
        if (slot.pending) pending.push_back(slot.pending);
        if (slot.call) running.push_back(slot.call);
    }
    auto subscriptions = std::exchange(s.subscriptions, {});
    // Replies that it may still ask for must not use up the budget of other clients of the same principal.
    const Account& account = *s.held.account();
    for (auto& slot : s.slots) {
        if (account.used() <= account.limit() / 2) break;
        if (slot.state != Slot::State::done || slot.reply.capacity() <= kKeepBuffer) continue;
        slot.state = Slot::State::tooLarge;
        slot.size = slot.reply.size();
        freeReply(slot);
    }
    ServerLock::Released released(lock_);
    subscriptions.clear();
    for (auto* call : running) call->cancel();
    for (auto& p : pending) p->cancel(Trail(makeEntry(kClientGone, {MessageArg::of(p->who)})));
    client->end();
}

void Server::removeOldSessions() {
    if (sessions_.size() <= peers_.size() + kOrphans) return;
    std::int64_t now = monotonicNow();
    std::vector<std::pair<std::int64_t, SessionKey>> orphans;
    for (auto& [key, session] : sessions_)
        if (!session->peer && !session->running() && !session->graceTimer) orphans.emplace_back(session->lastSeen, key);
    std::sort(orphans.begin(), orphans.end(), [](auto& a, auto& b) { return a.first < b.first; });
    for (auto& [seen, key] : orphans) {
        if (now - seen <= kOrphanAge && sessions_.size() <= peers_.size() + kOrphans) return;
        sessions_.erase(key);
    }
}

void Server::closePeer(Peer* peer, const std::string& reason, bool tell) {
    auto found = peers_.find(peer);
    if (found == peers_.end()) return;
    if (tell && !reason.empty() && peer->open()) {
        Buffer out;
        wire::writeGoodbye(out, reason);
        if (peer->queued() == 0) peer->push(out.data(), out.size());
        found = peers_.find(peer);                      // push may have closed the peer
        if (found == peers_.end()) return;
    }
    if (Session* mine = peer->session) {
        suspend(*mine);
    } else if (!peer->greeted_) {                       // of no session: it will not come back
        sorm_.mailbox()->post([client = peer->client] { client->end(); });
    }
    peer->events_.clear();
    for (auto& owed : std::exchange(peer->owed_, {}))
        sorm_.mailbox()->post([owed] {
            if (auto p = owed.lock()) p->cancel(Trail(makeEntry(kClientGone, {MessageArg::of(p->who)})));
        });
    if (!stopping_) sorm_.mailbox()->post([&sorm = sorm_, who = peer->client->caller.toText()] { sorm.announce("connection.closed", who); });
    slow_.erase(peer);
    peer->closeSocket();
    auto owned = std::move(found->second);
    peers_.erase(found);
    closedPeers_.push_back(std::move(owned));               // it may be on the stack
}

void Server::watchSlow(Peer* peer) {
    slow_.insert(peer);
    if (!sweepTimer_) sweepTimer_ = reactor_.after(monotonicNow() + kSweep, [this] { sweep(); });
}

void Server::sweep() {
    ServerLock::Held held(lock_);
    sweepTimer_.cancel();
    std::int64_t now = monotonicNow();
    std::vector<std::pair<Peer*, std::string>> leaving;
    for (auto at = slow_.begin(); at != slow_.end();) {
        Peer* peer = *at;
        std::string why = peer->tooSlow(now);
        if (!why.empty()) leaving.emplace_back(peer, why);
        if (!peer->slow()) at = slow_.erase(at);
        else ++at;
    }
    for (auto& [peer, why] : leaving) closePeer(peer, why, true);
    if (!slow_.empty()) sweepTimer_ = reactor_.after(now + kSweep, [this] { sweep(); });
}

std::string Server::connectionsText() const {
    ServerLock::Held held(lock_);
    std::string out;
    std::int64_t now = monotonicNow();
    for (auto& [peer, owned] : peers_) {
        if (!out.empty()) out += '\n';
        out += "from " + peer->client->caller.address + " " + peer->client->caller.toText() + ", " + durationText(double(now - peer->since)) +
               " old, " + std::to_string(peer->calls) + " calls, " + std::to_string(peer->queued()) + " bytes queued";
    }
    return out;
}

void Server::listConnections(std::string& out, std::size_t most) const {
    ServerLock::Held held(lock_);
    for (auto& [peer, owned] : peers_) {
        if (most-- == 0) return;
        auto& caller = peer->client->caller;
        std::string seconds = std::to_string((monotonicNow() - peer->since) / 1'000'000'000);
        appendListElement(out, listOf({"from", caller.toText(), caller.address, seconds, std::to_string(peer->calls), std::to_string(peer->queued())}));
    }
}

std::string Server::statisticsText() const {
    ServerLock::Held held(lock_);
    return "daemon " + name_ + ": " + std::to_string(peers_.size()) + " connections, " + std::to_string(sessions_.size()) +
           " sessions, " + std::to_string(served_) + " calls served, " + std::to_string(refused_) + " connections refused, " +
           std::to_string(dropped_) + " one-way requests dropped, since " +
           clockText(started_);
}

// ---- replies that come later ----

Server::Peer* Server::findPeer(const Later& later) {
    auto found = peers_.find(later.peer);
    return found != peers_.end() && found->first->number == later.peerNumber ? found->first : nullptr;
}

// The slot of a call that is under way; null when it has none, or its session is no more.
Server::Slot* Server::findSlot(const Later& later) {
    if (later.slot == wire::kNoSlot) return nullptr;
    auto found = sessions_.find(later.session);
    if (found == sessions_.end() || later.slot >= found->second->slots.size()) return nullptr;
    Slot& slot = found->second->slots[later.slot];
    return slot.state == Slot::State::running && slot.sequence == later.sequence ? &slot : nullptr;
}

void Server::setLimits(Sorm& sorm, const Settings& s) {
    sorm.budget.setLimits(std::size_t(s.budget > 0 ? s.budget : 2 * s.maxMessage), std::size_t(s.totalBudget > 0 ? s.totalBudget : 8 * s.maxMessage));
}

// The memory is charged. It stays from one reply to the next, so replies of the same size cost nothing more.
void Server::keepReply(Slot& slot, const char* record, std::size_t size) {
    if (slot.reply.capacity() > kKeepBuffer && size <= kKeepBuffer) freeReply(slot);
    if (size > slot.reply.capacity()) {
        freeReply(slot);
        // Some room stays for requests, without which kept replies are of no use.
        Charge& held = slot.of->held;
        const Account& account = *held.account();
        bool fits = size <= Slot::kSmall ||
                    (size <= static_cast<std::size_t>(settings_.keepReply) && account.used() + size <= account.limit() - account.limit() / 4 &&
                     held.set(held.bytes() + size));
        if (!fits) {
            slot.state = Slot::State::tooLarge;
            slot.size = size;
            return;
        }
    }
    slot.state = Slot::State::done;
    slot.reply.resize(size);                            // exactly, when it is new
    std::memcpy(slot.reply.data(), record, size);
}

void Server::freeReply(Slot& slot) {
    slot.of->held.force(slot.of->held.bytes() - slot.charged());
    slot.reply.release();
}

// The client asked again while the call ran: the reply goes where it is now, unless it went there already.
void Server::replyAgain(const Later& later, Slot& slot, Peer* answered) {
    slot.asked = false;
    Peer* now = sessions_.find(later.session)->second->peer;
    if (!now || now == answered || slot.state != Slot::State::done) return;
    XdrWriter::put(slot.reply.data() + wire::kMarkSize, slot.askedXid);
    now->push(slot.reply.data(), slot.reply.size());
}

void Server::replyLater(Later later, wire::Times times, PendingPointer pending) {
    later.started = monotonicNow();
    if (pending->answered()) return answer(later, times, *pending);
    Slot* slot = findSlot(later);
    Peer* peer = findPeer(later);
    if (peer) {
        pending->charge = Charge(peer->account_, Account::Use::requests);
        pending->charge.force(sizeof(Pending) + later.size);
    }
    if (slot) {
        slot->pending = pending;
    } else if (peer) {
        std::erase_if(peer->owed_, [](auto& weak) { return weak.expired(); });
        peer->owed_.push_back(pending);
    }
    std::weak_ptr<Server*> self = self_;
    if (!pending->deadline.none())
        pending->timer = reactor_.after(pending->deadline.when(), [weak = std::weak_ptr(pending)] {
            if (auto p = weak.lock()) p->expire();
        });
    pending->whenAnswered([self, later, times, p = pending.get()] {
        if (auto server = self.lock()) (*server)->answer(later, times, *p);
    });
    // The service has run the event loop, and its client has ended meanwhile: no other code tells the service.
    const ClientPointer client = pending->client();
    if ((slot || peer) && !(client && client->ended())) return;
    ServerLock::Released released(lock_);
    pending->cancel(Trail(makeEntry(kClientGone, {MessageArg::of(pending->who)})));
}

void Server::answer(const Later& later, wire::Times times, Pending& pending) {
    ServerLock::Held held(lock_);
    times.ran += static_cast<std::uint32_t>(std::min<std::int64_t>((monotonicNow() - later.started) / 1000, UINT32_MAX / 2));
    if (pending.own) times.sub = pending.own->subTime;
    Message failed;
    Message* m = &pending.message;
    if (pending.failed()) {
        failed.code = -1;
        failed.trail = pending.failure;
        if (times.sub > 0) passOn(failed.trail, pending.who, times);
        m = &failed;
    }
    mark(m->trail, {});
    Slot* slot = findSlot(later);
    if (slot) slot->pending.reset();
    Peer* peer = findPeer(later);
    if (!slot && (!peer || later.slot != wire::kNoSlot)) return;        // nobody will ask for it
    Buffer out;
    if (peer) {
        peer->reply(later.xid, times, pending.who, *m, slot, out);
        peer->push(out.data(), out.size());
    } else {
        wire::writeReply(out, later.xid, times, *m);
        keepReply(*slot, out.data(), out.size());
    }
    if (slot && slot->asked) replyAgain(later, *slot, peer);
}

// Entries raised in this process name this daemon, and the request that shows them again.
void Server::mark(Trail& trail, const std::string& request) const {
    for (auto& e : trail.entries()) {
        if (!e.daemon.empty()) continue;
        e.daemon = name_;
        if (e.request.empty()) e.request = request;
    }
}

// A call that the service made has failed: add an entry of this daemon, with its times.
void Server::passOn(Trail& trail, std::string_view name, const wire::Times& times) const {
    Entry entry = makeEntry(kPassedOn, {MessageArg::of(name), MessageArg::of(durationText(times.ran * 1e3)), MessageArg::of(durationText(times.sub * 1e3))});
    entry.so = name;
    entry.daemon = name_;
    trail.add(std::move(entry));
}

// ---- fairness: a peer that floods gets at most twice as many requests as the next one asks for ----
//
// Twice, since many requests at a time cost less than one at a time. When requests take long they all cost the same, and a
// client that blocks misses a turn now and then; then it gets no more than the next one.

int Server::share(const Peer* peer) const {
    bool crowded = reactor_.seen() - crowded_ < kCrowd || reactor_.turns() - crowdedTurn_ <= kCrowdedTurns;
    int all = crowded && share_ > 0 ? share_ : kBatch;
    // A peer may come twice in a turn: with what was left here, and with what it has sent.
    return peer->turn == reactor_.turns() ? std::max(all - peer->inTurn, 0) : all;
}

void Server::took(Peer* peer, int served, bool more) {
    if (turn_.number != reactor_.turns()) {
        if (turn_.peers > 1) {
            bool slow = reactor_.seen() - turn_.began > kSlowTurn;
            share_ = std::clamp(slow ? turn_.second : 2 * turn_.second, slow ? 1 : 2, kBatch);
            crowded_ = reactor_.seen();
            crowdedTurn_ = reactor_.turns();
        }
        turn_ = {reactor_.turns(), 0, 0, 0, nullptr, reactor_.seen()};
    }
    if (served == 0) return;
    if (peer->turn != turn_.number) {
        peer->turn = turn_.number;
        peer->inTurn = 0;
        ++turn_.peers;
    }
    peer->inTurn += served;
    int asked = peer->inTurn + (more ? 1 : 0);          // it wanted more than it got
    if (peer == turn_.busiest) {
        turn_.most = std::max(turn_.most, asked);
    } else if (asked > turn_.most) {
        turn_.second = std::exchange(turn_.most, asked);
        turn_.busiest = peer;
    } else {
        turn_.second = std::max(turn_.second, asked);
    }
}

// ---- health ----

wire::Health Server::health(bool busy) const {
    wire::Health h;
    h.name = name_;
    h.started = started_;
    h.busy = busy;
    h.connections = static_cast<std::uint32_t>(peers_.size());
    for (auto& [number, session] : sessions_)
        for (auto& slot : session->slots)
            if (slot.pending) ++h.underway;
    if (busy && activity_) {
        h.what = std::string(activity_->name) + " " + toText(activity_->method) + " of " + activity_->caller.toText();
        h.since = static_cast<std::uint64_t>(std::max<std::int64_t>(monotonicNow() - activity_->since, 0) / 1000);
    } else if (busy) {
        h.what = "the program itself, outside of any request";
        h.since = static_cast<std::uint64_t>(std::max<std::int64_t>(monotonicNow() - reactor_.seen(), 0) / 1000);
    }
    return h;
}

bool Server::peek(const std::vector<void*>& waiting) {
    watched_ = true;
    for (auto& listener : listeners_) {
        if (std::find(waiting.begin(), waiting.end(), static_cast<Reactor::Watcher*>(listener.get())) == waiting.end()) continue;
        int fd = -1;
        // A connection for which there is no place waits for the SORM's thread, which may make room.
        while (peers_.size() < places() + (listener->tcp() ? 0 : kReserved) &&
               (fd = accept4(listener->descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)) >= 0)
            adopt(fd, listener->tcp());
    }
    for (auto& [peer, owned] : peers_)
        if (peer->unserved() || std::find(waiting.begin(), waiting.end(), static_cast<Reactor::Watcher*>(peer)) != waiting.end()) peer->peek();
    watched_ = false;
    return activity_ != nullptr;
}

}  // namespace sorma
