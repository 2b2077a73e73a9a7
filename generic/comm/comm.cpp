#include "comm/comm.h"

#include <algorithm>
#include <cstdio>

#include "bus/listText.h"
#include "bus/monitor.h"
#include "comm/errors.h"
#include "comm/random.h"
#include "comm/runtimeFolder.h"
#include "comm/siblings.h"
#include "comm/wireSpan.h"

namespace sorma {

namespace {

const Prototype kServed{Severity::error, "COMM REFUSED", 1, "this process serves the name \"{}\" already"};
const Prototype kNotServed{Severity::error, "SERVICE GONE", 1, "this process does not serve the name \"{}\""};
const Prototype kName{Severity::error, "NAME SYNTAX", 1, "bad daemon name \"{}\": letters, digits, _ - and . only"};

const Prototype kUnresolved{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: {}"};

const Prototype kSilent{Severity::error, "DIRECTORY SILENT", 1, "{}: {} has not granted the name: {}; look after it, or start without -directory"};

const Prototype kEnded{Severity::error, "SERVICE GONE", 1, "{}: the standby daemon was told to end before it owned the name"};
const Prototype kFree{Severity::error, "COMM REFUSED", 1, "{}: the name is free, but this standby daemon cannot serve it: {}"};

constexpr std::int64_t kAgain = 500'000'000;    // [ns] between attempts of a standby daemon, at most
constexpr std::int64_t kGrant = 5000;   // [ms] for the directory to grant a name
constexpr std::int64_t kProbe = 500;    // [ms] for a daemon to say who it is
constexpr std::size_t kMostRows = 1000;  // connections that are listed for programs

bool goodName(const std::string& name) {
    return !name.empty() && name[0] != '.' && std::all_of(name.begin(), name.end(), [](unsigned char c) {
        return std::isalnum(c) || c == '_' || c == '-' || c == '.';
    });
}

}  // namespace

Comm::Comm(Sorm& sorm) : Comm(sorm, std::make_shared<Settings>()) {}

Comm::Comm(Sorm& sorm, std::shared_ptr<Settings> own) : settings(*own), sorm_(sorm), proxyClass_(std::make_shared<Class>(Proxy::describe())), shared_(std::move(own)), reactor_(std::make_shared<Reactor>(sorm.mailbox())),
      directory_(sorm, *reactor_), resolver_(sorm.dictionary(), directory_, [this](const Address& a) { return servesAt(a); }, sorm.mailbox()) {
    sorm_.setLoop(reactor_.get());
    sorm_.network = this;
    directory_.changed = [this] { directoryChanged(); };
}

Comm::~Comm() {
    healthResponder_.reset();
    folder_.reset();
    std::map<std::shared_ptr<Directory>, std::vector<std::string>> claimed;
    for (auto& [name, directory] : claims_) claimed[directory].push_back(name);
    for (auto& [directory, names] : claimed) directory->release(names);
    claims_.clear();
    for (auto& [name, ownership] : ownerships_) sorm_.fences.remove(ownership.get());
    servers_.clear();
    stopped_.clear();
    finish();
    for (auto& [key, weak] : connections_)
        if (auto connection = weak.lock()) connection->end();
    sorm_.setLoop(nullptr);
    sorm_.network = nullptr;
}

void Comm::finish() {
    for (auto& [key, weak] : connections_) {
        auto connection = weak.lock();
        // On stderr, since nobody is left who could be told otherwise.
        auto left = connection ? connection->finish(Deadline::at(monotonicNow() + settings.onewayWait * 1'000'000)) : std::string();
        if (!left.empty()) std::fprintf(stderr, "sorma: %s\n", left.c_str());
    }
}

std::shared_ptr<Connection> Comm::lineTo(const Name& name) {
    std::string rule;
    Address address = resolve(name, sorm_.dictionary(), &rule);
    if (isHere(address)) return nullptr;
    if (connections_.size() >= sweepAt_) {
        std::erase_if(connections_, [](auto& item) { return item.second.expired(); });
        sweepAt_ = std::max<std::size_t>(64, 2 * connections_.size());
    }
    auto& known = connections_[rule + ' ' + address.toText() + ' ' + std::to_string(int(address.tls))];
    if (auto connection = known.lock()) return connection;
    // Each reconnect looks the address up again, by the rule that is the same for all proxies of this connection.
    Name ruler = name;
    if (rule[0] == '@') {
        ruler.where = rule.substr(1);
        ruler.byDefault = false;
    }
    const auto made = std::make_shared<std::weak_ptr<Connection>>();
    auto locate = [self = std::weak_ptr(self_), &sorm = sorm_, ruler, address, made] {
        Address now = resolve(ruler, sorm.dictionary());
        const auto comm = self.lock();
        if (isHere(now)) return address;                // the name is local now: keep the old address
        if (!comm) return now;
        if (const auto own = made->lock()) own->follow((*comm)->epochOf(now));
        return (*comm)->placed(now);
    };
    std::string who = !name.where.empty() ? name.where : rule[0] == '@' ? rule.substr(1) : address.toText();
    auto connection = std::make_shared<Connection>(std::move(who), locate, shared_, reactor_, sorm_.mailbox());
    connection->whenDropped = [&sorm = sorm_](Trail trail) {
        sorm.mailbox()->post([&sorm, trail = std::move(trail)] { sorm.announce(trail); });
    };
    *made = connection;
    known = connection;
    return connection;
}

std::shared_ptr<std::int64_t> Comm::epochOf(const Address& address) {
    if (address.kind != Address::Kind::alias) return std::make_shared<std::int64_t>(0);
    auto& known = epochs_[address.host];
    auto epoch = known.lock();
    if (!epoch) known = epoch = std::make_shared<std::int64_t>(0);
    return epoch;
}

// Connections tell the epochs that the directory tells now.
void Comm::heedEpochs() {
    const auto directory = heardDirectory(0);
    std::erase_if(epochs_, [](auto& item) { return item.second.expired(); });
    for (auto& [alias, weak] : epochs_) {
        const auto found = directory ? directory->find(alias) : Directory::Found();
        const auto epoch = weak.lock();
        if (!directory) *epoch = 0;
        else if (found.state == Directory::Found::State::known) *epoch = found.entry.epoch;
    }
    for (auto& [place, weak] : std::map(connections_))
        if (const auto connection = weak.lock()) connection->heedOwner();
}

std::shared_ptr<Connection> Comm::privateLine(const std::string& where) {
    auto locate = [self = std::weak_ptr(self_), where]() -> Address {
        auto comm = self.lock();
        if (!comm) fail(kUnresolved, where, "the program ends");
        Resolution place = (*comm)->resolver_.find("@" + where);
        if (place.state == Resolution::State::known) return place.target;
        fail(kUnresolved, where, place.state == Resolution::State::here ? "it is this process" : place.why);
    };
    auto line = std::make_shared<Connection>(where, locate, shared_, reactor_, sorm_.mailbox());
    line->inBackground();
    return line;
}

Address Comm::placed(const Address& address) {
    if (address.kind != Address::Kind::alias) return address;
    const auto epoch = epochOf(address);
    if (!directory_.remote()) return *epoch = 0, address;
    const auto found = directory_.place(address);
    if (found.state == Transport::Found::State::known) *epoch = found.epoch;
    if (found.state == Transport::Found::State::asks) fail(errors::kAsked, address.host, found.why);
    if (found.state == Transport::Found::State::absent) fail(kUnresolved, address.host, found.why);
    return found.target;
}

void Comm::directoryChanged() {
    if (std::exchange(tells_, true)) return;
    sorm_.mailbox()->post([self = std::weak_ptr(self_)] {
        const auto comm = self.lock();
        if (!comm) return;
        (*comm)->tells_ = false;
        (*comm)->heedEpochs();
        if ((*comm)->resolver_.changed) (*comm)->resolver_.changed();
        (*comm)->sorm_.announce("directory.changed", "");
    });
}

// The name is ours, or the daemon is not there.
void Comm::claim(Server& server, const Server::Wanted& wanted) {
    Directory::Entry entry{server.name(), Caller::self().toText(), thisMachine()};
    if (!server.socket().empty()) entry.addresses.push_back(server.socket());
    if (server.port() > 0) {
        const bool any = wanted.host.empty() || wanted.host == "0.0.0.0" || wanted.host == "::";
        entry.addresses.push_back(addressOf(any ? Caller::self().host : wanted.host, server.port()).toText());
    }
    const auto directory = directory_.get();
    directory->claim(entry);
    const Deadline deadline = Deadline::in(kGrant);
    Directory::Claim got;
    while ((got = directory->claimed(entry.name)).state == Directory::Claim::State::asking && !deadline.passed()) directory->wait(deadline.when());
    if (got.state == Directory::Claim::State::owned) {
        claims_[entry.name] = directory;
        server.setFence(fence(wanted, entry));
        return;
    }
    directory->release({entry.name});
    if (got.state == Directory::Claim::State::taken) failTaken("the name " + entry.name + " of " + directory->describe(), got.why);
    fail(kSilent, entry.name, directory->describe(), got.why);
}

std::uint64_t Comm::fence(const Server::Wanted& wanted, const Directory::Entry& self) {
    if (const auto old = ownerships_.extract(wanted.name)) sorm_.fences.remove(old.mapped().get());
    if (wanted.owned.empty()) return 0;
    auto& own = ownerships_[wanted.name] = std::make_unique<Ownership>(directory_.get(), self, wanted.owned);
    sorm_.fences.add(own.get());
    return own->serial;
}

bool Comm::servesAt(const Address& a) const {
    return std::any_of(servers_.begin(), servers_.end(), [&](auto& item) { return item.second->listensAt(a); });
}

std::unique_ptr<Service> Comm::makeProxy(const Name& name, std::vector<std::string> recipe, const PrincipalPointer& relayFor, Probe probe) {
    auto connection = lineTo(name);
    Deadline deadline = Deadline::in(settings.timeout).earlier(CallContext::currentDeadline());
    // The daemon makes the object now, so that a name that cannot be served is told at once. And it says what is secret there.
    auto secrets = Proxy::Secrets::later;
    Message told;
    const std::uint64_t doubts = connection->doubts();
    if (probe == Probe::now) try {
        told.words = {"-info", "secrets"};
        connection->call(name.service, Method::dbx, told, deadline, relayFor);
        secrets = sorm_.learnSecrets(told.text) ? Proxy::Secrets::some : Proxy::Secrets::none;
    } catch (const Error& e) {
        // A daemon of a release before this question takes it as a syntax error: the object is there, and has no secrets.
        if (e.is("REQUEST SYNTAX")) secrets = Proxy::Secrets::none;
        // The request itself may be allowed, and its refusal says what it needs.
        else if (e.is("COMM DENIED")) secrets = Proxy::Secrets::untold;
        else throw;
    }
    auto proxy = std::make_unique<Proxy>(name.service, std::move(connection), shared_,
                                         Proxy::Line{sorm_.locationChanges(), [comm = std::weak_ptr(self_), name] {
                                             auto found = comm.lock();
                                             return found ? (*found)->lineTo(name) : nullptr;
                                         }}, relayFor);
    if (!recipe.empty()) proxy->setRecipe(std::move(recipe), probe);
    proxy->setSecrets(secrets);
    proxy->setFacts(std::move(told.ints), doubts);
    if (secrets > Proxy::Secrets::some) sorm_.awaitSecrets(name.toText());
    return proxy;
}

void Comm::checkServable(const std::string& name) {
    sorm_.access.need(nullptr, Right::reach, name, name);
    if (!goodName(name)) fail(kName, name);
    if (servers_.contains(name)) fail(kServed, name);
}

void Comm::await(const Server::Wanted& wanted) {
    checkServable(wanted.name);
    directory_.get();                           // tell now what is wrong with its line
    if (!standbys_.try_emplace(wanted.name).second) fail(kServed, wanted.name);
    fence(wanted, {wanted.name, Caller::self().toText()});
}

bool Comm::taken(const std::string& name) {
    const Directory::Found found = directory_.get()->find(name);
    // The local directory knows sockets without owners, too: a dead daemon may have left it.
    return found.state != Directory::Found::State::absent && (directory_.remote() || !found.entry.identity.empty());
}

Server* Comm::serveIfFree(const Server::Wanted& wanted) {
    auto found = standbys_.find(wanted.name);
    if (found == standbys_.end()) fail(kEnded, wanted.name);
    if (monotonicNow() < found->second.next || taken(wanted.name)) return nullptr;
    try {
        Server& server = serve(wanted);
        standbys_.erase(wanted.name);
        return &server;
    } catch (const Error& e) {
        if (!e.is("COMM REFUSED") && !e.is("DIRECTORY SILENT")) throw;
        // Another one may have been faster. The same reason twice is told: somebody has to do something about it.
        Standby& own = standbys_[wanted.name];
        own.next = monotonicNow() + kAgain / 2 + std::int64_t(randomNumber() % std::uint64_t(kAgain / 2));
        const std::string why = e.what();
        if (why != std::exchange(own.why, why)) own.told = false;
        else if (!std::exchange(own.told, true) && !taken(wanted.name) && trouble) trouble(errors::trailOf(kFree, wanted.name, why).entries().front());
        return nullptr;
    }
}

Server& Comm::serve(const Server::Wanted& wanted) {
    stopped_.erase(std::remove_if(stopped_.begin(), stopped_.end(), [](auto& s) { return !s->serving(); }), stopped_.end());
    checkServable(wanted.name);
    auto server = std::make_unique<Server>(sorm_, *reactor_, lock_, settings, wanted);
    server->trouble = [this](const Entry& what) {
        if (trouble) trouble(what);
    };
    if (wanted.directory) claim(*server, wanted);
    else fence(wanted, {});
    if (sorm_.daemonName.empty()) sorm_.access.daemon = sorm_.daemonName = wanted.name;
    if (!healthResponder_)
        healthResponder_ = std::make_unique<HealthResponder>(*reactor_, lock_, [this](const std::vector<void*>& waiting) {
            bool busy = false;
            for (auto& [name, s] : servers_) busy = s->peek(waiting) || busy;
            return busy;
        });
    if (auto slash = server->socket().rfind('/'); server->port() > 0 && slash != std::string::npos && (!folder_ || !folder_->alive()))
        folder_ = std::make_unique<FolderWatch>(*reactor_, server->socket().substr(0, slash), ".tcp",
                                                [this] { sorm_.announce("siblings.changed", ""); });
    ServerLock::Held held(lock_);
    return *servers_.emplace(wanted.name, std::move(server)).first->second;
}

// name by value: it may be the very key that goes.
void Comm::unserve(std::string name, const std::string& reason) {
    if (standbys_.erase(name) > 0) return;
    auto found = servers_.find(name);
    if (found == servers_.end()) fail(kNotServed, name);
    if (const auto claimed = claims_.extract(name)) claimed.mapped()->release({name});
    std::unique_ptr<Server> server;
    {
        ServerLock::Held held(lock_);
        server = std::move(found->second);
        servers_.erase(found);
    }
    if (sorm_.daemonName == name) sorm_.access.daemon = sorm_.daemonName = servers_.empty() ? "" : servers_.begin()->first;
    server->stop(reason);
    if (server->serving()) stopped_.push_back(std::move(server));
}

void Comm::outdated() {
    for (auto& [name, server] : servers_) server->outdated();
}

Server* Comm::findServer(const std::string& name) {
    auto found = servers_.find(name);
    return found == servers_.end() ? nullptr : found->second.get();
}

std::vector<Comm::Found> Comm::daemons() {
    std::vector<Found> out;
    sorm_.access.need(nullptr, Right::reach, "*", "daemons");
    std::string folder = runtimeFolder();
    for (auto& name : namesIn(folder, kSocketEnding)) out.push_back({name, folder + "/" + name + std::string(kSocketEnding), {}, {}, 0, {}});
    for (auto& d : out) {
        if (servers_.contains(d.name)) {                // ourselves: we cannot answer while we ask
            d.state = "alive";
            d.identity = Caller::self().toText();
            d.process = Caller::self().process;
            continue;
        }
        Connection probe(d.name, [&] { return addressOf(d.socket); }, shared_, reactor_, sorm_.mailbox());
        try {
            wire::Health h = probe.health(Deadline::in(kProbe));
            auto& w = probe.daemon();
            d.state = h.busy ? "busy" : "alive";
            d.what = h.what;
            d.identity = w.user + "@" + w.host + " " + w.program + "[" + std::to_string(w.process) + "]";
            d.process = std::int64_t(w.process);
        } catch (const Error& error) {
            d.state = error.is("COMM REFUSED") ? "dead" : error.is("COMM TIMEOUT") ? "busy" : error.what();
            if (d.state == "dead") sweepSocket(d.socket);       // told once
        }
    }
    if (const auto directory = heardDirectory(kProbe))
        for (auto& entry : directory->entries()) {
            if (std::any_of(out.begin(), out.end(), [&](auto& d) { return d.name == entry.name; })) continue;
            out.push_back({entry.name, entry.addresses.empty() ? std::string() : entry.addresses.front(), "listed", entry.identity, 0, {}});
        }
    return out;
}

// Null: the dictionary names none, or it cannot be used.
std::shared_ptr<Directory> Comm::heardDirectory(std::int64_t milliseconds) {
    if (!directory_.remote()) return nullptr;
    try {
        const auto directory = directory_.get();
        for (const Deadline deadline = Deadline::at(monotonicNow() + milliseconds * 1'000'000); !directory->told() && !deadline.passed();) directory->wait(deadline.when());
        return directory;
    } catch (const Error&) {
        return nullptr;
    }
}

std::string Comm::whereLines(const std::string& name) {
    Directory::load(sorm_);
    if (!Directory::steps) fail(kUnresolved, name, "the module sorma::service::directory, which tells the steps, is not installed");
    return Directory::steps.load()(*this, sorm_, name);
}

std::vector<std::string> Comm::directoryNames() {
    std::vector<std::string> out;
    if (const auto directory = heardDirectory(0))
        for (auto& entry : directory->entries()) out.push_back(entry.name);
    return out;
}

// ---- for DBX of the SORM ----

namespace {

void addLine(std::string& out, const std::string& text) {
    if (!out.empty() && !text.empty()) out += '\n';
    out += text;
}

}  // namespace

std::vector<std::string> Comm::served() const {
    std::vector<std::string> names;
    for (auto& [name, server] : servers_) names.push_back(name);
    return names;
}

std::string Comm::connectionLines() const {
    std::string out;
    for (auto& [key, weak] : connections_)
        if (auto c = weak.lock()) addLine(out, "to " + c->facts());
    for (auto& [name, server] : servers_) addLine(out, server->connectionsText());
    return out;
}

std::string Comm::connectionRows() const {
    std::string out;
    for (auto& [key, weak] : connections_)
        if (auto c = weak.lock()) appendListElement(out, c->row());
    for (auto& [name, server] : servers_) server->listConnections(out, kMostRows);
    return out;
}

std::string Comm::statisticsLines() const {
    std::string out;
    for (auto& [name, server] : servers_) addLine(out, server->statisticsText());
    return out;
}

Network::Figures Comm::figures() const {
    Figures sum;
    for (auto& [name, server] : servers_) server->addFigures(sum);
    return sum;
}

std::string Comm::daemonLines() {
    std::string out;
    for (auto& d : daemons()) {
        std::string item;
        for (auto& field : {d.name, d.state, d.identity, d.socket})
            if (!field.empty()) appendListElement(item, field);
        addLine(out, item);
    }
    return out;
}

std::vector<std::string> Comm::known() const {
    std::vector<std::string> out;
    for (auto& [key, weak] : connections_)
        if (auto connection = weak.lock()) out.push_back(connection->who());
    if (sorm_.access.rights(nullptr, "daemons") & Rights(Right::reach))
        for (auto& name : namesIn(runtimeFolder(), kSocketEnding))
            if (!servers_.contains(name) && std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
    return out;
}

std::vector<unsigned char> Comm::lateSpans(TraceNumber number, const PrincipalPointer& author) const {
    auto shown = [&](const std::string& name) { return tellable(name, sorm_, author); };
    const Buffer bytes = wire::lateSpansOf(sorm_.lateSpans(), number, shown, !author);
    return {bytes.data(), bytes.data() + bytes.size()};
}

std::string Comm::siblingRows() const {
    std::string out;
    for (auto& s : siblings()) appendListElement(out, listOf({s.name, s.host, std::to_string(s.port)}));
    return out;
}

}  // namespace sorma
