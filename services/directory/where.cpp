// How a name is resolved, for people: each step, what it says, and how long it took.

#include "bus/deadline.h"
#include "bus/statistics.h"
#include "comm/transport.h"
#include "rows.h"

namespace directory {

namespace {

using namespace sorma;

constexpr std::int64_t kPatience = 2000;                // [ms] for the directory

// Writes lines, each with the time since the one before.
class Steps {
public:
    void say(std::string_view who, const std::string& what) {
        const std::int64_t now = monotonicNow();
        if (!text_.empty()) text_ += '\n';
        text_ += who;
        text_ += ": " + what + " (" + durationText(double(now - last_)) + ")";
        last_ = monotonicNow();
    }
    const std::string& text() const { return text_; }

private:
    std::string text_;
    std::int64_t last_ = monotonicNow();
};

// Tell what the directory says of an alias.
void askDirectory(Directory& directory, const std::string& alias, Steps& steps) {
    using State = Directory::Found::State;
    Directory::Found found;
    const Deadline deadline = Deadline::in(kPatience);
    while ((found = directory.find(alias)).state == State::asking && !deadline.passed()) directory.wait(deadline.when());
    const std::string who = "directory, " + directory.describe();
    if (found.state != State::known) return steps.say(who, found.why);
    std::string where;
    for (auto& address : found.entry.addresses) where += (where.empty() ? "" : ", ") + address;
    steps.say(who, found.entry.identity + ", at " + where + ", epoch " + std::to_string(found.entry.epoch) +
                       (found.age > 0 ? "; it is away, and said this " + durationText(double(found.age)) + " ago" : std::string()));
}

}  // namespace

std::string where(Comm& comm, Sorm& sorm, const std::string& text) {
    using State = Transport::Found::State;
    Steps steps;
    const Name name = Name::parse(text.starts_with('@') ? "sorm" + text : text);
    if (name.local()) return steps.say("name", name.service + " is of this process"), steps.text();
    std::string rule;
    const Address address = resolve(name, sorm.dictionary(), &rule);
    const bool alias = address.kind == Address::Kind::alias;
    steps.say("dictionary", alias ? "it has no entry @" + address.host : rule + " leads to " + address.toText());
    if (isHere(address)) return steps.text();
    if (alias && comm.directory().remote()) askDirectory(*comm.directory().get(), address.host, steps);
    auto found = alias ? comm.directory().place(address) : transportOf(address).place(address);
    if (found.state == State::asks && !alias) {
        found.target = transportOf(address).lookUp(address);
        steps.say("host", hostOf(address) + " is " + hostOf(found.target));
        found.state = State::known;
    }
    steps.say("address", found.state == State::known ? describe(found.target) + (comm.resolver().find(text).state == Resolution::State::here ? ", which is this process" : "") : found.why);
    return steps.text();
}

}  // namespace directory
