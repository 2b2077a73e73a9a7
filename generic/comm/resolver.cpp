#include "comm/resolver.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <unistd.h>

#include <map>
#include <mutex>
#include <system_error>
#include <thread>

#include "bus/catalogue.h"
#include "bus/deadline.h"
#include "bus/dictionary.h"
#include "comm/endpoint.h"
#include "comm/signalsBlocked.h"

namespace sorma {

namespace {

constexpr std::int64_t kKnown = 60'000'000'000, kUnknown = 10'000'000'000;      // [ns] for which an answer is believed
constexpr int kMostThreads = 16;
constexpr std::size_t kMostAnswers = 10'000;

// Is it a number already, or a name that needs no other host? Brackets of IPv6 go.
bool isNumeric(const std::string& host) {
    unsigned char space[16];
    std::string bare = host.size() > 2 && host.front() == '[' ? host.substr(1, host.size() - 2) : host;
    return inet_pton(AF_INET, bare.c_str(), space) == 1 || inet_pton(AF_INET6, bare.c_str(), space) == 1;
}

bool isLoopback(const std::string& host) { return host == "localhost" || host == "[::1]" || host.starts_with("127."); }

}  // namespace

struct Resolver::Shared : std::enable_shared_from_this<Resolver::Shared> {
    struct Answer {
        std::string host, why;          // number; empty and why: it is not known
        int port = 0;                   // of a program
        std::int64_t came = 0;          // [ns]; 0: never
        bool asking = false;
    };
    std::mutex mutex;
    std::map<std::string, Answer> answers;      // by "host" or "host:0xprogram"
    int threads = 0;
    std::shared_ptr<Mailbox> mailbox;
    Resolver* owner = nullptr;                  // for the SORM's thread alone

    Answer look(const std::string& key, const Address& address);
    static Answer ask(const Address& address);
};

// Blocks for as long as it takes.
Resolver::Shared::Answer Resolver::Shared::ask(const Address& address) {
    Answer out;
    addrinfo hints{}, *list = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    if (int code = getaddrinfo(address.host.c_str(), nullptr, &hints, &list); code != 0) {
        out.why = "host " + address.host + " is not known: " + gai_strerror(code);
        return out;
    }
    char text[NI_MAXHOST];
    if (getnameinfo(list->ai_addr, list->ai_addrlen, text, sizeof text, nullptr, 0, NI_NUMERICHOST) == 0)
        out.host = list->ai_family == AF_INET6 ? "[" + std::string(text) + "]" : text;
    freeaddrinfo(list);
    if (address.kind != Address::Kind::program) return out;
    out.port = rpcbindLookup(address.host, address.number);
    if (out.port == 0) out.host.clear(), out.why = "rpcbind on " + address.host + " knows no program " + address.toText().substr(address.toText().rfind(':') + 1);
    return out;
}

Resolver::Shared::Answer Resolver::Shared::look(const std::string& key, const Address& address) {
    std::lock_guard lock(mutex);
    if (answers.size() > kMostAnswers) std::erase_if(answers, [](auto& a) { return !a.second.asking; });
    Answer& known = answers[key];
    std::int64_t age = monotonicNow() - known.came;
    bool old = known.came == 0 || age > (known.host.empty() ? kUnknown : kKnown);
    if (!old || known.asking || threads >= kMostThreads) return known;
    try {
        SignalsBlocked blocked;
        std::thread([self = shared_from_this(), key, address] {
            Answer answer = ask(address);
            answer.came = monotonicNow();
            {
                std::lock_guard inside(self->mutex);
                self->answers[key] = answer;
                --self->threads;
            }
            self->mailbox->post([self] {
                if (self->owner && self->owner->changed) self->owner->changed();
            });
        }).detach();
        ++threads;
        known.asking = true;
    } catch (const std::system_error& e) {
        known.why = std::string("cannot start the thread that looks it up: ") + e.what();
    }
    return known;
}

Resolver::Resolver(const Dictionary& dictionary, std::function<bool(const Address&)> serves, std::shared_ptr<Mailbox> mailbox)
    : dictionary_(dictionary), serves_(std::move(serves)), shared_(std::make_shared<Shared>()) {
    shared_->mailbox = std::move(mailbox);
    shared_->owner = this;
}

Resolver::~Resolver() { shared_->owner = nullptr; }

Place Resolver::find(std::string_view text) {
    Place out;
    Address address;
    if (text.starts_with('@')) {
        out.where = text.substr(1);
        address = Address::parse(out.where);
        if (address.kind == Address::Kind::alias) {
            Name name = Name::parse("sorm" + std::string(text));
            try {
                address = resolve(name, dictionary_);
            } catch (const Error& e) {
                out.address = address;
                out.why = e.what();
                return out;
            }
        }
    } else {
        Name name = Name::parse(text);
        out.service = name.service;
        out.where = name.where;
        if (name.local()) {
            out.state = Place::State::here;
            return out;
        }
        try {
            if (name.byDefault) {
                auto entry = dictionary_.expand(name.location());
                if (!entry.empty()) out.where = entry[0].text.starts_with('@') ? entry[0].text.substr(1) : entry[0].text;
            }
            address = resolve(name, dictionary_);
        } catch (const Error& e) {
            out.why = e.what();
            return out;
        }
    }
    Place found = followed(address);
    found.service = std::move(out.service);
    found.where = std::move(out.where);
    return found;
}

Place Resolver::followed(const Address& given) {
    Place out;
    out.address = out.target = given;
    auto known = [&] {
        out.state = serves_(out.target) ? Place::State::here : Place::State::known;
        return out;
    };
    switch (given.kind) {
        case Address::Kind::self:
            out.state = Place::State::here;
            return out;
        case Address::Kind::path: return known();
        case Address::Kind::alias:
            try {
                out.target = {Address::Kind::path, runtimeSocket(given.host), 0, given.wait};
            } catch (const Error& e) {
                out.why = e.what();
                return out;
            }
            if (known().state == Place::State::here || access(out.target.host.c_str(), F_OK) == 0) return out;
            out.state = Place::State::unresolved;
            out.why = "the dictionary has no entry @" + given.host + ", and no daemon of this user listens on " + out.target.host;
            return out;
        case Address::Kind::tcp:
            if (isNumeric(given.host) || isLoopback(given.host)) return known();
            break;
        case Address::Kind::program: break;
    }
    std::string key = given.kind == Address::Kind::program ? given.toText() : given.host;
    auto answer = shared_->look(key, given);
    if (answer.host.empty()) {
        out.state = answer.came == 0 && answer.why.empty() ? Place::State::asking : Place::State::unresolved;
        out.why = answer.why.empty() ? "host " + given.host + " is being looked up" : answer.why;
        return out;
    }
    out.target = {Address::Kind::tcp, answer.host, given.kind == Address::Kind::program ? std::uint32_t(answer.port) : given.number, given.wait};
    return known();
}

}  // namespace sorma
