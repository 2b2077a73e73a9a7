#include "bus/option.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "bus/amounts.h"
#include "bus/enumText.h"
#include "bus/listText.h"
#include "bus/measured.h"
#include "bus/name.h"
#include "bus/nearest.h"
#include "bus/requestText.h"
#include "bus/service.h"

namespace sorma {

namespace {

const Prototype kRange{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside {}"};
const Prototype kChoice{Severity::error, "OPTION VALUE", 2, "{0}: {1} \"{2}\"{4} is not one of {3}"};
const Prototype kValue{Severity::error, "OPTION VALUE", 2, "{}: {} expects {}, got \"{}\""};
const Prototype kLength{Severity::error, "OPTION VALUE", 2, "{}: {} expects {}, got {}"};

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

bool isOpen(const Limits& l) { return l.low == -kInfinity && l.high == kInfinity; }

bool parseFlag(std::string_view text, bool& out) {
    for (auto yes : {"1", "true", "yes", "on"})
        if (text == yes) return out = true, true;
    for (auto no : {"0", "false", "no", "off"})
        if (text == no) return out = false, true;
    return false;
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

bool fromText(std::string_view text, Type& out) { return findText(text, Type::flag, Type::service, out); }

const char* toText(Danger danger) {
    static constexpr const char* names[] = {"", "move", "power", "fire", "stop"};
    return names[static_cast<int>(danger)];
}

bool fromText(std::string_view text, Danger& out) { return findText(text, Danger::move, Danger::stop, out); }

Value Option::value(const Service& service, const Permit& permit) const {
    permit.check(Right::inspect, service.name());
    return get.read_(service);
}

void Action::run(Service& service, Args args, Message& reply, const Permit& permit) const {
    permit.check(right, service.name());
    body.run_(service, args, reply);
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
        out += amountText({spec.minLength, spec.maxLength}, "elements");
    }
    return out;
}

std::string Option::hints() const {
    std::string out;
    auto put = [&](std::string_view key, const std::string& value) {
        if (value.empty()) return;
        appendListElement(out, key);
        appendListElement(out, value);
    };
    auto limits = [](const Limits& l) {
        auto end = [](double x) { return std::isinf(x) ? std::string() : plainNumber(x); };
        return isOpen(l) ? std::string() : listOf({end(l.low), end(l.high)});
    };
    put("warn", limits(spec.warn));
    put("alarm", limits(spec.alarm));
    put("kind", toText(spec.kind));
    put("names", listOf(spec.names));
    put("group", spec.group);
    put("expert", spec.expert ? "1" : "");
    put("danger", toText(spec.danger));
    put("measured", isMeasured(*this) ? "1" : "");
    put("secret", spec.secret ? "1" : "");
    return out;
}

std::string Option::limitsText() const {
    std::string out;
    for (auto& [what, l] : {std::pair{"warning", spec.warn}, {"alarm", spec.alarm}}) {
        if (isOpen(l)) continue;
        if (!out.empty()) out += ", ";
        out += what;
        if (l.high == kInfinity) out += " below " + plainNumber(l.low);
        else if (l.low == -kInfinity) out += " above " + plainNumber(l.high);
        else out += " outside " + rangeText(l.low, l.high);
    }
    return out;
}

Kind Option::kindOf(std::string_view value) const {
    return std::find(spec.literals.begin(), spec.literals.end(), value) == spec.literals.end() ? spec.kind : Kind::plain;
}

std::string Option::misfit() const {
    std::string of = std::string("of type ") + toText(type);
    bool number = type == Type::integer || type == Type::real;
    if (spec.kind != Kind::plain && (spec.kind == Kind::time ? !number : type != Type::text)) return of + " cannot be a " + toText(spec.kind);
    if (!(isOpen(spec.warn) && isOpen(spec.alarm)) && !number && type != Type::vector) return of + " is no number that has limits";
    for (auto& [word, l] : {std::pair{"-range", Limits{spec.low, spec.high}}, {"-warn", spec.warn}, {"-alarm", spec.alarm}})
        if (l.low > l.high) return std::string("has its ") + word + " upside down: the low end is " + plainNumber(l.low) + ", the high end " + plainNumber(l.high);
    if (spec.danger == Danger::stop) return of + " cannot stop: declare an action";
    if (spec.secret && (type == Type::flag || type == Type::choice || type == Type::service)) return of + " cannot be secret";
    if (!spec.names.empty() && type != Type::vector) return of + " has no elements that have names";
    return {};
}

void Option::check(std::string_view object, const Value& value, std::string_view given) const {
    if (spec.secret) given = kMask;
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
                fail(kLength, object, name, amountText({spec.minLength, spec.maxLength}, "numbers"), v.size());
            for (double x : v)
                if (!inside(x)) outside();
            break;
        }
        case Type::choice:
            if (std::find(choices.begin(), choices.end(), std::get<std::string>(value)) == choices.end())
                fail(kChoice, object, name, given, joinChoices(choices), didYouMean(given, choices));
            break;
        default: break;
    }
}

Value Option::parse(std::string_view object, std::string_view text) const {
    Value value;
    bool good = true;
    if (spec.secret && text == kMask) fail(kValue, object, name, "the secret itself", std::string(kMask) + ", which stands for it");
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
    if (!good) fail(kValue, object, name, type == Type::text ? "UTF-8 text" : expectation(type), spec.secret ? kMask : text);
    check(object, value, text);
    return value;
}

}  // namespace sorma
