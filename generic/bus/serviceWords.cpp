#include "bus/serviceParts.h"

#include <algorithm>

#include "bus/measured.h"
#include "bus/nearest.h"

namespace sorma {

namespace {

const Prototype kReadonly{Severity::error, "OPTION READONLY", 2, "{}: {} can only be set by a recipe, when the object is made"};

const Prototype kMeasured{Severity::error, "OPTION READONLY", 2, "{}: {} is measured: nobody sets it"};

const Prototype kChanged{Severity::error, "OPTION CHANGED", 2, "{}: {} is {}, not {}, so nothing of the request is done: somebody has set it meanwhile"};

const Prototype kUncertain{Severity::error, "OPTION VALUE", 2, "{}: -if cannot ask for {}, which is secret"};

constexpr std::string_view kSubstWord = "-SUBST";

[[noreturn]] void failUnknown(const std::string& name, const Class& type, std::string_view word, bool ctrl) {
    std::vector<std::string> known;
    if (ctrl)
        for (auto& o : type.options()) known.push_back(o.name);
    for (auto& a : ctrl ? type.actions() : type.inspections()) known.push_back(a.name);
    for (auto& a : ctrl ? CommonRequests::actions() : CommonRequests::inspections()) known.push_back(a.name);
    std::string hint = didYouMean(word, known);
    fail(kUnknownWord, name, word, oneOf(std::move(known)), hint);
}

// Takes the arguments of an action: the least it needs, then more while they are no words of the table.
template <class IsKnown>
Args takeArguments(const std::string& name, const Action& action, const std::vector<std::string>& words, std::size_t at,
                   IsKnown isKnown) {
    std::size_t rest = words.size() - at, least = std::size_t(action.minArgs);
    if (rest < least) fail(kMissingValue, name, action.name, "arguments: " + action.usage);
    std::size_t n = least;
    if (action.maxArgs == Action::kRest) n = rest;
    else
        while (n < std::size_t(action.maxArgs) && n < rest && !isKnown(words[at + n])) ++n;
    return Args(words).subspan(at, n);
}

// Runs f. An error in a word of a recipe then also says where the word stands. An error of another object tells its own place.
// inEntry: does the word come from an entry that was added at run time? Asked after an error only.
template <class F, class G> void readAt(const Origin& origin, F f, G inEntry) {
    try {
        f();
    } catch (const Error& e) {
        Error placed = e;
        for (auto& entry : placed.trail.entries()) {
            if (entry.severity != Severity::error) continue;
            if (entry.so.empty() && (!origin.file.empty() || !origin.via.empty() || inEntry())) entry.text += " (" + (origin.file.empty() ? "its recipe, " : std::string()) + origin.toText() + ")";
            break;
        }
        throw placed;
    }
}

template <class F> void readAt(const Origin& origin, F f) {
    readAt(origin, f, [] { return false; });
}

// Is this word of what an object is made with one of its entry in the dictionary? Others came with the request that makes it.
bool isOfEntry(Dictionary& dictionary, const std::string& name, std::size_t at) {
    return dictionary.has(name) && at < dictionary.expand(name).size();
}

// birth: by the recipe.
void needChangeable(const std::string& name, const Option& o, bool birth) {
    if (isMeasured(o)) fail(kMeasured, name, o.name);
    if (!birth && o.spec.fixed) fail(kReadonly, name, o.name);
}

[[noreturn]] void failMissing(const std::string& name, const Option& o) {
    std::string what = std::string("a value: ") + toText(o.type);
    if (!o.spec.unit.empty()) what += " [" + o.spec.unit + "]";
    if (auto r = o.range(); !r.empty()) what += ", " + r;
    fail(kMissingValue, name, o.name, what);
}

}  // namespace

std::vector<WordFault> faultsOf(const Class& type, const std::string& name, const std::vector<std::string>& words) {
    std::vector<WordFault> faults;
    auto known = [&](const std::string& word) {
        return word == kSubstWord || type.takes(Method::ctrl, word);
    };
    for (std::size_t i = 0; i < words.size();) {
        std::size_t at = i++;
        try {
            auto& word = words[at];
            if (word == kSubstWord) {
                ++i;                                        // what stands there comes from another entry
            } else if (int index = type.findOption(word); index >= 0) {
                const Option& o = type.options()[index];
                bool flag = o.type == Type::flag;
                if (isMeasured(o)) {
                    if (i < words.size() && !(flag && words[i].starts_with('-'))) ++i;
                    needChangeable(name, o, true);
                }
                if (flag && (i == words.size() || words[i].starts_with('-'))) continue;
                if (i == words.size()) failMissing(name, o);
                if (words[i] == kSubstWord) continue;
                at = i++;
                o.parse(name, words[at]);
            } else {
                const Action* action = CommonRequests::findAction(type, word);
                if (!action) {
                    while (i < words.size() && !known(words[i])) ++i;      // they belong to it
                    failUnknown(name, type, word, true);
                }
                i += takeArguments(name, *action, words, i, known).size();
            }
        } catch (const Error& error) {
            faults.push_back({at, error.what()});
        }
    }
    return faults;
}

void checkWords(const Class& type, const std::string& name, const std::vector<std::string>& words, bool ctrl, Rights rights) {
    auto may = [&](Right right, Danger danger) { return (rights & Rights(right)) && (!needsOperate(danger) || (rights & Rights(Right::operate))); };
    auto find = [&](std::string_view word) { return ctrl ? CommonRequests::findAction(type, word) : CommonRequests::findInspection(type, word); };
    auto known = [&](const std::string& word) { return (ctrl && type.findOption(word) >= 0) || find(word); };
    for (std::size_t i = 0; i < words.size();) {
        const std::string& word = words[i++];
        if (int index = ctrl ? type.findOption(word) : -1; index >= 0) {
            const Option& o = type.options()[std::size_t(index)];
            if (!may(Right::configure, o.spec.danger)) return;
            needChangeable(name, o, false);
            if (o.type == Type::flag && (i == words.size() || words[i].starts_with('-'))) continue;
            if (i == words.size()) failMissing(name, o);
            if (carriesRight(o.kindOf(words[i])) && !isOwners(rights)) return;
            o.parse(name, words[i++]);
            continue;
        }
        const Action* action = find(word);
        if (!action && rights == 0) return;
        if (!action) failUnknown(name, type, word, ctrl);
        if (!may(action->right, Danger::none)) return;
        i += takeArguments(name, *action, words, i, known).size();
        // The object may be locked.
        if (!may(action->right, action->danger) || (needsOperate(action->danger) && type.concurrency() == Concurrency::exclusive)) return;
        if (!action->kinds().empty() && !isOwners(rights)) return;
    }
}

// The words of a class are told to nobody who has no right at all to the object.
static void needSome(Service& s, const PrincipalPointer& author) {
    if (s.sorm().access.rights(author, s.name()) == 0) s.need(author, Right::inspect);
}

// Its right has been asked for. A lock keeps others from all that moves, too.
void Service::needArguments(const Action& action, Args args, const PrincipalPointer& author) {
    if (needsOperate(action.danger)) {
        need(author, Right::operate);
        if (guard() & kLockBits) checkLock();
    }
    auto& kinds = action.kinds();
    if (kinds.empty()) return;
    for (std::size_t k = 0; k < args.size(); ++k) needKind(author, kinds[std::min(k, kinds.size() - 1)], args[k]);
}

// The author of a splice could read a secret of that entry in an object of his own.
static void needToSet(Service& s, const Option& o, const Origin& origin) {
    s.need(origin.author, Right::configure);
    if (needsOperate(o.spec.danger)) s.need(origin.author, Right::operate);
    if (o.spec.secret)
        for (auto& entry : origin.via) s.sorm().access.need(origin.author, Right::configure, entry, s.name());
}

static std::vector<std::string> textsOf(const std::vector<DictionaryWord>& words) {
    std::vector<std::string> out;
    for (auto& w : words) out.push_back(w.text);
    return out;
}

// Apply words of CTRL, all or nothing. Options are parsed and checked first, then set together, then actions run. Each
// word is applied with the rights of its author: that of the recipe's entry, or of the request.
void Service::configure(const std::vector<DictionaryWord>& recipe, bool birth, Message* reply) {
    struct Step {
        const Action* action;
        Args args;
        const Origin* origin;
        Permit permit;
    };
    Applying a;
    std::vector<const Origin*> origins;     // of each
    std::vector<Step> steps;
    const std::vector<std::string> words = textsOf(recipe);
    auto known = [&](const std::string& word) { return class_->takes(Method::ctrl, word); };
    std::size_t i = 0;
    auto take = [&] {
        const std::string& word = words[i];
        const Origin* origin = &recipe[i++].origin;
        if (int index = class_->findOption(word); index >= 0) {
            const Option& o = class_->options()[index];
            needToSet(*this, o, *origin);
            needChangeable(name_, o, birth);
            const bool flag = o.type == Type::flag, given = i < words.size() && !(flag && words[i].starts_with('-'));
            if (!given && !flag) failMissing(name_, o);         // a flag alone is set
            if (given) needKind(origin->author, o.kindOf(words[i]), words[i]);
            a.values.push_back({index, o.parse(name_, given ? std::string_view(words[i++]) : "1"), origin->author});
            origins.push_back(origin);
            return;
        }
        const Action* action = CommonRequests::findAction(*class_, word);
        if (!action) needSome(*this, origin->author), failUnknown(name_, *class_, word, true);
        const Permit permit = need(origin->author, action->right);
        const Args args = takeArguments(name_, *action, words, i, known);
        i += args.size();
        if (action->name == CommonRequests::kIf) return a.conditions.push_back(conditionOf(args, origin->author));
        needArguments(*action, args, origin->author);
        steps.push_back({action, args, origin, permit});
    };
    while (i < words.size()) readAt(recipe[i].origin, take, [&, at = i] { return birth && isOfEntry(sorm_->dictionary(), name_, at); });

    needConditions(a);
    if (!a.values.empty()) {
        if (!birth && (guard() & kLockBits)) checkLock();
        Record& r = record();
        const std::string by = birth ? std::string() : CallContext::currentCallers();
        const std::string shown = birth ? std::string() : cutText(joinWords(sorm_->masked(words)));
        const std::int64_t now = wallNow();
        for (std::size_t i = 0; i < a.values.size(); ++i)
            a.sources.emplace_back(name_, sorm_->budget.ofCaller(origins[i]->author), Account::Use::values,
                                   Record::Source{birth ? Record::Source::Kind::recipe : Record::Source::Kind::ctrl,
                                                  birth ? *origins[i] : Origin{}, origins[i]->author, by, shown, now,
                                                  heapOf(a.values[i].value)});
        a.birth = birth;
        a.more = !steps.empty();
        apply(a);
        if (!birth) {
            r.keepUndo(std::move(a.before));
            settleFirst(a, reply, steps.empty());
        }
    }
    for (auto& step : steps) {
        if (step.action->whileTicking) a.between.reset();
        else if (realtimeOwner_ && !a.between) a.between.emplace(*this);
        Message none;
        Message& into = reply ? *reply : none;
        into.author = step.origin->author;
        step.action->run(*this, step.args, into, step.permit);
        // The last one may answer later; the others are waited for here.
        if (into.later && (!reply || &step != &steps.back())) [[unlikely]] awaitLater(into);
    }
}

// CTRL -if OPTION VALUE
Change::Setting Service::conditionOf(Args args, const PrincipalPointer& author) const {
    const int index = class_->findOption(args[0]);
    if (index < 0) failUnknown(name_, *class_, args[0], true);
    const Option& o = class_->options()[std::size_t(index)];
    if (o.spec.secret) fail(kUncertain, name_, o.name);
    return {index, o.parse(name_, args[1]), author};
}
void Service::needConditions(const Applying& a) const {
    for (auto& c : a.conditions) {
        const Option& o = class_->options()[std::size_t(c.option)];
        const Value is = o.value(*this, Permit::owner());
        if (is != c.value) fail(kChanged, name_, o.name, sorma::shown(toText(is)), sorma::shown(toText(c.value)));
    }
}

// Before the actions of the request; the last of all may answer later.
void Service::settleFirst(const Applying& a, Message* reply, bool last) {
    Message none;
    Message& into = reply ? *reply : none;
    settle(a.options, into);
    if (into.later && (!reply || !last)) awaitLater(into);
}

// All or nothing. Slow work comes first, while ticks go on. Then all is set between two of them.
void Service::apply(Applying& a) {
    Record& r = record();
    auto& options = a.options;
    std::vector<Reference> planted;         // so that setting a name only finds it
    RealtimeOwner* owner = RealtimeOwner::current() == realtimeOwner_ ? nullptr : realtimeOwner_;
    bool committed = false, told = false;
    try {
        for (auto& v : a.values) {
            const Option& o = class_->options()[v.option];
            if (std::find(options.begin(), options.end(), &o) == options.end()) options.push_back(&o);
            if (a.birth || o.type != Type::service) continue;
            planted.push_back(subService(*this, std::get<std::string>(v.value), v.author));
            if (owner && o.spec.part && planted.back()) owner->adopt(*planted.back());
        }
        if (!a.birth) a.commit = prepare(Change(*this, a.values));
        a.between.emplace(*this);
        needConditions(a);                  // others may have come while it was prepared
        const ThreadEffort effort = owner ? ThreadEffort::now() : ThreadEffort();
        for (std::size_t i = 0; i < a.values.size(); ++i) {
            auto& v = a.values[i];
            const Option& o = class_->options()[v.option];
            a.before.push_back({v.option, o.value(*this, Permit::owner()), std::move(r.sources[v.option])});
            readAt(a.sources[i]->origin, [&] { assign(o, v.value, v.author); });
            r.sources[v.option] = std::move(a.sources[i]);
        }
        if (a.birth) return;
        if (a.commit) a.commit(), committed = true;
        changed(options);
        told = true;
        if (sorm_) sorm_->tellDependents(*this);
        remember(options);
        if (guard() & kPartsBit) judgeParts();
        if (owner) {
            if (a.commit || !planted.empty()) owner->partsChanged();
            owner->checkBudget(*this, effort);
        }
    } catch (...) {
        for (auto u = a.before.rbegin(); u != a.before.rend(); ++u) {
            assign(class_->options()[u->option], u->value, u->source->author);
            r.sources[u->option] = std::move(u->source);
        }
        try {
            if (committed) a.commit();
            if (told) changed(options);
            if (told && sorm_) sorm_->tellDependents(*this);
        } catch (...) {                     // the values before were valid
        }
        if (owner) owner->partsChanged();
        throw;
    }
    if (!a.more) a.between.reset();
    if (sorm_ && sorm_->announces()) sorm_->announceChange(*this, options);
}

void Service::ctrl(Message& m) {
    std::vector<DictionaryWord> words;
    words.reserve(m.words.size());
    for (auto& w : m.words) words.push_back({w, {}}), words.back().origin.author = m.author;
    m.text.clear();
    configure(words, false, &m);
}

void Service::dbx(Message& m) {
    std::vector<std::string> words;
    words.swap(m.words);
    m.text.clear();
    struct Step {
        const Action* action;
        Args args;
        Permit permit;
    };
    std::vector<Step> steps;
    auto find = [&](std::string_view word) { return CommonRequests::findInspection(*class_, word); };
    for (std::size_t i = 0; i < words.size();) {
        const Action* action = find(words[i]);
        if (!action) needSome(*this, m.author), failUnknown(name_, *class_, words[i], false);
        Permit permit = need(m.author, action->right);
        Args args = takeArguments(name_, *action, words, i + 1, find);
        i += 1 + args.size();
        needArguments(*action, args, m.author);
        steps.push_back({action, args, permit});
    }
    for (auto& step : steps) {
        step.action->run(*this, step.args, m, step.permit);
        if (m.later && &step != &steps.back()) [[unlikely]] awaitLater(m);
    }
}

void Service::answerSelftest(Message& m) { addLine(m, selftest()); }


std::string Service::shown(const Option& o, const Permit& permit) const {
    std::string value = toText(o.value(*this, permit));
    return !o.spec.secret || value.empty() || permit.includes(Right::configure) ? value : std::string(kMask);
}

std::string Service::dump(const Permit& permit) const {
    std::string out;
    for (auto& o : class_->options()) {
        if (!out.empty()) out += '\n';
        out += o.name;
        appendWord(out, shown(o, permit));
    }
    std::string state;
    dumpState(state);
    if (!state.empty()) {
        if (state.back() == '\n') state.pop_back();
        out += (out.empty() ? "" : "\n") + state;
    }
    return out;
}

std::string Service::recipe(const Permit& permit) const {
    std::string out;
    for (std::size_t i = 0; i < class_->options().size(); ++i) {
        auto& o = class_->options()[i];
        Value now = o.value(*this, permit);
        if (isMeasured(o) || (i < class_->defaults().size() && now == class_->defaults()[i])) continue;
        appendWord(out, o.name);
        appendWord(out, toText(now));
    }
    return out;
}

Reference subService(Service& user, const std::string& name, const PrincipalPointer& author) {
    if (name.empty()) return {};
    // While a daemon serves a peer's request it does not wait for a third one: that one may be silent, or wait for this one.
    // A wrong name elsewhere is reported when it is used.
    Reference found = user.sorm().get(name, author, CallContext::currentClient() ? Probe::later : Probe::now);
    // The class uses it as the owner. So its author must have the right to that. Elsewhere that
    // daemon judges.
    if (!found->isElsewhere()) {
        found->need(author, Right::call);
        if (found->isDangerous()) found->need(author, Right::operate);
    }
    return found;
}
}  // namespace sorma
