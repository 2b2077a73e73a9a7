// blackboard -- values with names, which anybody may put, get, and wait for.
//
// Each put gives a value a version: 1, 2, 3 ... of its name. After a removal the versions of a name go on. So a version never
// falls back, and a reader that waits for a later one does not miss it. Who follows a value:
//
//     board EXEC version door         -> ints {v}
//     board EXEC get door             -> the value, of version v or later
//     board EXEC wait door v          returns when there is something newer; then again from the top
#include <charconv>
#include <map>

#include <sorma.h>

#include "bus/glob.h"
#include "bus/kept.h"
#include "bus/listText.h"

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "BLACKBOARD WORD", 2,
                             "{}: bad word \"{}\": must be get, names, put, remove, version, or wait"};
const sorma::Prototype kUsage{Severity::error, "BLACKBOARD SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const sorma::Prototype kVersion{Severity::error, "BLACKBOARD VERSION", 2,
                                "{}: version \"{}\" must be a whole number, 0 or more, as word \"version\" returns it"};
const sorma::Prototype kUnknown{Severity::error, "BLACKBOARD UNKNOWN", 2,
                                "{}: there is no value \"{}\"; put makes it, wait waits for it"};
const sorma::Prototype kFull{Severity::error, "BLACKBOARD FULL", 1,
                             "{}: no room for \"{}\": it has {} values, -max {}; remove some, or set -max"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

std::size_t partsSize(const Message& m) { return m.text.size() + 8 * (m.floats.size() + m.ints.size()) + m.any.size(); }

void copyParts(const Message& from, Message& to) {
    to.text = from.text;
    to.floats = from.floats;
    to.ints = from.ints;
    to.any = from.any;
}

class Blackboard : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Blackboard>("blackboard", "keeps named values, and tells those who wait for them")
            .integer("-max", &Blackboard::max_, {.unit = "values", .low = 1, .high = 1e9, .help = "values that it keeps at most"})
            .concurrency(sorma::Concurrency::concurrent)
            .words("put name | get name | wait name ?version? | version name | remove name | names ?pattern?")
            .reads(text, {}, "", "put: the value, all four parts").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "get, wait: the value as it was put; names: a Tcl list")
            .writes(floats, {}, "", "").writes(ints, {}, "", "put, version: the version, 0 when there is no value").writes(any, {}, "", "")
            .repeatable({"get", "wait", "version", "names"})
            .example("blackboard EXEC put door TMSG open");
    }

    void exec(Message& m) override {
        std::string word = m.words.empty() ? std::string() : m.words[0];
        if (word == "put") put(m);
        else if (word == "get") get(m);
        else if (word == "wait") wait(m);
        else if (word == "version") version(m);
        else if (word == "remove") remove(m);
        else if (word == "names") names(m);
        else fail(kWord, name(), word);
    }

    void removing() override {
        sorma::Error gone(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())}));
        for (auto& [key, waiters] : std::exchange(waiters_, {}))
            for (auto& [ticket, waiter] : waiters) waiter.reply.fail(gone);
    }

    void dumpState(std::string& out) const override {
        std::size_t waiting = 0;
        for (auto& [key, waiters] : waiters_) waiting += waiters.size();
        out += "# values " + std::to_string(values_.size()) + "\n# waiting " + std::to_string(waiting) + "\n";
    }

private:
    struct Value {
        Message parts;
        std::string event;                  // "put.NAME", kept because put is what happens most
        std::size_t heap() const { return sorma::heapOf(parts) + 2 * sorma::heapOf(event); }       // and the name
    };
    struct Entry {
        sorma::Charged<Value> value;        // on the account of who has put it
        std::int64_t version = 0;
    };
    struct Waiter {
        std::int64_t after;
        sorma::Reply reply;
    };

    // The name that a request is about.
    std::string key(const Message& m, const char* usage, std::size_t mostWords = 2) const {
        if (m.words.size() < 2 || m.words.size() > mostWords || m.words[1].empty()) fail(kUsage, name(), usage);
        return m.words[1];
    }

    void put(Message& m) {
        std::string key = this->key(m, "put name");
        auto found = values_.find(key);
        const bool fresh = found == values_.end();
        if (fresh) {
            if (values_.size() >= std::size_t(max_)) fail(kFull, name(), key, values_.size(), max_);
            found = values_.emplace(key, Entry{{}, removed_}).first;
        }
        Entry& entry = found->second;
        try {
            entry.value.refill(name(), sorm().budget.ofCaller(), sorma::Account::Use::values, partsSize(m) + 2 * key.size() + 16,
                               [&](Value& value) {
                                   if (value.event.empty()) value.event = "put." + key;
                                   copyParts(m, value.parts);
                               });
        } catch (...) {
            if (fresh) values_.erase(found);
            throw;
        }
        ++entry.version;
        m.clear();
        m.ints.push_back(entry.version);
        publish(entry.value->event, entry.value->parts);
        wake(key, entry);
    }

    void get(Message& m) {
        const Entry& entry = find(key(m, "get name"))->second;
        m.clear();
        copyParts(entry.value->parts, m);
    }

    void version(Message& m) {
        auto found = values_.find(key(m, "version name"));
        m.clear();
        m.ints.push_back(found == values_.end() ? 0 : found->second.version);
    }

    void remove(Message& m) {
        std::string key = this->key(m, "remove name");
        auto found = find(key);
        removed_ = std::max(removed_, found->second.version);
        values_.erase(found);
        m.clear();
        publish("remove." + key, m);
    }

    void names(Message& m) {
        if (m.words.size() > 2) fail(kUsage, name(), "names ?pattern?");
        std::string pattern = m.words.size() == 2 ? m.words[1] : "*";
        m.clear();
        for (auto& [key, entry] : values_)
            if (sorma::globMatch(pattern, key)) sorma::appendListElement(m.text, key);
    }

    void wait(Message& m) {
        std::string key = this->key(m, "wait name ?version?", 3);
        auto found = values_.find(key);
        std::int64_t present = found == values_.end() ? 0 : found->second.version, after = present;
        if (m.words.size() == 3) {
            auto& given = m.words[2];
            auto [end, error] = std::from_chars(given.data(), given.data() + given.size(), after);
            if (error != std::errc() || end != given.data() + given.size() || after < 0) fail(kVersion, name(), given);
        }
        if (present > after) {
            m.clear();
            return copyParts(found->second.value->parts, m);
        }
        sorma::Reply reply = later(m);
        std::uint64_t ticket = ++tickets_;
        waiters_[key].emplace(ticket, Waiter{after, reply});
        reply.onCancel([this, key, ticket] {
            auto waiting = waiters_.find(key);
            if (waiting == waiters_.end()) return;          // the value is on its way, nobody will read it
            auto mine = waiting->second.find(ticket);
            if (mine == waiting->second.end()) return;
            mine->second.reply.complete();
            waiting->second.erase(mine);
            if (waiting->second.empty()) waiters_.erase(waiting);
        });
    }

    void wake(const std::string& key, const Entry& entry) {
        auto waiting = waiters_.find(key);
        if (waiting == waiters_.end()) return;
        std::erase_if(waiting->second, [&](auto& item) {
            auto& waiter = item.second;
            if (waiter.after >= entry.version) return false;
            waiter.reply.message().clear();
            copyParts(entry.value->parts, waiter.reply.message());
            waiter.reply.complete();
            return true;
        });
        if (waiting->second.empty()) waiters_.erase(waiting);
    }

    std::map<std::string, Entry>::iterator find(const std::string& key) {
        auto found = values_.find(key);
        if (found == values_.end()) fail(kUnknown, name(), key);
        return found;
    }

    std::int64_t max_ = 100'000;
    std::map<std::string, Entry> values_;
    std::map<std::string, std::map<std::uint64_t, Waiter>> waiters_;        // of a name; no empty ones
    std::uint64_t tickets_ = 0;
    std::int64_t removed_ = 0;              // the highest version that a removed value had: a new name begins above it
};

}  // namespace

extern "C" SORMA_EXPORT int Blackboard_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::blackboard", "1.0", {Blackboard::describe()});
}
