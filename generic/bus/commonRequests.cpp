#include <algorithm>
#include <cmath>

#include "bus/ahead.h"
#include "bus/client.h"
#include "bus/listText.h"
#include "bus/measured.h"
#include "bus/monitor.h"
#include "bus/nearest.h"
#include "bus/remembered.h"
#include "bus/serviceParts.h"

namespace sorma {

namespace {

const Prototype kNothingToUndo{Severity::error, "SERVICE FAILED", 1, "{}: there is no CTRL to undo"};

}  // namespace

// ---- what every class answers ----

int CommonRequests::needOption(Service& s, const std::string& name) {
    int index = s.type().findOption(name);
    if (index < 0) {
        std::vector<std::string> known;
        for (auto& o : s.type().options()) known.push_back(o.name);
        std::string hint = didYouMean(name, known);
        fail(kUnknownWord, s.name(), name, known.empty() ? "(this class has no options)" : oneOf(std::move(known)), hint);
    }
    return index;
}

std::string CommonRequests::describe(const Service::Record::Source& source) {
    using Kind = Service::Record::Source::Kind;
    switch (source.kind) {
        case Kind::initial: return "default";
        case Kind::recipe: return "recipe " + source.origin.toText();
        case Kind::remembered: return "remembered, set by " + source.by + " at " + clockText(source.time);
        case Kind::found: return "the object itself, at " + clockText(source.time);
        case Kind::ctrl: return "CTRL " + source.request + ", by " + source.by + " at " + clockText(source.time);
    }
    return {};
}

void CommonRequests::why(Service& s, Args args, Message& reply) {
    int index = needOption(s, args[0]);
    Service::Record::Source none;
    auto& source = s.record_ ? *s.record_->sources[index] : none;
    std::string line = args[0];
    appendWord(line, s.shown(s.type().options()[std::size_t(index)], s.need(reply.author, Right::inspect)));
    const bool remembers = s.record_ && !s.record_->remembers.empty() && s.record_->remembers[std::size_t(index)];
    const bool unread = isMeasured(s.type().options()[std::size_t(index)]) && source.kind == Service::Record::Source::Kind::initial;
    addLine(reply, line + ": " + (unread ? std::string("not measured yet") : describe(source)) + (remembers ? "; what is set is remembered" : ""));
}

// The options of the present recipe, and their words; the last word for an option counts.
static std::vector<std::pair<int, std::string>> recipeValues(Service& s) {
    std::vector<std::pair<int, std::string>> recipe;
    auto words = s.sorm().dictionary().expand(s.name());
    for (std::size_t i = 0; i < words.size(); ++i) {
        int index = s.type().findOption(words[i].text);
        if (index < 0) continue;
        std::string value = "1";
        bool flag = s.type().options()[index].type == Type::flag;
        if (i + 1 < words.size() && (!flag || !words[i + 1].text.starts_with('-'))) value = words[++i].text;
        std::erase_if(recipe, [&](auto& p) { return p.first == index; });
        recipe.emplace_back(index, value);
    }
    return recipe;
}

void CommonRequests::diff(Service& s, Args, Message& reply) {
    const auto recipe = recipeValues(s);
    bool any = false;
    const Permit permit = s.need(reply.author, Right::inspect);
    for (std::size_t i = 0; i < s.type().options().size(); ++i) {
        auto& o = s.type().options()[i];
        if (isMeasured(o)) continue;
        std::string wanted = i < s.type().defaults().size() ? toText(s.type().defaults()[i]) : std::string();
        const char* source = "default";
        for (auto& [index, value] : recipe)
            if (index == int(i)) {
                source = "recipe";
                try {
                    wanted = toText(o.parse(s.name(), value));
                } catch (const Error&) {
                    wanted = value;     // the recipe has become wrong: show it as it stands
                }
            }
        std::string now = toText(o.value(s, permit));
        if (now == wanted) continue;
        if (s.shown(o, permit) != now) now = wanted = kMask;
        std::string line = o.name;
        line += std::string(": ") + source;
        appendWord(line, wanted);
        line += ", now";
        appendWord(line, now);
        addLine(reply, line);
        any = true;
    }
    if (!any) addLine(reply, "as its recipe says");
}

std::int64_t CommonRequests::p99(Service& s) {
    return s.record().times.quantile(0.99);
}
void CommonRequests::stats(Service& s, Args, Message& reply) {
    auto& r = s.record();
    double seconds = double(monotonicNow() - r.since) / 1e9;
    addLine(reply, "EXEC " + std::to_string(s.calls()) + " CTRL " + std::to_string(r.ctrls) + " DBX " +
                       std::to_string(r.dbxs) + " errors " + std::to_string(r.errors));
    char rate[64];
    std::snprintf(rate, sizeof rate, "EXEC per second %.3g (since statistics began, %.3g s)",
                  seconds > 0 ? double(s.calls()) / seconds : 0.0, seconds);
    addLine(reply, rate);
    if (r.times.count() > 0) {
        addLine(reply, "time of EXEC, one call in 64: p50 <= " + durationText(double(r.times.quantile(0.5))) + ", p99 <= " +
                           durationText(double(r.times.quantile(0.99))));
        addLine(reply, r.times.toText());
    }
}

void CommonRequests::verbosity(Service& s, Args args, Message& reply) {
    static const Prototype kVerbosity{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside 0 .. 2"};
    if (!args.empty()) {
        s.need(reply.author, Right::configure);
        std::int64_t level = 0;
        if (!parseNumber(args[0], level) || level < 0 || level > 2) fail(kVerbosity, s.name(), "-verbosity", args[0]);
        s.verbosity_ = std::uint8_t(level);
    }
    addLine(reply, "-verbosity " + std::to_string(int(s.verbosity_)));
}

void CommonRequests::undo(Service& s, Args, Message& reply) {
    auto& r = s.record();
    if (s.guard() & Service::kLockBits) s.checkLock();
    if (r.undo.empty()) fail(kNothingToUndo, s.name());
    // The first value of each is what it had; an option that was set twice is put back once.
    Service::Applying a;
    for (auto& u : r.undo.back()) {
        if (std::any_of(a.values.begin(), a.values.end(), [&](auto& v) { return v.option == u.option; })) continue;
        const Option& o = s.type().options()[u.option];
        // The caller needs the rights that he would need to write the value, and becomes its author, too.
        if (needsOperate(o.spec.danger)) s.need(reply.author, Right::operate);
        if (o.type == Type::text) s.needKind(reply.author, o.kindOf(toText(u.value)), toText(u.value));
        a.values.push_back({u.option, u.value, Principal::both(u.source->author, reply.author)});
        a.sources.push_back(u.source.again());
        a.sources.back().edit([&](auto& source) { source.author = a.values.back().author; });
    }
    s.apply(a);
    r.undo.pop_back();
    std::string line;
    for (auto& v : a.values) {
        appendWord(line, s.type().options()[v.option].name);
        appendWord(line, s.shown(s.type().options()[std::size_t(v.option)], Permit::owner()));
    }
    addLine(reply, line);
    s.settle(a.options, reply);
}

// The recipe that makes an object as this one is. From the present recipe stay its splices, and all but its options. The options
// that differ stand behind them.
static std::string recipeOf(const Service& s, const std::vector<std::string>& words, const Dictionary& dictionary, const Permit& permit) {
    const Class& type = s.type();
    auto isAction = [&](const std::string& word) { return CommonRequests::findAction(type, word) != nullptr; };
    // The value of an option that stands at words[i], which moves to its last word.
    auto valueAt = [](const Option& o, auto& words, std::size_t& i, auto text) {
        if (i + 1 >= words.size() || (o.type == Type::flag && text(words[i + 1]).starts_with('-'))) return std::string("1");
        return std::string(text(words[++i]));
    };
    std::vector<std::string> base;
    for (std::size_t i = 0; i < type.options().size(); ++i)
        base.push_back(i < type.defaults().size() ? toText(type.defaults()[i]) : std::string());
    std::string out;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (int index = type.findOption(words[i]); index >= 0) {
            valueAt(type.options()[std::size_t(index)], words, i, [](const std::string& w) -> const std::string& { return w; });
            continue;
        }
        appendWord(out, words[i]);
        if (isAction(words[i]) || words[i] != "-SUBST" || i + 1 == words.size()) continue;
        appendWord(out, words[++i]);
        auto inner = dictionary.expand(words[i]);
        for (std::size_t k = 0; k < inner.size(); ++k) {
            int index = type.findOption(inner[k].text);
            if (index < 0) continue;
            auto& o = type.options()[std::size_t(index)];
            std::string value = valueAt(o, inner, k, [](const DictionaryWord& w) -> const std::string& { return w.text; });
            try {
                base[std::size_t(index)] = toText(o.parse(s.name(), value));
            } catch (const Error&) {
                base[std::size_t(index)] = value;       // it has become wrong: whatever the object has differs from it
            }
        }
    }
    for (std::size_t i = 0; i < type.options().size(); ++i) {
        std::string now = toText(type.options()[i].value(s, permit));
        if (now == base[i] || isMeasured(type.options()[i])) continue;
        appendWord(out, type.options()[i].name);
        appendWord(out, now);
    }
    return out;
}

void CommonRequests::save(Service& s, Args args, Message& m) {
    static const Prototype kFlavor{Severity::error, "NAME SYNTAX", 1, "{}: -save {}: must be a flavor, or {} with a flavor"};
    std::string target = args.empty() ? s.name() : args[0];
    const std::string& className = s.type().name();
    if (!args.empty() && target != className && !target.starts_with(className + ".")) target = className + "." + target;
    if (!Name::isName(target) || Name::isElsewhere(target))
        fail(kFlavor, s.name(), args.empty() ? s.name() : args[0], className);
    Dictionary& dictionary = s.sorm().dictionary();
    s.sorm().access.need(m.author, Right::dictionary, target, s.name());
    if (target != s.name() && s.holdsSecrets()) s.need(m.author, Right::configure);    // they could be read there
    // Saving launders nothing: the entry is written by all who have written its words.
    PrincipalPointer author = m.author;
    if (s.record_)
        for (auto& source : s.record_->sources) author = Principal::both(author, source->author);
    std::vector<std::string> words;
    if (auto* known = dictionary.get(s.name())) {
        words = *known;
        for (auto& w : dictionary.expand(s.name())) author = Principal::both(author, w.origin.author);
    }
    std::string recipe = recipeOf(s, words, dictionary, s.need(m.author, Right::inspect));
    std::string by = CallContext::currentCallers();
    try {
        dictionary.add(target, splitWords(recipe), by, author, s.sorm().budget.ofCaller(m.author));
    } catch (const Error& e) {
        if (!e.is("DICT LOOP")) throw;
        recipe = s.recipe(s.need(m.author, Right::inspect));            // the entry splices the one that is written, so all options are written
        dictionary.add(target, splitWords(recipe), by, author, s.sorm().budget.ofCaller(m.author));
    }
    std::string line;
    appendWord(line, target);
    if (!(s.sorm().access.rights(m.author, s.name()) & Rights(Right::configure))) recipe = s.sorm().masked(recipe);
    addLine(m, line + " " + recipe);
}

// ---- values that outlive the process ----

void CommonRequests::remember(Service& s, Args args, Message& m) {
    s.sorm().access.need(m.author, Right::dictionary, s.name(), s.name());
    s.rememberOnly(args[0], m.author, s.names_ > 0);      // a recipe says it by itself
    std::string which;
    for (std::size_t k = 0; k < s.record().remembers.size(); ++k)
        if (s.record().remembers[k]) appendWord(which, s.type().options()[k].name);
    addLine(m, which.empty() ? "remembers nothing" : "remembers " + which + " in " + s.sorm().remembered().file());
}

// The recipe's values again, or else the class's.
void CommonRequests::forget(Service& s, Args, Message& m) {
    s.sorm().access.need(m.author, Right::dictionary, s.name(), s.name());
    const auto recipe = recipeValues(s);
    auto& remembered = s.sorm().remembered();
    std::vector<DictionaryWord> words;
    std::vector<std::string> gone;
    for (auto& v : remembered.of(s.name())) {
        if (v.option == Remembered::kSwitch) continue;
        gone.push_back(v.option);
        const int index = s.type().findOption(v.option);
        if (index < 0 || isMeasured(s.type().options()[std::size_t(index)])) continue;
        auto found = std::find_if(recipe.begin(), recipe.end(), [&](auto& p) { return p.first == index; });
        for (auto& text : {v.option, found != recipe.end() ? found->second : toText(s.type().defaults()[std::size_t(index)])})
            words.push_back({text, {}}), words.back().origin.author = m.author;
    }
    if (!words.empty()) s.configure(words, false, nullptr);
    for (auto& option : gone) remembered.forget(s.name(), option);
    remembered.flush();
    std::string line;
    for (auto& w : words) appendWord(line, w.text);
    addLine(m, line.empty() ? "nothing was remembered" : line);
}

std::string CommonRequests::optionsList(Service& s, std::string_view only, const Permit& permit) {
    std::string list;
    for (std::size_t i = 0; i < s.type().options().size(); ++i) {
        auto& o = s.type().options()[i];
        if (!only.empty() && o.name != only) continue;
        std::string item;
        for (auto& field : {o.name, std::string(toText(o.type)), o.spec.unit, o.range(),
                            i < s.type().defaults().size() ? toText(s.type().defaults()[i]) : std::string(),
                            s.shown(o, permit), o.spec.help})
            appendListElement(item, field);
        appendListElement(list, item);
    }
    return list;
}

// Without the messages of objects that the viewer may not inspect.
static Trail shownTrail(Trail trail, const Sorm& sorm, const PrincipalPointer& viewer) {
    std::erase_if(trail.entries(), [&](auto& e) { return viewer && !tellable(e.so, sorm, viewer); });
    return trail;
}

// A list of dicts, as `sorma::trail` gives it.
std::string CommonRequests::trailText(const Trail& trail) {
    std::string list;
    for (auto& e : trail.entries()) {
        std::string item, code = listOf(e.code());
        auto put = [&](std::string_view key, std::string_view value) {
            appendListElement(item, key);
            appendListElement(item, value);
        };
        put("severity", toText(e.severity));
        put("code", code);
        put("text", e.text);
        put("so", e.so);
        put("daemon", e.daemon);
        put("file", e.file);
        put("line", std::to_string(e.line));
        put("time", std::to_string(e.time));
        if (!e.request.empty()) put("request", e.request);
        appendListElement(list, item);
    }
    return list;
}

// Plain values for `NAME info ...`, as Tcl lists where there is more than one.
void CommonRequests::info(Service& s, Args args, Message& reply) {
    static const Prototype kInfo{Severity::error, "REQUEST SYNTAX", 2, "{}: bad info \"{}\"{}: must be {}"};
    static const std::vector<std::string> kInfos{"actions", "class", "dump", "example", "help", "inspections", "location", "methods",
                                                 "name", "options", "purpose", "secrets", "signature", "trail", "version"};
    const std::string& what = args[0];
    auto actionList = [&](const std::vector<Action>& own, const std::vector<Action>& common) {
        std::string list;
        for (auto* set : {&own, &common})
            for (auto& a : *set) {
                std::string item;
                for (auto& field : {a.name, a.usage, a.help}) appendListElement(item, field);
                appendListElement(list, item);
            }
        return list;
    };
    std::string out;
    if (what == "options") out = optionsList(s, args.size() > 1 ? std::string_view(args[1]) : std::string_view(), s.need(reply.author, Right::inspect));
    else if (what == "class") out = s.type().name();
    else if (what == "purpose") out = s.type().purpose();
    else if (what == "name") out = s.name();
    else if (what == "secrets") {
        for (auto& o : s.type().options())
            if (o.spec.secret) appendWord(out, o.name);
        reply.ints = ahead::facts(s.type(), s.name(), s.sorm().access.rights(reply.author, s.name()));
        if (auto client = CallContext::currentClient()) client->checksAhead = true;
    }
    else if (what == "location") out = s.location();
    else if (what == "version") out = s.type().version();
    else if (what == "methods") out = "EXEC CTRL DBX";
    else if (what == "signature") out = s.type().signatureText();
    else if (what == "example") out = s.type().example();
    else if (what == "help") out = s.type().helpText(s.name());
    else if (what == "dump") out = s.dump(s.need(reply.author, Right::inspect));
    else if (what == "trail") out = trailText(shownTrail(*s.record().trail, s.sorm(), reply.author));
    else if (what == "actions") out = actionList(s.type().actions(), actions());
    else if (what == "inspections") out = actionList(s.type().inspections(), inspections());
    else fail(kInfo, s.name(), what, didYouMean(what, kInfos), oneOf(kInfos));
    reply.text += out;
}

void CommonRequests::help(Service& s, Args args, Message& m) {
    if (!args.empty() && args[0] != "expert") fail(kUnknownWord, s.name(), args[0], "expert, after -help", "");
    addLine(m, s.type().helpText(s.name(), !args.empty()));
}

void CommonRequests::stream(Service& s, Args args, Message& m) {
    auto& streams = s.record().streams;
    if (!streams) streams = std::make_unique<OpenPieces>(s);
    streams->request(args, m);
}

static const Action* ownOrCommon(const Action* own, const std::vector<Action>& common, std::string_view name) {
    if (own) return own;
    auto found = std::find_if(common.begin(), common.end(), [&](auto& a) { return a.name == name; });
    return found == common.end() ? nullptr : &*found;
}

const Action* CommonRequests::findAction(const Class& type, std::string_view name) { return ownOrCommon(type.findAction(name), actions(), name); }
const Action* CommonRequests::findInspection(const Class& type, std::string_view name) {
    return ownOrCommon(type.findInspection(name), inspections(), name);
}

const std::vector<Action>& CommonRequests::actions() {
    static const std::vector<Action> list = {
        {"-help", "?expert?", "purpose, options, signature, example; expert: also the options that few need", 0, 1, help, Right::inspect, true, Danger::none, true},
        {"-dump", "", "all state inside, as CTRL would read it again", 0, 0,
         [](Service& s, Args, Message& m) { addLine(m, s.dump(s.need(m.author, Right::inspect))); }, Right::inspect, false, Danger::none, true},
        {"-save", "?flavor?", "write the options as this name's recipe, or that of another flavor, into the dictionary", 0, 1,
         save, Right::inspect},
        {"-selftest", "", "check itself", 0, 0,
         [](Service& s, Args, Message& m) { s.answerSelftest(m); }, Right::call},
        {"-remember", "boolean|options", "1: values that are set from now on outlive the process; or those of a list of options; 0: none", 1, 1,
         remember, Right::configure},
        {"-forget", "", "give back the recipe's values for those that are remembered", 0, 0, forget, Right::configure},
        {std::string(kIf), "option value", "do all of this request, or nothing unless the option has this value", 2, 2, [](Service&, Args, Message&) {}, Right::inspect, true},
        {"-undo", "", "take back the last CTRL that set options; again: the one before, up to 10", 0, 0, undo, Right::configure, true},
    };
    return list;
}

const std::vector<Action>& CommonRequests::inspections() {
    static const std::vector<Action> list = [] {
        std::vector<Action> all = {
            {"-why", "option", "where the value of an option comes from", 1, 1, why},
            {"-diff", "", "state against recipe", 0, 0, diff},
            {"-version", "", "build and revision", 0, 0,
             [](Service& s, Args, Message& m) {
                 addLine(m, s.type().name() + " " + s.type().version() + ", SORMA " SORMA_VERSION ", compiled by " __VERSION__);
             }},
            {"-class", "", "facts of the class", 0, 0,
             [](Service& s, Args, Message& m) {
                 auto& c = s.type();
                 addLine(m, c.name() + ": " + c.purpose());
                 addLine(m, (c.file().empty() ? "declared in no file: typed, or evaluated" : "declared at " + c.file() + ":" + std::to_string(c.line())) + ", version " + c.version());
                 if (auto t = c.signatureText(); !t.empty()) addLine(m, t);
                 if (c.isRealtime()) addLine(m, "real-time: its EXEC may be a step of a cycle");
                 if (auto t = c.repeatableText(); !t.empty()) addLine(m, "may be repeated: " + t);
                 if (!c.hasFeedthrough()) addLine(m, "without feedthrough: it may close a loop of a circuit");
             }},
            {"-audit", "", "who sent which CTRL, and when", 0, 0,
             [](Service& s, Args, Message& m) {
                 static constexpr const char* states[] = {" (under way)", "", " (refused)"};
                 // Requests to sorm may hold values of any object.
                 const bool bare = m.author && &s == s.sorm().find("sorm");
                 for (auto& a : s.record().audit)
                     addLine(m, clockText(a->time) + " " + a->by + states[a->state] + ": CTRL " +
                                    (bare ? a->request.substr(0, a->request.find(' ')) : a->request));
             }},
            {"-verbosity", "?0..2?", "messages that are kept: 0 errors, 1 and warnings, 2 and verbose", 0, 1, verbosity},
            {"-stats", "", "call counts, rates, histogram of times", 0, 0, stats},
            {"-pins", "?pin length?", "where wires of a circuit end: name, in or out, at, length, unit, help", 0, 2,
             [](Service& s, Args args, Message& m) {
                 std::int64_t n = 0;
                 if (args.size() == 1 || (args.size() == 2 && (!parseNumber(args[1], n) || n < 0)))
                     fail(kMissingValue, s.name(), "-pins", "a pin, and its length");
                 for (auto& pin : args.empty() ? s.pins() : s.pins(args[0], std::size_t(n))) addLine(m, pin.toText());
             }},
            {"-trail", "", "messages of the last request that had any", 0, 0,
             [](Service& s, Args, Message& m) { addLine(m, shownTrail(*s.record().trail, s.sorm(), m.author).toText()); }},
            {"-info", "what ?option?", "plain values for programs", 1, 2, CommonRequests::info},
            {"-get", "option", "value of one option", 1, 1,
             [](Service& s, Args args, Message& m) {
                 m.text += s.shown(s.type().options()[std::size_t(CommonRequests::needOption(s, args[0]))], s.need(m.author, Right::inspect));
             }},
    };
        for (auto& action : all) action.right = Right::inspect, action.repeatable = action.name != "-verbosity";
        // All words that follow are its own: nothing comes after a request that may wait.
        all.push_back({"-stream", "open bytes request|next stream piece|close stream|list", "the reply of an EXEC in pieces, as sorma::stream reads it",
                       1, Action::kRest, stream, Right::call});
        return all;
    }();
    return list;
}

bool Class::takes(Method method, std::string_view word) const {
    return method == Method::dbx ? CommonRequests::findInspection(*this, word) != nullptr
                                 : method == Method::ctrl && (findOption(word) >= 0 || CommonRequests::findAction(*this, word));
}

Class& Class::concurrency(Concurrency concurrency) {
    if (concurrency == Concurrency::exclusive && !findAction("-lock")) {
        action({"-lock", "?seconds?", "keep other clients from EXEC and from setting options, until -unlock, this client's end, or so many seconds "
                "(60, at most 3600); again: from now on", 0, 1, CommonRequests::lock, Right::configure});
        action({"-unlock", "?break?", "free the lock; break: somebody else's, which only the daemon's owner may", 0, 1,
                CommonRequests::unlock, Right::call});
    }
    concurrency_ = concurrency;
    return *this;
}

}  // namespace sorma
