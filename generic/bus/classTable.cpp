// classTable.cpp -- the table of a class: its declarations, the checks of EXEC and its reply, and help.
#include <algorithm>
#include <utility>

#include "bus/amounts.h"
#include "bus/measured.h"
#include "bus/nearest.h"
#include "bus/option.h"
#include "bus/requestText.h"
#include "bus/service.h"

namespace sorma {

namespace {

const Prototype kSignature{Severity::error, "REQUEST SIGNATURE", 2, "{}: EXEC expects {} {}{}, got {}"};
const Prototype kUndeclared{Severity::error, "REQUEST SIGNATURE", 2, "{}: EXEC takes no {}, got {}; it takes {}"};
const Prototype kNoWords{Severity::error, "REQUEST SIGNATURE", 2, "{}: EXEC takes no words, got \"{}\"{}"};
const Prototype kBreach{Severity::error, "SERVICE FAILED", 1,
    "{}: EXEC was done, but returned {} {} where its class declares {}{}; correct the class"};
const Prototype kSignatureRange{Severity::error, "REQUEST RANGE", 2, "{}: element {} of {} is {}, outside {} .. {} {}"};
const Prototype kTable{Severity::error, "CLASS TABLE", 1, "class {}: {} \"{}\" {}"};

std::size_t size(const Message& m, Field field) {
    switch (field) {
        case Field::text: return m.text.size();
        case Field::floats: return m.floats.size();
        case Field::ints: return m.ints.size();
        case Field::any: return m.any.size();
    }
    return 0;
}

// Parts of one field follow one another: "floats 2 W" and "floats 1.. V" are at least 3 floats.
Count together(const std::vector<Part>& parts, Field field) {
    Count sum{0, 0};
    for (auto& p : parts) {
        if (p.field != field) continue;
        sum.low += p.count.low;
        sum.high = p.count.high > SIZE_MAX - sum.high ? SIZE_MAX : sum.high + p.count.high;
    }
    return sum;
}

// For people: what a dangerous word does.
const char* dangerText(Danger danger) {
    switch (danger) {
        case Danger::move: return "moves something: needs the right operate";
        case Danger::power: return "switches power: needs the right operate";
        case Danger::fire: return "fires something: needs the right operate";
        case Danger::stop: return "stops: whoever may call may do it";
        case Danger::none: break;
    }
    return "";
}

std::string withDanger(const std::string& help, Danger danger) {
    if (danger == Danger::none) return help;
    return help + (help.empty() ? "" : "; ") + dangerText(danger);
}

// The meaning of the parts, for messages: " (from (3), to (3))".
std::string meaning(const std::vector<Part>& parts, Field field) {
    std::string out;
    for (auto& p : parts)
        if (p.field == field && !p.help.empty()) out += (out.empty() ? "" : "; ") + p.help;
    return out.empty() ? out : " (" + out + ")";
}

// "  left          right" with the right side starting at a fixed column.
void appendRow(std::string& out, std::string_view left, std::string_view right) {
    constexpr std::size_t kColumn = 34;
    out += "\n  ";
    out += left;
    if (left.size() + 4 > kColumn) out += "\n" + std::string(kColumn, ' ');
    else out.append(kColumn - 2 - left.size(), ' ');
    out += right;
}

}  // namespace

Class::Class(std::string name, std::string purpose, std::function<std::unique_ptr<Service>()> make,
             Where where)
    : name_(std::move(name)), purpose_(std::move(purpose)), file_(where.file), line_(int(where.line)),
      make_(std::move(make)) {
    if (auto slash = file_.rfind('/'); slash != std::string::npos) file_.erase(0, slash + 1);
}

Class& Class::option(Option o) {
    if (o.name.size() < 2 || o.name[0] != '-') fail(kTable, name_, "option", o.name, "does not begin with a dash");
    if (findOption(o.name) >= 0) fail(kTable, name_, "option", o.name, "is declared twice");
    if (auto m = o.misfit(); !m.empty()) fail(kTable, name_, "option", o.name, m);
    options_.push_back(std::move(o));
    return *this;
}

void Class::refuseKind(const std::string& option) const {
    fail(kTable, name_, "option", option, "names a file or a program: declare it with named()");
}

Class& Class::action(Action a) {
    if (findAction(a.name)) fail(kTable, name_, "action", a.name, "is declared twice");
    actions_.push_back(std::move(a));
    lastIsInspection_ = false;
    return actions_.back().danger == Danger::none ? *this : danger(actions_.back().danger);
}

// The body of a word asks for the rights of its author, so exec gets him.
Class& Class::word(Word word) {
    actsOnWords_ = actsOnWords_ || word.body;
    wordKinds_.push_back(std::move(word));
    return *this;
}

Class& Class::inspection(Action a, Right right) {
    if (findInspection(a.name)) fail(kTable, name_, "inspection", a.name, "is declared twice");
    a.right = right;
    a.repeatable = right == Right::inspect;
    inspections_.push_back(std::move(a));
    lastIsInspection_ = true;
    return *this;
}

Class& Class::danger(Danger danger) {
    auto& last = (lastIsInspection_ ? inspections_ : actions_).back();
    last.danger = danger;
    if (danger == Danger::stop) last.right = Right::call;
    return *this;
}

Class& Class::execDanger(Danger danger, std::vector<std::string> words) {
    if (words.empty()) words.emplace_back();
    for (auto& word : words) execDangers_.emplace_back(std::move(word), danger);
    return *this;
}

// A word's own declaration comes before that of every EXEC.
bool Class::isDangerous(const Message& m) const {
    if (execDangers_.empty()) return false;
    auto begins = [&](std::string_view words) {
        for (auto& given : m.words) {
            std::string_view word = words.substr(0, words.find(' '));
            if (given != word) return false;
            if (word.size() == words.size()) return true;
            words.remove_prefix(word.size() + 1);
        }
        return false;
    };
    bool all = false;
    for (auto& [words, danger] : execDangers_) {
        if (words.empty()) all = needsOperate(danger);
        else if (begins(words)) return needsOperate(danger);
    }
    return all;
}

bool Class::isDangerous() const {
    return std::any_of(execDangers_.begin(), execDangers_.end(), [](auto& d) { return needsOperate(d.second); });
}

std::vector<std::string> Class::dangers() const {
    std::vector<std::string> out;
    auto add = [&](const std::string& word, Danger danger) {
        if (danger != Danger::none) out.insert(out.end(), {word, toText(danger)});
    };
    for (auto& [word, danger] : execDangers_) add(word, danger);
    for (auto& o : options_) add(o.name, o.spec.danger);
    for (auto* list : {&actions_, &inspections_})
        for (auto& a : *list) add(a.name, a.danger);
    return out;
}

Class& Class::flavors(Flavors flavors) {
    flavors_ = flavors;
    return *this;
}

Class& Class::execRight(Right right) {
    execRight_ = right;
    return *this;
}

Class& Class::actsOnWords() {
    actsOnWords_ = true;
    return *this;
}

Class& Class::reads(Field field, Count count, std::string unit, std::string help, double low, double high) {
    reads_.push_back({field, count, std::move(unit), std::move(help), low, high});
    ranged_ = ranged_ || low != -kInfinity || high != kInfinity;
    if (count.low > 0 || count.high != SIZE_MAX || ranged_) checks_ |= lengths;
    declared();
    return *this;
}

Class& Class::writes(Field field, Count count, std::string unit, std::string help) {
    writes_.push_back({field, count, std::move(unit), std::move(help)});
    if (count.low > 0 || count.high != SIZE_MAX) checks_ |= replies;
    declared();
    return *this;
}

Class& Class::words(std::string usage) {
    words_ = std::move(usage);
    declared();
    return *this;
}

void Class::declared() {
    checks_ |= undeclared;
    takesWords_ = !words_.empty();
    for (int f = 0; f < 4; ++f) takes_[std::size_t(f)] = together(reads_, Field(f));
}

Class& Class::realtime() { return realtime_ = true, *this; }
Class& Class::testedAtBirth(double seconds) { return testedAtBirth_ = seconds, *this; }
Class& Class::withoutFeedthrough() { return feedthrough_ = false, *this; }
Class& Class::example(std::string request) { return example_ = std::move(request), *this; }
Class& Class::version(std::string version) { return version_ = std::move(version), *this; }
Class& Class::declaredAt(std::string file, int line) { return file_ = std::move(file), line_ = line, *this; }

int Class::findOption(std::string_view name) const {
    for (std::size_t i = 0; i < options_.size(); ++i)
        if (options_[i].name == name) return int(i);
    return -1;
}

static const Action* findIn(const std::vector<Action>& actions, std::string_view name) {
    for (auto& a : actions)
        if (a.name == name) return &a;
    return nullptr;
}

const Action* Class::findAction(std::string_view name) const { return findIn(actions_, name); }
const Action* Class::findInspection(std::string_view name) const { return findIn(inspections_, name); }

void Class::learnDefaults(const Service& fresh) const {
    if (defaults_.size() == options_.size()) return;
    defaults_.clear();
    for (auto& o : options_) defaults_.push_back(o.value(fresh, Permit::owner()));
}

void Class::checkRequest(std::string_view object, const Message& m) const {
    std::array<std::size_t, 4> from{};          // of each field: where the next part begins
    for (auto& part : reads_) {
        std::size_t n = size(m, part.field), f = std::size_t(part.field);
        if (n < takes_[f].low || n > takes_[f].high)
            fail(kSignature, object, countText(takes_[f]), wordsFor(takes_[f], toText(part.field)), meaning(reads_, part.field), n);
        std::size_t begin = std::exchange(from[f], part.count.low == part.count.high ? from[f] + part.count.low : n);
        if (part.field != Field::floats || (part.low == -kInfinity && part.high == kInfinity)) continue;
        for (std::size_t i = begin; i < from[f]; ++i) {
            double x = m.floats[i];
            if (!(x >= part.low && x <= part.high))
                fail(kSignatureRange, object, i + 1, "floats", x, part.low, part.high, part.unit);
        }
    }
}

namespace {
bool looksLikeNumber(std::string_view word) { return word.find_first_not_of("0123456789.+-eE") == word.npos; }
}  // namespace

void Class::refuse(std::string_view object, const Message& m) const {
    if (!takesWords_ && !m.words.empty()) {
        const std::string& word = m.words[0];
        std::string hint;
        if (findOption(word) >= 0) hint = "; it is an option: CTRL " + word;
        else if (findAction(word)) hint = "; it is a word of CTRL";
        else if (auto part = didYouMean(word, {"TMSG", "FMSG", "IMSG", "AMSG", "-text", "-floats", "-ints", "-any"}); !part.empty()) hint = part;
        else if (word == "-timeout") hint = "; a time limit stands before the name: sorma::async -timeout MS NAME EXEC";
        else if (word.starts_with('-')) hint = "; options are set with CTRL";
        else if (looksLikeNumber(word) && m.floats.size() + m.ints.size() > 0)
            hint = "; more numbers follow than the " + std::to_string(m.ints.empty() ? m.floats.size() : m.ints.size()) + " that " +
                   (m.ints.empty() ? "FMSG" : "IMSG") + " announces";
        fail(kNoWords, object, word, hint);
    }
    checkRequest(object, m);
    for (auto field : {Field::text, Field::floats, Field::ints, Field::any}) {
        bool declared = std::any_of(reads_.begin(), reads_.end(), [field](auto& p) { return p.field == field; });
        if (declared || size(m, field) == 0) continue;
        std::vector<std::string> known;
        for (auto& p : reads_) known.push_back(toText(p.field));
        if (takesWords_) known.push_back("words: " + words_);
        std::string what = known.empty() ? "nothing" : joinChoices(known);
        fail(kUndeclared, object, toText(field), field == Field::text ? shown(m.text) : std::to_string(size(m, field)), what);
    }
    fail(kUndeclared, object, "such request", "one", signatureText());     // not reached: one of the above is wrong
}

void Class::dropUndeclared(Message& m) const {
    if (!(checks_ & undeclared)) return;
    auto none = [this](Field f) { return takes_[std::size_t(f)].high == 0; };
    if (none(Field::text)) m.text.clear();
    if (none(Field::floats)) m.floats.clear();
    if (none(Field::ints)) m.ints.clear();
    if (none(Field::any)) m.any.clear();
    if (!takesWords_) m.words.clear();
}

void Class::checkReply(std::string_view object, const Message& m) const {
    for (auto& part : writes_) {
        std::size_t n = size(m, part.field);
        Count whole = together(writes_, part.field);
        if (n == 0 || (n >= whole.low && n <= whole.high)) continue;
        fail(kBreach, object, n, toText(part.field), countText(whole), meaning(writes_, part.field));
    }
}

std::string Class::signatureText() const {
    std::string out;
    auto describe = [&](const char* verb, const std::vector<Part>& parts) {
        for (auto& p : parts) {
            if (!out.empty()) out += '\n';
            out += verb;
            out += ' ';
            out += toText(p.field);
            out += ": " + countText(p.count);
            if (!p.unit.empty()) out += " [" + p.unit + "]";
            if (auto r = rangeText(p.low, p.high); !r.empty()) out += " " + r;
            if (!p.help.empty()) out += ", " + p.help;
        }
    };
    describe("reads", reads_);
    if (!words_.empty()) out += std::string(out.empty() ? "" : "\n") + "reads words: " + words_;
    describe("writes", writes_);
    for (auto& [word, danger] : execDangers_) {
        if (!out.empty()) out += '\n';
        out += (word.empty() ? std::string("EXEC") : "EXEC " + word) + " " + dangerText(danger);
    }
    return out;
}

std::string Class::helpText(std::string_view object, bool expert) const {
    std::string out(object);
    out += " -- " + purpose_;
    if (!options_.empty()) {
        out += "\noptions";
        std::size_t hidden = 0;
        for (std::size_t i = 0; i < options_.size(); ++i) {
            auto& o = options_[i];
            if (o.spec.expert && !expert) {
                ++hidden;
                continue;
            }
            std::string left = o.name, right = withDanger(o.spec.help, o.spec.danger);
            if (o.type == Type::flag) left += " ?boolean?";
            else left += std::string(" ") + toText(o.type);
            if (!o.spec.unit.empty()) left += " [" + o.spec.unit + "]";
            std::string facts;
            if (auto r = o.range(); !r.empty()) facts = r;
            if (i < defaults_.size()) {
                if (auto d = toText(defaults_[i]); !d.empty()) facts += (facts.empty() ? "default " : ", default ") + d;
            }
            if (auto l = o.limitsText(); !l.empty()) facts += (facts.empty() ? "" : ", ") + l;
            if (isMeasured(o) || o.spec.fixed)
                facts += std::string(facts.empty() ? "" : ", ") + (isMeasured(o) ? "measured" : "recipe only");
            if (!facts.empty()) right += " (" + facts + ")";
            appendRow(out, left, right);
        }
        if (hidden > 0) appendRow(out, "and " + std::to_string(hidden) + " for experts", "CTRL -help expert shows them");
    }
    if (!actions_.empty()) {
        out += "\nactions";
        for (auto& a : actions_) appendRow(out, a.usage.empty() ? a.name : a.name + " " + a.usage, withDanger(a.help, a.danger));
    }
    out += "\nin every class";
    appendRow(out, "CTRL", "-help -dump -save -selftest -undo");
    appendRow(out, "DBX", "-audit -class -diff -stats -trail -verbosity -version -why");
    if (!inspections_.empty()) {
        out += "\ninspections (DBX)";
        for (auto& a : inspections_) appendRow(out, a.usage.empty() ? a.name : a.name + " " + a.usage, withDanger(a.help, a.danger));
    }
    if (auto s = signatureText(); !s.empty()) {
        out += "\nEXEC\n  ";
        for (char c : s) {
            out += c;
            if (c == '\n') out += "  ";
        }
    }
    if (flavors_ == Flavors::dictionary) out += "\nflavors\n  only those that have an entry in the dictionary";
    if (testedAtBirth_ > 0) out += "\nself-test\n  when an object is made: one that does not pass is not made";
    if (auto words = repeatableText(); !words.empty()) out += "\nmay be repeated (sorma::retry)\n  " + words;
    if (!example_.empty()) out += "\nexample\n  " + example_;
    return out;
}

}  // namespace sorma
