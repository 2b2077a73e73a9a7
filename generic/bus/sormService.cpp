// The object `sorm`: shows and changes its SORM: classes, objects, references, connections, daemons.
#include <algorithm>
#include <set>

#include "bus/call.h"
#include "bus/glob.h"
#include "bus/listText.h"
#include "bus/measured.h"
#include "bus/requestText.h"
#include "bus/serviceParts.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kGone{Severity::error, "SERVICE GONE", 1, "sorm: there is no service object \"{}\""};
const Prototype kLook{Severity::error, "SERVICE GONE", 1, "sorm: there is no service object \"{}\"; looking does not make one"};
const Prototype kDepth{Severity::error, "SORM DEPTH", 0, "sorm: requests inside requests are {} deep, which is the limit"};
const Prototype kElsewhere{Severity::error, "NAME UNKNOWN_CLASS", 1, "sorm: {} is served elsewhere: ask there"};
const Prototype kInventory{Severity::error, "REQUEST SYNTAX", 1,
    "sorm: bad word \"{}\" of -inventory: must be addresses, busiest, classes, connections, names, objects, serves, siblings, subscriptions, or words"};
const Prototype kMethod{Severity::error, "REQUEST SYNTAX", 0, "sorm: bad method \"{}\": must be CTRL, DBX, or EXEC"};
const Prototype kBusiest{Severity::error, "REQUEST SYNTAX", 1, "sorm: busiest expects how many objects, got \"{}\""};
const Prototype kTrace{Severity::error, "REQUEST SYNTAX", 1, "sorm: {} is no W3C traceparent"};
constexpr std::size_t kMostLines = 1000;
constexpr int kMostDepth = 16;

std::string actionsText(const std::vector<Action>& actions) {
    std::string list;
    for (auto& a : actions)
        appendListElement(list, listOf({a.name, a.usage, a.help, std::to_string(a.minArgs), std::to_string(a.maxArgs)}));
    return list;
}

std::string partsText(const std::vector<Part>& parts) {
    std::string list;
    for (auto& p : parts)
        appendListElement(list, listOf({toText(p.field), std::to_string(p.count.low),
                                        p.count.high == SIZE_MAX ? std::string() : std::to_string(p.count.high), p.unit, p.help}));
    return list;
}

// The rights that the caller of a word needs: the word's own, and those of its arguments' types.
std::string rightsOf(const Action& a) {
    std::string out = toText(a.right);
    for (Kind kind : a.kinds()) {
        if (kind == Kind::file || kind == Kind::folder || kind == Kind::segment || kind == Kind::address) out += " files";
        if (kind == Kind::program) out += " program";
    }
    return out;
}

class SormService : public Service {
public:
    // A request in a request, for those who have a message at hand and no dispatcher.
    void exec(Message& m) override {
        if (depth_ >= kMostDepth) fail(kDepth, depth_);
        std::string request = std::move(m.text), reply;
        PrincipalPointer author = std::move(m.author);
        ++depth_;
        sorm().dispatch(request, reply, author);
        --depth_;
        m.clear();
        m.text = std::move(reply);
    }

    void dumpState(std::string& out) const override { out += "# " + sizes() + "\n"; }

    void classes(Args args, Message& reply) {
        for (auto* type : sorm().classes()) {
            if (!args.empty() && !globMatch(args[0], type->name())) continue;
            std::string line;
            for (auto& field : {type->name(), type->version(), type->purpose()}) appendListElement(line, field);
            addLine(reply, line);
        }
    }

    void objects(Args args, Message& reply) {
        auto names = sorm().names(args.empty() ? "*" : args[0]);
        for (std::size_t i = 0; i < names.size() && i < kMostLines; ++i) {
            Service* s = sorm().find(names[i]);
            std::string line;
            appendListElement(line, names[i]);
            if (names[i] != s->name()) appendListElement(line, "-> " + s->name());
            appendListElement(line, s->type().name());
            line += " references " + std::to_string(s->references()) + " calls " + std::to_string(s->calls()) + " at";
            appendListElement(line, s->location());
            addLine(reply, line);
        }
        if (names.size() > kMostLines)
            addLine(reply, "# and " + std::to_string(names.size() - kMostLines) + " more; give a pattern");
    }

    void referencesOf(Args args, Message& reply) {
        Service* s = sorm().find(args[0]);
        if (!s) fail(kGone, args[0]);
        if (!s->isElsewhere()) s->need(reply.author, Right::inspect);
        addLine(reply, std::to_string(s->references()));
    }

    void connections(Args, Message& reply) { network(&Network::connectionLines, reply); }
    // It asks each of them.
    void daemons(Args, Message& reply) {
        sorm().access.need(reply.author, Right::reach, "*", name());
        network(&Network::daemonLines, reply);
    }
    void statistics(Args, Message& reply) {
        addLine(reply, sizes());
        network(&Network::statisticsLines, reply);
    }

    void create(Args args, Message& reply) {
        addLine(reply, sorm().create(args[0], {args.begin() + 1, args.end()}, reply.author)->name());
    }

    void alias(Args args, Message& reply) { sorm().alias(args[0], args[1], reply.author); }

    void where(Args args, Message& reply) {
        sorm().access.need(reply.author, Right::reach, args[0], name());
        if (sorm().network) addLine(reply, sorm().network->whereLines(args[0]));
    }

    void spans(Args args, Message& reply) {
        const TraceNumber number = TraceNumber::parse(args[0]);
        if (!number) fail(kTrace, args[0]);
        if (sorm().network) reply.any = sorm().network->lateSpans(number, reply.author);
    }

    // Requests that inspectors repeat: they are not in the audit, and make no objects.
    void inventory(Args args, Message& reply) {
        static const std::vector<std::string> all = {"classes", "names", "objects", "words", "addresses", "serves"};
        DictText out;
        const Args wanted = args.empty() ? Args(all) : args;
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            auto& what = wanted[k];
            std::string list;
            if (what == "busiest") {
                std::int64_t most = 0;
                if (++k == wanted.size() || !parseNumber(wanted[k], most) || most < 0) fail(kBusiest, k < wanted.size() ? wanted[k] : std::string());
                list = busiest(std::size_t(most));
            } else if (what == "classes") {
                std::set<std::string> others;       // they are loaded when somebody names an object
                if (Host* host = sorm().host())
                    for (auto& name : host->classNames()) others.insert(name);
                for (auto* type : sorm().classes()) {
                    appendListElement(list, listOf({type->name(), type->version(), type->purpose()}));
                    others.erase(type->name());
                }
                for (auto& name : others) appendListElement(list, listOf({name, "", ""}));
            } else if (what == "names") {
                for (auto& name : sorm().names()) appendListElement(list, name);
            } else if (what == "objects") {
                for (auto& name : sorm().names()) {
                    Service* s = sorm().find(name);
                    appendListElement(list, listOf({name, s->type().name(), std::to_string(s->calls()), std::to_string(s->underWay())}));
                }
            } else if (what == "words") {
                for (auto& word : sorm().dictionary().words()) appendListElement(list, word);
            } else if (what == "addresses") {
                for (auto& word : sorm().dictionary().words("[@A-Z]*")) {
                    if (!Name::isLocation(word)) continue;
                    if (word == "@directory") continue;             // no daemon: it says who knows them
                    auto* expansion = sorm().dictionary().get(word);
                    if (expansion && !expansion->empty()) appendListElement(list, listOf({word, expansion->front()}));
                }
            } else if (what == "directory") {
                if (sorm().network) list = listOf(sorm().network->directoryNames());
            } else if (what == "siblings") {
                if (sorm().network) list = sorm().network->siblingRows();
            } else if (what == "connections") {
                if (sorm().network) list = sorm().network->connectionRows();
            } else if (what == "subscriptions") {
                list = subscriptions(reply.author);
            } else if (what == "serves") {
                if (sorm().network) list = listOf(sorm().network->served());
            } else {
                fail(kInventory, what);
            }
            out.put(what, list);
        }
        addLine(reply, out.text());
    }

    // The subscribers: {object pattern who} ..., of objects that the author may inspect.
    std::string subscriptions(const PrincipalPointer& author) {
        std::string list;
        std::size_t lines = 0;
        for (auto& name : sorm().names()) {
            Service* s = sorm().find(name);
            if (lines >= kMostLines) break;
            if (s->name() != name || !s->stream() || s->stream()->empty() || !(sorm().access.rights(author, name) & Rights(Right::inspect))) continue;
            s->stream()->each([&](const Subscriber& subscriber, const std::string& pattern) {
                if (lines++ < kMostLines) appendListElement(list, listOf({name, pattern, subscriber.who()}));
            });
        }
        return list;
    }

    // The objects whose EXEC was called most, the busiest first: {name class calls underway p99} ...; p99 [ns], 0: not timed yet.
    std::string busiest(std::size_t most) {
        std::vector<std::pair<std::uint64_t, Service*>> called;
        for (auto& name : sorm().names())
            if (Service* s = sorm().find(name); s->name() == name && s->calls() + s->underWay() > 0) called.emplace_back(s->calls(), s);
        most = std::min(most, called.size());
        std::partial_sort(called.begin(), called.begin() + std::ptrdiff_t(most), called.end(), [](auto& a, auto& b) { return a.first > b.first; });
        std::string list;
        for (std::size_t k = 0; k < most; ++k) {
            Service& s = *called[k].second;
            appendListElement(list, listOf({s.name(), s.type().name(), std::to_string(s.calls()), std::to_string(s.underWay()),
                                           std::to_string(CommonRequests::p99(s))}));
        }
        return list;
    }

    // Why a request may not be sent again when it may have run; nothing: it may. The table of a class is no secret.
    void repeatable(Args args, Message& reply) {
        Service* s = sorm().find(args[0]);
        if (!s && Name::isElsewhere(args[0])) fail(kElsewhere, args[0]);
        const Class& type = s ? s->type() : sorm().needClass(Name::parse(args[0]).className);
        Method method{};
        if (!fromText(args[1], method)) fail(kMethod, args[1]);
        Message m;
        m.words.assign(args.begin() + 2, args.end());
        std::string why = type.whyNotRepeatable(m, method);
        if (why.empty() && method == Method::exec && s && s->isDangerous() && !type.isDangerous()) why = "a part of " + args[0] + " moves, powers or fires something";
        addLine(reply, why);
    }

    // The table of a class, by the name of an object that need not be there; it is not made. Values: of one that is.
    void describe(Args args, Message& reply) {
        Service* s = sorm().find(args[0]);
        if (!s) {
            if (Name::isElsewhere(args[0])) fail(kElsewhere, args[0]);
        }
        const Permit permit = s ? s->need(reply.author, Right::inspect) : Permit::owner();        // the table of a class is no secret
        const Class& type = s ? s->type() : sorm().needClass(Name::parse(args[0]).className);
        std::string options, fixed, hints;
        for (std::size_t i = 0; i < type.options().size(); ++i) {
            auto& o = type.options()[i];
            appendListElement(options, listOf({o.name, toText(o.type), o.spec.unit, o.range(),
                                               i < type.defaults().size() ? toText(type.defaults()[i]) : std::string(),
                                               s ? s->shown(o, permit) : std::string(), o.spec.help}));
            if (o.spec.fixed || isMeasured(o)) appendListElement(fixed, o.name);
            if (auto h = o.hints(); !h.empty()) {
                appendListElement(hints, o.name);
                appendListElement(hints, h);
            }
        }
        DictText out;
        out.put("name", args[0]);
        out.put("exists", s ? "1" : "0");
        out.put("class", type.name());
        out.put("purpose", type.purpose());
        out.put("version", type.version());
        out.put("options", options);
        out.put("fixed", fixed);
        out.put("hints", hints);
        out.put("actions", actionsText(type.actions()));
        out.put("inspections", actionsText(type.inspections()));
        out.put("reads", partsText(type.reads()));
        out.put("writes", partsText(type.writes()));
        out.put("words", type.words());
        out.put("signature", type.signatureText());
        DictText rights;                            // CTRL {word right ...} DBX {word right ...}
        for (auto [method, list] : {std::pair{"CTRL", &type.actions()}, {"DBX", &type.inspections()}}) {
            DictText words;
            for (auto& a : *list) words.put(a.name, rightsOf(a));
            rights.put(method, words.text());
        }
        out.put("rights", rights.text());
        out.put("danger", listOf(type.dangers()));
        out.put("repeatable", listOf(type.repeatables()));
        out.put("example", type.example());
        out.put("help", type.helpText(args[0]));
        if (s) out.put("dump", s->dump(permit));
        addLine(reply, out.text());
    }

    // Would these words do as the recipe of an object? {word why} of each that would not.
    void check(Args args, Message& reply) {
        if (Name::isElsewhere(args[0])) fail(kElsewhere, args[0]);
        std::string list;
        for (auto& fault : faultsOf(sorm().needClass(Name::parse(args[0]).className), args[0], {args.begin() + 1, args.end()}))
            appendListElement(list, listOf({std::to_string(fault.word), fault.why}));
        addLine(reply, list);
    }

    // DBX of an object that is there, here or elsewhere: nothing is made for it, and no recipe is sent.
    void look(Args args, Message& reply) {
        Name name = Name::parse(args[0]);
        Message m;
        m.author = reply.author;
        m.words.assign(args.begin() + 1, args.end());
        if (name.local()) {
            Service* s = sorm().find(args[0]);
            if (!s) fail(kLook, args[0]);
            s->invoke(Method::dbx, m);
        } else {
            const std::string where = whereOf(name, sorm().dictionary());
            if (where.empty()) fail(kLook, args[0]);
            m.words.insert(m.words.begin(), {"-look", name.service});
            sorm().get("sorm@" + where, reply.author)->invoke(Method::dbx, m);
        }
        addLine(reply, m.text);
    }

    void remove(Args args, Message& reply) {
        std::vector<Permit> permits;
        for (auto& each : args) permits.push_back(sorm().access.need(reply.author, Right::make, sorm().canonical(each), each));
        for (auto& name : args)
            if (!sorm().find(name)) fail(kGone, name);
        for (std::size_t i = 0; i < args.size(); ++i)
            if (sorm().find(args[i])) sorm().remove(args[i], permits[i]);
    }

    // ---- who may do what ----

    void policy(Args, Message& reply) { addLine(reply, sorm().access.text()); }
    void may(Args args, Message& reply) { addLine(reply, sorm().access.explain(args[0], args[1], args[2])); }
    // The doors of a daemon: {what right target} of each.
    void doors(Args, Message& reply) {
        std::string list;
        for (auto& door : Access::doors()) appendListElement(list, listOf({door.words, toText(door.right), door.target}));
        addLine(reply, list);
    }
    void denied(Args, Message& reply) { addLine(reply, sorm().access.deniedText()); }
    void budgets(Args, Message& reply) { addLine(reply, sorm().budget.text()); }
    void allow(Args args, Message& reply) {
        sorm().access.need(reply.author, Right::policy, "policy", name());
        addLine(reply, std::to_string(sorm().access.addFirst(args[0], "sorm CTRL -allow")));
    }
    void disallow(Args args, Message& reply) {
        sorm().access.need(reply.author, Right::policy, "policy", name());
        std::int64_t number = 0;
        if (!parseNumber(args[0], number) || number < 0 || number > INT32_MAX) number = 0;
        sorm().access.remove(int(number));
    }
    void reloadPolicy(Args, Message& reply) {
        sorm().access.need(reply.author, Right::policy, "policy", name());
        sorm().access.reload();
    }

private:
    std::string sizes() const {
        return "objects " + std::to_string(sorm().size()) + ", classes " + std::to_string(sorm().classes().size()) +
               ", dictionary entries " + std::to_string(sorm().dictionary().size());
    }

    template <class Lines> void network(Lines lines, Message& reply) {
        std::string text = sorm().network ? (sorm().network->*lines)() : std::string("# this program has no COMM");
        if (!text.empty()) addLine(reply, text);
    }

    int depth_ = 0;
};

}  // namespace

// Actions that work on objects ask for the right to each of them.
Class describeSorm() {
    return Class::of<SormService>("sorm", "the service object request manager: what there is here, and how it goes")
        .action("-classes", &SormService::classes, "?pattern?", "classes: name, version, purpose", 0, 1, Right::inspect)
        .action("-objects", &SormService::objects, "?pattern?", "objects: name, class, references, calls of EXEC, place", 0, 1, Right::inspect)
        .action("-references", &SormService::referencesOf, "name", "how many hold a reference to an object", 1, 1, Right::inspect)
        .action("-connections", &SormService::connections, "", "connections to daemons, and from clients", 0, 0, Right::inspect)
        .action("-daemons", &SormService::daemons, "", "daemons of this user on this host: name, state, who, socket", 0, 0, Right::inspect)
        .action("-statistics", &SormService::statistics, "", "sizes and counts", 0, 0, Right::inspect)
        .action("-create", &SormService::create, "name ?word ...?", "make an object; words as in CTRL", 1, Action::kRest, Right::inspect)
        .action("-alias", &SormService::alias, "name target", "give an object a second name", 2, 2, Right::inspect)
        .action("-remove", &SormService::remove, "name ?name ...?", "remove objects", 1, Action::kRest, Right::inspect)
        .action("-policy", &SormService::policy, "", "who may do what: the lines that hold, and where each comes from", 0, 0, Right::inspect)
        .action("-may", &SormService::may, "subject right name", "would it be allowed, and by which line: -may {host 192.168.7.21} configure carry",
                3, 3, Right::inspect)
        .action("-allow", &SormService::allow, "line", "add a line to the policy, before all others; answers its number", 1, 1, Right::inspect)
        .action("-disallow", &SormService::disallow, "number", "take back a line that -allow has added", 1, 1, Right::inspect)
        .action("-reloadPolicy", &SormService::reloadPolicy, "", "read the file of the policy again", 0, 0, Right::inspect)
        .inspection({"-doors", "", "list of {what right target}: every way in, and the right that it asks for", 0, 0,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).doors(a, m); }})
        .inspection({"-denied", "", "what was refused: how often, to whom", 0, 0,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).denied(a, m); }})
        .inspection({"-budgets", "", "what each client makes this daemon keep, in bytes, and how much it may", 0, 0,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).budgets(a, m); }})
        .inspection({"-inventory", "?what ...?", "dict of classes, names, objects (name class calls underway), words, addresses, serves; or directory, siblings, connections, subscriptions, busiest N",
                     0, Action::kRest, [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).inventory(a, m); }})
        .inspection({"-where", "name", "each step from a name to the daemon that serves it, with its time; of an object, or @DAEMON", 1, 1,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).where(a, m); }})
        .inspection({"-spans", "traceparent", "what one-way requests and events of a trace have caused here, for sorma::trace", 1, 1,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).spans(a, m); }})
        .inspection({"-describe", "name", "dict of the table of an object's class, without making the object", 1, 1,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).describe(a, m); }})
        .inspection({"-repeatable", "name method ?word ...?", "why such a request may not be sent again when it may have run already; nothing: it may", 2,
                     Action::kRest, [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).repeatable(a, m); }})
        .inspection({"-check", "name ?word ...?", "is it a recipe for such an object: list of {word why} of what is wrong, without making the object", 1,
                     Action::kRest, [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).check(a, m); }})
        .inspection({"-look", "name word ?word ...?", "DBX of an object that is there; nothing is made, and no recipe sent", 2, Action::kRest,
                     [](Service& s, Args a, Message& m) { static_cast<SormService&>(s).look(a, m); }})
        .repeatable({"-classes", "-objects", "-references", "-connections", "-daemons", "-statistics", "-policy", "-may"})
        .actsOnWords()
        .reads(Field::text, {}, "", "a request")
        .writes(Field::text, {}, "", "its reply")
        .example("sorm CTRL -classes");
}

}  // namespace sorma
