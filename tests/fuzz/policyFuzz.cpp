// policyFuzz.cpp -- policies and requests, in any order: lines come and go, objects get second names, and somebody calls,
// inspects, configures and makes. Whatever comes:
//
//   - A line that is refused changes nothing. When a line is taken back, the policy is as before.
//   - The newest line decides. The same lines give the same policy again.
//   - Several have a right when each of them has it. `tune` gives what `use` gives, and `everything` gives all of that.
//   - rights(), -may and a request say the same. A name's spelling and its second names change nothing.
//   - A request that is refused has changed nothing, and is counted. Only the owner may change the policy.
//
// The input is a program: a byte for what to do, bytes for with what. A second judge, from the manual, is in tests/policy.test.
#include <algorithm>
#include <string>
#include <vector>

#include "bus/requestText.h"
#include "bus/sorm.h"
#include "fuzz.h"

using namespace sorma;

namespace {

constexpr int kOperations = 60;         // of one input

class Foo : public Service {
public:
    static Class describe() {
        return Class::of<Foo>("foo", "what the target asks for")
            .text("-plain", &Foo::plain_)
            .named("-file", &Foo::file_)
            .text("-key", &Foo::key_, {.secret = true})
            .text("-fire", &Foo::fire_, {.danger = Danger::fire})
            .action("-stop", &Foo::stop, "", "", 0, 0, Right::call)
            .flavors(Flavors::any);
    }
    void exec(Message&) override { ++runs_; }
    void stop(Args, Message&) { ++runs_; }
    std::uint64_t runs_ = 0;

private:
    std::string plain_, key_, fire_;
    Named<Kind::file> file_;
};

constexpr Right kRights[] = {Right::call, Right::inspect, Right::configure, Right::make, Right::dictionary, Right::files, Right::program, Right::reach, Right::operate, Right::relay};
const char* const kNames[] = {"foo", "foo.a", "foo.b", "foo.ab", "foo.secret", "nop", "/tmp/x", "/dev/shm/a", "@there", "*"};
const char* const kObjects[] = {"foo", "foo.a", "foo.b", "foo.ab", "foo.secret"};
const char* const kPieces[] = {"*", "foo", ".", "a", "[a-b]", "?", "[^a]", "[", "]", "\\", "secret", "/tmp/*", "-", "foo.*"};

std::vector<PrincipalPointer> everybody() {
    Principal::Address loopback{}, other{};
    Principal::fromText("127.0.0.1", loopback);
    Principal::fromText("192.168.7.21", other);
    std::vector<PrincipalPointer> all{Principal::nobody(), Principal::local(1, loopback), Principal::host(other), Principal::user(2, {3}), Principal::local(geteuid(), loopback)};
    all.push_back(Principal::both(all[1], all[2]));
    all.push_back(Principal::both(all[3], all[0]));
    return all;
}

std::string lineFrom(Input& in) {
    static const char* const subjects[] = {"anyone", "local daemon", "host 127.0.0.1", "host 192.168.7.0/24", "host 192.168.7.21", "user bin", "group sys", "local root", "user nosuch", "someone"};
    static const char* const words[] = {"use", "tune", "everything", "policy", "call", "inspect", "configure", "make", "dictionary", "files", "program", "reach", "operate", "relay", "on"};
    std::string line = in.below(3) ? "allow " : "deny ";
    line += subjects[in.below(std::size(subjects))];
    for (int n = in.below(4); n >= 0; --n) line += std::string(" ") + words[in.below(std::size(words))];
    if (in.below(2)) {
        line += " on ";
        for (int n = in.below(5); n >= 0; --n) line += kPieces[in.below(std::size(kPieces))];
    }
    return line;
}

// The rights of everybody to everything.
std::vector<Rights> table(const Access& access) {
    std::vector<Rights> out;
    for (auto& who : everybody())
        for (auto* name : kNames) out.push_back(access.rights(who, name));
    return out;
}

struct World {
    Sorm sorm;
    std::vector<std::string> lines;         // that hold, the newest first
    std::vector<int> numbers;               // of each
    World() {
        sorm.add(Foo::describe());
        for (auto* name : kObjects) sorm.create(name, {}, nullptr);
        sorm.alias("foo.second", "foo.a", nullptr);
        sorm.alias("foo.third", "foo.second", nullptr);
    }
    Access& access() { return sorm.access; }
};

// ---- lines ----

void addLine(World& w, Input& in) {
    const std::string line = lineFrom(in);
    const auto before = table(w.access());
    const std::string text = w.access().text();
    int number = 0;
    try {
        number = w.access().addFirst(line, "fuzz");
    } catch (const Error& e) {
        demand(e.is("POLICY SYNTAX"), "another error");
        demand(w.access().text() == text && table(w.access()) == before, "a refused line has changed something");
        return;
    }
    const auto with = table(w.access());
    demand(line.find("policy") == line.npos || line.find(" on ") < line.find("policy"), "a line gives the right to change the policy");
    w.access().remove(number);
    demand(table(w.access()) == before && w.access().text() == text, "a line that was taken back has left something");
    w.numbers.insert(w.numbers.begin(), w.access().addFirst(line, "fuzz"));
    w.lines.insert(w.lines.begin(), line);
    demand(table(w.access()) == with, "the same line means something else");
}

void removeLine(World& w, Input& in) {
    if (w.lines.empty()) return;
    const auto at = std::ptrdiff_t(in.byte() % w.lines.size());
    w.access().remove(w.numbers[std::size_t(at)]);
    w.lines.erase(w.lines.begin() + at), w.numbers.erase(w.numbers.begin() + at);
}

// A policy with the same lines says the same.
void again(World& w) {
    Access copy;
    for (auto& line : w.lines) copy.add(line, "fuzz");
    copy.setOpen(w.access().isOpen());
    demand(table(copy) == table(w.access()), "the lines give another policy");
}

// A line that comes before all others: no other one is asked.
void first(World& w, Input& in) {
    auto all = everybody();
    const Right right = kRights[in.below(std::size(kRights))];
    const std::string name = kNames[in.below(std::size(kNames))];
    for (bool allow : {false, true}) {
        const int number = w.access().addFirst(std::string(allow ? "allow" : "deny") + " anyone " + toText(right), "fuzz");
        for (auto& who : all) demand(bool(w.access().rights(who, name) & Rights(right)) == allow, "the newest line does not decide", allow);
        w.access().remove(number);
    }
    Rights had = 0;
    for (auto* sum : {"use", "tune", "everything"}) {
        Access alone;
        alone.add(std::string("allow anyone ") + sum, "fuzz");
        const Rights has = alone.rights(Principal::nobody(), name);
        demand((has & had) == had && has != had && !(has & Rights(Right::policy)), sum, has);
        had = has;
    }
}

// ---- who ----

void people(World& w) {
    auto all = everybody();
    for (auto* name : kNames) {
        demand(w.access().rights(nullptr, name) & Rights(Right::policy), "the owner may not");
        for (auto& who : all) {
            const Rights has = w.access().rights(who, name);
            demand(!(has & Rights(Right::policy)), "somebody may change the policy");
            if (who->kind() == Principal::Kind::several) {
                Rights each = Rights(~0);
                for (auto& member : who->members()) each = Rights(each & w.access().rights(member, name));
                demand(has == each, "several are not each", has);
                continue;
            }
            for (Right right : kRights) {
                if (who->kind() == Principal::Kind::user) continue;     // its groups are not in its name
                const std::string said = w.access().explain(who->toText(), toText(right), name);
                demand(said.starts_with("yes") == bool(has & Rights(right)), said.c_str(), has);
            }
        }
    }
}

// ---- requests ----

struct Request {
    const char* words;
    Rights needs;
};
const Request kRequests[] = {
    {"EXEC", Rights(Right::call)}, {"CTRL -stop", Rights(Right::call)}, {"CTRL -plain x", Rights(Right::configure)},
    {"CTRL -fire x", Right::configure | Right::operate}, {"DBX -get -plain", Rights(Right::inspect)}, {"CTRL -dump", Rights(Right::inspect)},
    {"DBX -get -key", Rights(Right::inspect)}, {"CTRL -file /tmp/x", Rights(Right::configure)},
};

void request(World& w, Input& in) {
    const std::string object = kObjects[in.below(std::size(kObjects))];
    auto all = everybody();
    const auto& who = all[std::size_t(in.below(int(all.size())))];
    const Request& asked = kRequests[in.below(std::size(kRequests))];
    std::string name = object;
    if (object == "foo.a") name = std::vector{"foo.a", "foo.second", "foo.third", "fOo.a"}[std::size_t(in.below(4))];
    Foo& target = static_cast<Foo&>(*w.sorm.find(object));
    const std::string dump = target.dump(Permit::owner());
    const std::uint64_t runs = target.runs_, denials = w.access().denials();
    Rights has = w.access().rights(who, w.sorm.canonical(name));
    demand(has == w.access().rights(who, object), "another name has other rights");
    bool may = (has & asked.needs) == asked.needs;
    if (std::string_view(asked.words).ends_with("/tmp/x")) may = may && (w.access().rights(who, "/tmp/x") & Rights(Right::files));

    Message m;
    std::string parsed, refused;
    Method method{};
    parseRequest(name + " " + asked.words, parsed, method, m);
    m.author = who;
    try {
        w.sorm.get(parsed, who)->invoke(method, m);
    } catch (const Error& e) {
        refused = e.trail.cause()->symbol;
    }
    demand((refused == "COMM DENIED") != may, asked.words, has);
    demand(w.access().denials() == denials + (may ? 0 : 1), "refusals are not counted");
    if (may && refused.empty() && std::string_view(asked.words).ends_with("/tmp/x")) {      // EXEC would ask for it again
        Message back;
        back.words = {"-file", ""};
        target.invoke(Method::ctrl, back);
    }
    if (!may) demand(target.runs_ == runs && target.dump(Permit::owner()) == dump, "a refused request has changed something");
    if (method == Method::dbx && may && refused.empty() && !(has & Rights(Right::configure)))
        demand(m.text.find("hidden") == m.text.npos, "a secret was told");
}

void make(World& w, Input& in) {
    auto all = everybody();
    const auto& who = all[std::size_t(in.below(int(all.size())))];
    const std::string spelled = in.below(2) ? "foo.New" : "fOO.nEw", name = w.sorm.canonical(spelled);
    const Rights needed = Right::make | Right::call;            // made, it is used for the first time
    const bool may = (w.access().rights(who, name) & needed) == needed;
    std::string refused;
    try {
        w.sorm.create(spelled, {}, who);
    } catch (const Error& e) {
        refused = e.trail.cause()->symbol;
    }
    demand((refused == "COMM DENIED") != may, "make", may);
    if (Service* made = w.sorm.find(name)) {
        demand(may, "an object was made");
        w.sorm.remove(made->name(), Permit::owner());
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input in(data, size);
    World w;
    for (auto* name : kObjects) {
        Message m;
        m.words = {"-key", "hidden"};
        w.sorm.call(name, Method::ctrl, m);
    }
    for (int n = 0; n < kOperations && !in.done(); ++n) {
        switch (in.below(9)) {
            case 0: case 1: case 2: addLine(w, in); break;
            case 3: removeLine(w, in); break;
            case 4: first(w, in); break;
            case 5: people(w); break;
            case 6: w.access().setOpen(in.below(2)); break;
            case 7: request(w, in); break;
            default: make(w, in); break;
        }
    }
    again(w);
    people(w);
    return 0;
}
