#include "comm/resolver.h"

#include <map>
#include <mutex>
#include <optional>
#include <system_error>

#include "bus/catalogue.h"
#include "bus/deadline.h"
#include "bus/detached.h"
#include "bus/dictionary.h"
#include "comm/directory.h"
#include "comm/transport.h"

namespace sorma {

namespace {

constexpr std::int64_t kKnown = 60'000'000'000, kUnknown = 10'000'000'000;      // [ns] for which an answer is believed
constexpr int kMostThreads = 16;
constexpr std::size_t kMostAnswers = 10'000;

}  // namespace

struct Resolver::Shared : std::enable_shared_from_this<Resolver::Shared> {
    struct Answer {
        std::optional<Address> target;  // none and why: it is not known
        std::string why;
        std::int64_t came = 0;          // [ns]; 0: never
        bool asking = false;
    };
    std::mutex mutex;
    std::map<std::string, Answer> answers;      // by address
    int threads = 0;
    std::shared_ptr<Mailbox> mailbox;
    Resolver* owner = nullptr;                  // for the SORM's thread alone

    Answer look(const std::string& key, const Address& address);
};

Resolver::Shared::Answer Resolver::Shared::look(const std::string& key, const Address& address) {
    std::lock_guard lock(mutex);
    if (answers.size() > kMostAnswers) std::erase_if(answers, [](auto& a) { return !a.second.asking; });
    Answer& known = answers[key];
    std::int64_t age = monotonicNow() - known.came;
    bool old = known.came == 0 || age > (known.target ? kKnown : kUnknown);
    if (!old || known.asking || threads >= kMostThreads) return known;
    try {
        startDetached([self = shared_from_this(), key, address] {
            Answer answer;
            try {
                answer.target = transportOf(address).lookUp(address);       // blocks for as long as it takes
            } catch (const Error& e) {
                answer.why = e.what();
            }
            answer.came = monotonicNow();
            {
                std::lock_guard inside(self->mutex);
                self->answers[key] = answer;
                --self->threads;
            }
            self->mailbox->post([self] {
                if (self->owner && self->owner->changed) self->owner->changed();
            });
        });
        ++threads;
        known.asking = true;
    } catch (const std::system_error& e) {
        known.why = std::string("cannot start the thread that looks it up: ") + e.what();
    }
    return known;
}

Resolver::Resolver(const Dictionary& dictionary, ChosenDirectory& directory, std::function<bool(const Address&)> serves, std::shared_ptr<Mailbox> mailbox)
    : dictionary_(dictionary), directory_(directory), serves_(std::move(serves)), shared_(std::make_shared<Shared>()) {
    shared_->mailbox = std::move(mailbox);
    shared_->owner = this;
}

Resolver::~Resolver() { shared_->owner = nullptr; }

Resolution Resolver::find(std::string_view text) {
    Resolution out;
    Address address;
    const bool place = text.starts_with('@');
    if (place) address = Address::parse(text.substr(1));
    const Name name = place ? Name() : Name::parse(text);
    out.service = name.service;
    if (!place && name.local()) {
        out.state = Resolution::State::here;
        return out;
    }
    try {
        out.where = place ? std::string(text.substr(1)) : whereOf(name, dictionary_);
        if (!place) address = resolve(name, dictionary_);
        else if (address.kind == Address::Kind::alias) address = resolve(Name::parse("sorm" + std::string(text)), dictionary_);
    } catch (const Error& e) {
        out.address = address;
        out.why = e.what();
        return out;
    }
    Resolution found = followed(address);
    found.service = std::move(out.service);
    found.where = std::move(out.where);
    return found;
}

Resolution Resolver::followed(const Address& given) {
    using State = Transport::Found::State;
    Resolution out;
    out.address = out.target = given;
    if (isHere(given)) {
        out.state = Resolution::State::here;
        return out;
    }
    auto found = given.kind == Address::Kind::alias ? directory_.place(given) : transportOf(given).place(given);
    if (found.state == State::asks && given.kind == Address::Kind::alias) {
        out.state = Resolution::State::asking;
        out.why = found.why;
        return out;
    }
    if (found.state == State::asks) {
        auto answer = shared_->look(given.toText(), given);
        if (!answer.target) {
            out.state = answer.came == 0 && answer.why.empty() ? Resolution::State::asking : Resolution::State::unresolved;
            out.why = answer.why.empty() ? "host " + hostOf(given) + " is being looked up" : answer.why;
            return out;
        }
        found = {State::known, *answer.target};
        found.target.wait = given.wait, found.target.tls = given.tls, found.target.as = given.as;      // another name may lead to the same place
    }
    out.target = found.target;
    if (serves_(out.target)) out.state = Resolution::State::here;
    else if (found.state == State::known) out.state = Resolution::State::known;
    else out.why = found.why;
    return out;
}

}  // namespace sorma
