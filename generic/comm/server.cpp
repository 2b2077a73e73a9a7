#include "comm/server.h"

#include <algorithm>

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include "bus/listText.h"
#include "bus/statistics.h"
#include "comm/acceptor.h"
#include "comm/errors.h"
#include "comm/keys.h"
#include "comm/peer.h"
#include "comm/random.h"
#include "comm/rpcbind.h"
#include "comm/runtimeFolder.h"
#include "comm/sessions.h"
#include "comm/siblings.h"
#include "comm/subscription.h"

namespace sorma {

namespace {

constexpr std::int64_t kSweep = 250'000'000;            // [ns]
constexpr std::int64_t kJudge = 400'000'000;            // [ns] between looks at whose certificate is revoked
constexpr std::size_t kReserved = 32;                   // places for the owner, where nobody can be told to leave
constexpr rlim_t kDescriptors = 256;                    // that connections do not take

const Prototype kKeys{Severity::warning, "TLS KEY", 1, "{}: {}"};
const Prototype kPassedOn{Severity::error, "COMM PASSED", 1, "{}: a call that it made has failed; {} here, of which {} waiting for others"};

}  // namespace

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

// Have malloc give back what is free. Otherwise glibc raises both limits by itself, and keeps up to 64 MB after a long request.
static void giveBackMemory() {
#ifdef M_MMAP_THRESHOLD
    mallopt(M_MMAP_THRESHOLD, int{kKeepSpare});
    mallopt(M_TRIM_THRESHOLD, int{2 * kKeepSpare});
#endif
}

Server::Server(Sorm& sorm, Reactor& reactor, ServerLock& lock, const Settings& settings, const Wanted& wanted)
    : sorm_(sorm), reactor_(reactor), lock_(lock), settings_(settings), name_(wanted.name), boot_(randomNumber()), started_(wallNow()),
      acceptor_(std::make_unique<Acceptor>(reactor, lock, [this](Line line, bool scarce) { adopt(std::move(line), scarce); })),
      sessions_(std::make_unique<Sessions>(*this)),
      offer_{wanted.name, [&sorm](const std::string& name, const std::string& organisation) { return sorm.access.revokes(name, organisation); }}, tls_(wanted.tls) {
    setLimits(sorm_, settings_);
    giveBackMemory();
    if (tls_ > Wanted::Tls::no || (tls_ == Wanted::Tls::unsaid && (wanted.port >= 0 || wanted.rpcbind) && keys::present())) tls::check(name_);
    ServerLock::Held held(lock_);
    try {
        for (int fd : wanted.listen) add(inheritedTransport.listen({}, fd, false));
        if (wanted.connection < 0) listen(wanted);
        else adopt(inheritedTransport.accept(wanted.connection), false);
    } catch (...) {
        stop({});
        throw;
    }
    sorm_.access.watch(this, [this] {
        sessions_->judge();
        judgeLines();
    });
    if (port_ > 0) sibling_ = std::make_unique<SiblingFile>(socket_, wanted.host, port_);
    for (int fd : wanted.listen) close(fd);
    if (wanted.connection >= 0) close(wanted.connection);
}

// Open the sockets that were not inherited.
void Server::listen(const Wanted& wanted) {
    if (socket_.empty()) {
        std::string path = wanted.socket.empty() ? runtimeSocket(name_) : wanted.socket;
        add(transportOf(addressOf(path)).listen(path, 0, wanted.share));
        ownSocket_ = true;
    }
    int port = wanted.port;
    if (port < 0 && wanted.rpcbind) port = 0;           // rpcbind registers a TCP port
    if (port >= 0 && port_ == 0) add(transportOf(addressOf(wanted.host, port)).listen(wanted.host, port, false));
    if (wanted.rpcbind) program_ = rpcbindRegister(wanted.program, wanted.host, port_);
}

void Server::add(ListeningSocket socket) {
    if (port_ == 0) port_ = socket.port;
    if (socket_.empty()) socket_ = socket.path;
    acceptor_->add(std::move(socket));
}

bool Server::listensAt(const Address& address) const { return acceptor_->at(address); }

Server::~Server() {
    sorm_.access.unwatch(this);
    stop("the daemon ends");
    ServerLock::Held held(lock_);
    while (!peers_.empty()) closePeer(peers_.begin()->first, "the daemon ends", true);
}

void Server::stop(const std::string& reason) {
    stopping_ = true;
    self_ = std::make_shared<Server*>(this);            // services that answer now find no server
    sessions_->end();
    std::vector<ClientPointer> clients;
    {
        ServerLock::Held held(lock_);
        for (auto& [peer, owned] : peers_) clients.push_back(peer->requests.client);
    }
    for (auto& client : clients) client->end();
    ServerLock::Held held(lock_);
    acceptor_->close();
    sibling_.reset();
    if (ownSocket_) unlink(socket_.c_str());
    ownSocket_ = false;
    socket_.clear();
    if (program_ != 0) rpcbindUnregister(program_);
    program_ = 0;
    // A peer whose request is being executed, perhaps the one that asked for this stop, gets its reply first: see
    // Peer::closeAfterReply.
    std::vector<Peer*> leaving;
    for (auto& [peer, owned] : peers_) {
        if (peer->onStack()) peer->closeAfterReply(reason);
        else leaving.push_back(peer);
    }
    for (Peer* peer : leaving) closePeer(peer, reason, true);
    sweepTimer_.cancel();
    judgeTimer_.cancel();
    if (depth_ == 0) closedPeers_.clear();
}

void Server::adopt(Line line, bool scarce) {
    if (tls_ > Wanted::Tls::no || (tls_ == Wanted::Tls::unsaid && keys::present())) line = tls::offered(std::move(line), offer_);
    Identity who = line.row().identify(line);
    if (who.gone) return;
    if ((scarce || peers_.size() >= places()) && !makeRoom(*sorm_.budget.of(who.principal))) return sayFull(std::move(line));
    const std::int64_t user = userOf(line, who.principal);
    auto peer = std::make_unique<Peer>(*this, std::move(line), std::make_shared<Client>(std::move(who.caller), std::move(who.principal)), user);
    peers_.emplace(peer.get(), std::move(peer));
}

std::int64_t Server::userOf(const Line& line, const PrincipalPointer& principal) {
    if (line.row().vouched) return !principal ? std::int64_t(geteuid()) : std::int64_t(principal->uid());
    if (principal && principal->kind() == Principal::Kind::cert) return sessions_->numberOf(*principal);
    return SessionKey::kByNumber;
}

void Server::refuseLine(const Error& why) {
    ++refused_;
    sorm_.mailbox()->post([&sorm = sorm_, why] {
        sorm.access.note(nullptr, why.what());
        sorm.announce(why.trail);
    });
}

// Also when a file of keys has changed, which nobody tells us.
void Server::judgeLines() {
    ServerLock::Held held(lock_);
    lookAtKeys();
    const tls::Judge judge = tls::judge(offer_);
    std::vector<std::pair<Peer*, std::string>> leaving;
    bool any = false;
    for (auto& [peer, owned] : peers_) {
        if (!peer->secure()) continue;
        any = true;
        if (auto why = peer->distrusted(judge); !why.empty()) leaving.emplace_back(peer, why);
    }
    for (auto& [peer, why] : leaving) closePeer(peer, why, true);
    judgeTimer_.cancel();
    if (any && !stopping_) judgeTimer_ = reactor_.after(monotonicNow() + kJudge, [this] { judgeLines(); });
}

// With the lock held.
void Server::lookAtKeys() {
    if (port_ == 0 || tls_ == Wanted::Tls::no || (tls_ == Wanted::Tls::unsaid && !keys::present())) return;
    std::string now = tls::trouble(offer_);
    if (std::swap(now, keyTrouble_); keyTrouble_.empty() || now == keyTrouble_) return;
    sorm_.mailbox()->post([self = std::weak_ptr(self_), &sorm = sorm_, said = errors::trailOf(kKeys, name_, keyTrouble_)] {
        sorm.announce(said);
        if (auto server = self.lock(); server && (*server)->trouble) (*server)->trouble(said.entries().front());
    });
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
        const Account* account = peer->requests.account.get();
        if (!account->owner() && (!most || account->connections > most->connections)) most = account;
    }
    if (!most || (!newcomer.owner() && most->connections <= newcomer.connections + 1)) return false;
    Peer* leaves = nullptr;
    auto rank = [](const Peer& p) { return std::pair(!p.idle(), p.lastHeard()); };
    for (auto& [peer, owned] : peers_)
        if (peer->requests.account.get() == most && (!leaves || rank(*peer) < rank(*leaves))) leaves = peer;
    ++refused_;
    closePeer(leaves, "daemon " + name_ + " is full, and most of its connections are of " + most->name() + ": this one, which was silent for " +
                       durationText(double(monotonicNow() - leaves->lastHeard())) + ", makes room for another client", true);
    return true;
}

void Server::sayFull(Line line) {
    ++refused_;
    Buffer out;
    const bool descriptors = places() < static_cast<std::size_t>(settings_.maxConnections);
    wire::writeGoodbye(out, "daemon " + name_ + " is full: it serves " + std::to_string(peers_.size()) + " connections; raise it there: " +
                                (descriptors ? "ulimit -n N" : "sorma::configure -maxconnections N"));
    if (!line.row().upgrade || line.row().inClear) (void)line.write(out.data(), out.size());
}

void Server::closePeer(Peer* peer, const std::string& reason, bool tell) {
    auto found = peers_.find(peer);
    if (found == peers_.end()) return;
    if (tell && !reason.empty() && peer->mayBeTold()) {
        Buffer out;
        wire::writeGoodbye(out, reason);
        peer->push(out.data(), out.size());
        found = peers_.find(peer);                      // push may have closed the peer
        if (found == peers_.end()) return;
    }
    peer->requests.closed();
    peer->unscheduleAll();
    if (!stopping_) sorm_.mailbox()->post([&sorm = sorm_, who = peer->requests.client->caller.toText()] { sorm.announce("connection.closed", who); });
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
        out += "from " + peer->requests.client->caller.address + " " + peer->requests.client->caller.toText() + ", " + durationText(double(now - peer->since)) +
               " old, " + std::to_string(peer->requests.calls) + " calls, " + std::to_string(peer->queued()) + " bytes queued";
    }
    return out;
}

void Server::listConnections(std::string& out, std::size_t most) const {
    ServerLock::Held held(lock_);
    for (auto& [peer, owned] : peers_) {
        if (most-- == 0) return;
        auto& caller = peer->requests.client->caller;
        std::string seconds = std::to_string((monotonicNow() - peer->since) / 1'000'000'000);
        appendListElement(out, listOf({"from", caller.toText(), caller.address, seconds, std::to_string(peer->requests.calls), std::to_string(peer->queued())}));
    }
}

std::string Server::statisticsText() const {
    ServerLock::Held held(lock_);
    return "daemon " + name_ + ": " + std::to_string(peers_.size()) + " connections, " + std::to_string(sessions_->size()) +
           " sessions, " + std::to_string(served_) + " calls served, " + std::to_string(refused_) + " connections refused, " +
           std::to_string(dropped_) + " one-way requests dropped, since " +
           clockText(started_) + (sorm_.access.isOpen() ? "; open (-open 1): whoever reaches it may call and inspect" : "");
}

void Server::addFigures(Network::Figures& sum) const {
    ServerLock::Held held(lock_);
    sum.connections += peers_.size(), sum.sessions += sessions_->size();
    sum.served += served_, sum.refused += refused_, sum.dropped += dropped_, sum.eventsLost += eventsLost_;
}

// ---- replies that come later ----

Server::Peer* Server::findPeer(const Later& later) {
    auto found = peers_.find(later.peer);
    return found != peers_.end() && found->first->number == later.peerNumber ? found->first : nullptr;
}

void Server::setLimits(Sorm& sorm, const Settings& s) {
    sorm.budget.setLimits(std::size_t(s.budget > 0 ? s.budget : 2 * s.maxMessage), std::size_t(s.totalBudget > 0 ? s.totalBudget : 8 * s.maxMessage));
}

void Server::replyLater(Later later, wire::Times times, PendingPointer pending) {
    later.started = monotonicNow();
    if (pending->answered()) return answer(later, times, *pending);
    ReplySlot* slot = sessions_->find(later);
    Peer* peer = findPeer(later);
    if (peer) {
        pending->charge = Charge(peer->requests.account, Account::Use::requests);
        pending->charge.force(sizeof(Pending) + later.size);
    }
    if (slot) sessions_->answerLater(*slot, pending);
    else if (peer) peer->requests.owe(pending);
    std::weak_ptr<Server*> self = self_;
    pending->expireBy(reactor_);
    pending->whenAnswered([self, later, times, p = pending.get()] {
        if (auto server = self.lock()) (*server)->answer(later, times, *p);
    });
    // The service has run the event loop, and meanwhile its client has ended or cancelled the call: no other code tells
    // the service.
    const ClientPointer client = pending->client();
    const bool left = !(slot || peer) || (client && client->ended()), cancelled = pending->own && pending->own->cancelled();
    if (!left && !cancelled) return;
    ServerLock::Released released(lock_);
    pending->cancel(errors::trailOf(left ? errors::kClientGone : errors::kStopped, pending->who));
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
    ReplySlot* slot = sessions_->find(later);
    if (slot) sessions_->answerLater(*slot, nullptr);
    Peer* peer = findPeer(later);
    if (!slot && (!peer || later.slot != wire::kNoSlot)) return;        // nobody will ask for it
    Buffer out;
    if (peer) {
        peer->requests.reply(later.xid, times, pending.who, *m, slot, out, later.span);
        peer->push(out.data(), out.size());
    } else {
        wire::writeReply(out, later.xid, times, *m);
        sessions_->keep(*slot, out.data(), out.size());
    }
    if (slot) sessions_->replyAgain(*slot, peer);
}

// Entries raised in this process name this daemon, and the request that shows them again.
void Server::mark(Trail& trail, const std::string& request) const {
    for (auto& e : trail.entries()) {
        if (!e.daemon.empty()) continue;
        e.daemon = name_;
        if (e.request.empty()) e.request = sorm_.masked(request);
    }
}

// A call that the service made has failed: add an entry of this daemon, with its times.
void Server::passOn(Trail& trail, std::string_view name, const wire::Times& times) const {
    Entry entry = makeEntry(kPassedOn, {MessageArg::of(name), MessageArg::of(durationText(times.ran * 1e3)), MessageArg::of(durationText(times.sub * 1e3))});
    entry.so = name;
    entry.daemon = name_;
    trail.add(std::move(entry));
}

void Server::outdated() {
    ServerLock::Held held(lock_);
    sessions_->outdated();
}

// ---- health ----

wire::Health Server::health(bool busy, const Requests& asker) {
    auto& who = asker.principal;
    const bool all = !who || (who->kind() == Principal::Kind::local && who->uid() == geteuid());
    wire::Health h;
    h.name = name_;
    h.started = started_;
    h.busy = busy;
    h.connections = all ? static_cast<std::uint32_t>(peers_.size()) : 1;
    if (all) h.underway = static_cast<std::uint32_t>(sessions_->underway());
    else if (asker.session) h.underway = static_cast<std::uint32_t>(std::ranges::count_if(asker.session->slots, [](auto& s) { return s.call || s.pending; }));
    if (busy && activity_ && !all && &activity_->caller != &asker.client->caller) {
        h.what = "a request of another client";
    } else if (busy && activity_) {
        h.what = std::string(activity_->name) + " " + toText(activity_->method) + " of " + activity_->caller.toText();
        h.since = static_cast<std::uint64_t>(std::max<std::int64_t>(monotonicNow() - activity_->since, 0) / 1000);
    } else if (busy) {
        h.what = "the program itself, outside of any request";
        h.since = static_cast<std::uint64_t>(std::max<std::int64_t>(monotonicNow() - reactor_.seen(), 0) / 1000);
    } else if (all) {
        lookAtKeys();
        h.what = keyTrouble_;
    }
    return h;
}

bool Server::peek(const std::vector<void*>& waiting) {
    watched_ = true;
    // A connection for which there is no place waits for the SORM's thread, which may make room.
    acceptor_->takeWaiting(waiting, [this](bool vouched) { return peers_.size() < places() + (vouched ? kReserved : 0); });
    for (auto& [peer, owned] : peers_)
        if (peer->unserved() || peer->brought(true) || std::find(waiting.begin(), waiting.end(), static_cast<Reactor::Watcher*>(peer)) != waiting.end()) peer->peek();
    watched_ = false;
    return activity_ != nullptr;
}

}  // namespace sorma
