#include "bus/option.h"

#include <algorithm>
#include <cmath>

#include "bus/listText.h"
#include "bus/name.h"
#include "bus/requestText.h"
#include "bus/service.h"

namespace sorma {

namespace {

const Prototype kRange{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside {}"};
const Prototype kChoice{Severity::error, "OPTION VALUE", 2, "{}: {} \"{}\" is not one of {}"};
const Prototype kValue{Severity::error, "OPTION VALUE", 2, "{}: {} expects {}, got \"{}\""};
const Prototype kLength{Severity::error, "OPTION VALUE", 2, "{}: {} expects {} numbers, got {}"};
const Prototype kSignature{Severity::error, "REQUEST SIGNATURE", 2, "{}: EXEC expects {} {}, got {}{}"};
const Prototype kSignatureRange{Severity::error, "REQUEST RANGE", 2, "{}: element {} of {} is {}, outside {} .. {} {}"};
const Prototype kTable{Severity::error, "CLASS TABLE", 1, "class {}: {} \"{}\" {}"};

const char* expectation(Type type) {
    switch (type) {
        case Type::flag: return "a boolean";
        case Type::integer: return "an integer";
        case Type::real: return "a number";
        case Type::vector: return "numbers separated by spaces";
        case Type::service: return "the name of a service object";
        default: return "a text";
    }
}

std::string rangeText(double low, double high) {
    if (low == -kInfinity && high == kInfinity) return {};
    std::string out;
    if (low == -kInfinity) {
        out = "<= ";
        appendNumber(out, high);
    } else if (high == kInfinity) {
        out = ">= ";
        appendNumber(out, low);
    } else {
        appendNumber(out, low);
        out += " .. ";
        appendNumber(out, high);
    }
    return out;
}

std::string countText(Count count) {
    if (count.low == count.high) return std::to_string(count.low);
    if (count.high == SIZE_MAX) return count.low == 0 ? "any number of" : "at least " + std::to_string(count.low);
    return std::to_string(count.low) + " to " + std::to_string(count.high);
}

bool parseFlag(std::string_view text, bool& out) {
    for (auto yes : {"1", "true", "yes", "on"})
        if (text == yes) return out = true, true;
    for (auto no : {"0", "false", "no", "off"})
        if (text == no) return out = false, true;
    return false;
}

std::size_t size(const Message& m, Field field) {
    switch (field) {
        case Field::text: return m.text.size();
        case Field::floats: return m.floats.size();
        case Field::ints: return m.ints.size();
        case Field::any: return m.any.size();
    }
    return 0;
}

std::string joinChoices(const std::vector<std::string>& choices) {
    std::string out;
    for (std::size_t i = 0; i < choices.size(); ++i) {
        if (i > 0) out += i + 1 < choices.size() ? ", " : choices.size() > 2 ? ", or " : " or ";
        out += choices[i];
    }
    return out;
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

std::string toText(const Value& value) {
    return std::visit([](const auto& v) {
        using T = std::decay_t<decltype(v)>;
        std::string out;
        if constexpr (std::is_same_v<T, bool>) out = v ? "1" : "0";
        else if constexpr (std::is_same_v<T, std::string>) out = v;
        else if constexpr (std::is_same_v<T, std::vector<double>>) {
            for (double x : v) {
                if (!out.empty()) out += ' ';
                appendNumber(out, x);
            }
        } else appendNumber(out, v);
        return out;
    }, value);
}

const char* toText(Type type) {
    static constexpr const char* names[] = {"flag", "int", "double", "string", "enum", "vector", "service"};
    return names[static_cast<int>(type)];
}

bool fromText(std::string_view text, Type& out) {
    for (int i = 0; i <= static_cast<int>(Type::service); ++i)
        if (text == toText(static_cast<Type>(i))) return out = static_cast<Type>(i), true;
    return false;
}

const char* toText(Field field) {
    static constexpr const char* names[] = {"text", "floats", "ints", "any"};
    return names[static_cast<int>(field)];
}

std::string Option::range() const {
    if (type == Type::choice) {
        std::string out;
        for (auto& c : choices) appendListElement(out, c);
        return out;
    }
    std::string out = rangeText(spec.low, spec.high);
    if (type == Type::vector && (spec.minLength > 0 || spec.maxLength != SIZE_MAX)) {
        if (!out.empty()) out += ", ";
        out += countText({spec.minLength, spec.maxLength}) + " elements";
    }
    return out;
}

void Option::check(std::string_view object, const Value& value, std::string_view given) const {
    bool ranged = spec.low != -kInfinity || spec.high != kInfinity;
    auto inside = [&](double x) { return !ranged || (x >= spec.low && x <= spec.high); };     // NaN is not inside
    auto outside = [&] {
        std::string rule = rangeText(spec.low, spec.high);
        if (!spec.unit.empty()) rule += " " + spec.unit;
        fail(kRange, object, name, given, rule);
    };
    switch (type) {
        case Type::integer: if (!inside(double(std::get<std::int64_t>(value)))) outside(); break;
        case Type::real: if (!inside(std::get<double>(value))) outside(); break;
        case Type::vector: {
            auto& v = std::get<std::vector<double>>(value);
            if (v.size() < spec.minLength || v.size() > spec.maxLength)
                fail(kLength, object, name, countText({spec.minLength, spec.maxLength}), v.size());
            for (double x : v)
                if (!inside(x)) outside();
            break;
        }
        case Type::choice:
            if (std::find(choices.begin(), choices.end(), std::get<std::string>(value)) == choices.end())
                fail(kChoice, object, name, given, joinChoices(choices));
            break;
        default: break;
    }
}

Value Option::parse(std::string_view object, std::string_view text) const {
    Value value;
    bool good = true;
    switch (type) {
        case Type::flag: {
            bool v = false;
            good = parseFlag(text, v);
            value = v;
            break;
        }
        case Type::integer: {
            std::int64_t v = 0;
            good = parseNumber(text, v);
            value = v;
            break;
        }
        case Type::real: {
            double v = 0;
            good = parseNumber(text, v);
            value = v;
            break;
        }
        case Type::vector: {
            std::vector<double> v;
            for (auto& word : splitWords(text)) {
                double x = 0;
                good = good && parseNumber(word, x);
                v.push_back(x);
            }
            value = std::move(v);
            break;
        }
        case Type::service:
            good = text.empty() || Name::isName(text);
            value = std::string(text);
            break;
        default:
            good = isUtf8(text);
            value = std::string(text);
    }
    if (!good) fail(kValue, object, name, type == Type::text ? "UTF-8 text" : expectation(type), text);
    check(object, value, text);
    return value;
}

Class::Class(std::string name, std::string purpose, std::function<std::unique_ptr<Service>()> make,
             Where where)
    : name_(std::move(name)), purpose_(std::move(purpose)), file_(where.file), line_(int(where.line)),
      make_(std::move(make)) {
    if (auto slash = file_.rfind('/'); slash != std::string::npos) file_.erase(0, slash + 1);
}

Class& Class::option(Option o) {
    if (o.name.size() < 2 || o.name[0] != '-') fail(kTable, name_, "option", o.name, "does not begin with a dash");
    if (findOption(o.name) >= 0) fail(kTable, name_, "option", o.name, "is declared twice");
    options_.push_back(std::move(o));
    return *this;
}

Class& Class::action(Action a) {
    if (findAction(a.name)) fail(kTable, name_, "action", a.name, "is declared twice");
    actions_.push_back(std::move(a));
    return *this;
}

Class& Class::inspection(Action a) {
    if (findInspection(a.name)) fail(kTable, name_, "inspection", a.name, "is declared twice");
    inspections_.push_back(std::move(a));
    return *this;
}

Class& Class::reads(Field field, Count count, std::string unit, std::string help, double low, double high) {
    reads_.push_back({field, count, std::move(unit), std::move(help), low, high});
    checks_ = checks_ || count.low > 0 || count.high != SIZE_MAX || low != -kInfinity || high != kInfinity;
    return *this;
}

Class& Class::writes(Field field, Count count, std::string unit, std::string help) {
    writes_.push_back({field, count, std::move(unit), std::move(help)});
    return *this;
}

Class& Class::realtime() { return realtime_ = true, *this; }
Class& Class::withoutFeedthrough() { return feedthrough_ = false, *this; }
Class& Class::words(std::string usage) { return words_ = std::move(usage), *this; }
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
    for (auto& o : options_) defaults_.push_back(o.get(fresh));
}

void Class::checkRequest(std::string_view object, const Message& m) const {
    for (auto& part : reads_) {
        std::size_t n = size(m, part.field);
        if (n < part.count.low || n > part.count.high) {
            std::string why = part.help.empty() ? std::string() : " (" + part.help + ")";
            fail(kSignature, object, countText(part.count), toText(part.field), n, why);
        }
        if (part.field != Field::floats || (part.low == -kInfinity && part.high == kInfinity)) continue;
        for (std::size_t i = 0; i < n; ++i) {
            double x = m.floats[i];
            if (!(x >= part.low && x <= part.high))
                fail(kSignatureRange, object, i + 1, "floats", x, part.low, part.high, part.unit);
        }
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
    return out;
}

std::string Class::helpText(std::string_view object) const {
    std::string out(object);
    out += " -- " + purpose_;
    if (!options_.empty()) {
        out += "\noptions";
        for (std::size_t i = 0; i < options_.size(); ++i) {
            auto& o = options_[i];
            std::string left = o.name, right = o.spec.help;
            if (o.type == Type::flag) left += " ?boolean?";
            else left += std::string(" ") + toText(o.type);
            if (!o.spec.unit.empty()) left += " [" + o.spec.unit + "]";
            std::string facts;
            if (auto r = o.range(); !r.empty()) facts = r;
            if (i < defaults_.size()) {
                if (auto d = toText(defaults_[i]); !d.empty()) facts += (facts.empty() ? "default " : ", default ") + d;
            }
            if (o.spec.fixed) facts += facts.empty() ? "recipe only" : ", recipe only";
            if (!facts.empty()) right += " (" + facts + ")";
            appendRow(out, left, right);
        }
    }
    if (!actions_.empty()) {
        out += "\nactions";
        for (auto& a : actions_) appendRow(out, a.usage.empty() ? a.name : a.name + " " + a.usage, a.help);
    }
    out += "\nin every class";
    appendRow(out, "CTRL", "-help -dump -save -selftest -undo");
    appendRow(out, "DBX", "-audit -class -diff -stats -trail -verbosity -version -why");
    if (!inspections_.empty()) {
        out += "\ninspections (DBX)";
        for (auto& a : inspections_) appendRow(out, a.usage.empty() ? a.name : a.name + " " + a.usage, a.help);
    }
    if (auto s = signatureText(); !s.empty()) {
        out += "\nEXEC\n  ";
        for (char c : s) {
            out += c;
            if (c == '\n') out += "  ";
        }
    }
    if (!example_.empty()) out += "\nexample\n  " + example_;
    return out;
}

}  // namespace sorma
