#include "bus/ahead.h"

#include "bus/fnv.h"
#include "bus/measured.h"
#include "bus/serviceParts.h"

namespace sorma {

namespace {

// Texts with their lengths, and numbers as the shortest text that reads back the same.
class Print {
public:
    template <class... Items> void add(const Items&... items) { (put(items), ...); }
    template <class Item> void all(const std::vector<Item>& items) {
        add(items.size());
        for (auto& item : items) put(item);
    }
    std::uint64_t value() const { return hash_.value(); }

private:
    void put(std::string_view text) {
        hash_.add(text.size());
        hash_.add(text.data(), text.size());
    }
    void put(double number) { put(plainNumber(number)); }
    template <class Number>
        requires std::is_integral_v<Number> || std::is_enum_v<Number>
    void put(Number number) { hash_.add(std::uint64_t(number)); }
    void put(const Count& c) { add(c.low, c.high); }
    void put(const Part& p) { add(p.field, p.count, p.unit, p.help, p.low, p.high); }
    void put(const Option& o) {
        auto& s = o.spec;
        add(o.name, o.type, s.unit, s.low, s.high, s.fixed, isMeasured(o), s.minLength, s.maxLength, s.danger, s.kind, s.secret);
        all(o.choices);
        all(s.literals);
    }
    void put(const Action& a) {
        add(a.name, a.usage, a.minArgs, a.maxArgs, a.right, a.danger);
        all(a.kinds());
    }

    Fnv<> hash_;
};

std::uint64_t hashOf(std::string_view text) {
    Print print;
    print.add(text);
    return print.value();
}

}  // namespace

std::uint64_t Class::fingerprint() const {
    if (fingerprint_ != 0) return fingerprint_;
    Print print;
    print.add(std::string_view(SORMA_VERSION), name_, words_, takesWords_, checks_, execRight_, concurrency_, wordKinds_.size());
    print.all(options_);
    for (auto* list : {&actions_, &inspections_, &CommonRequests::actions(), &CommonRequests::inspections()}) print.all(*list);
    print.all(reads_);
    for (auto& [word, danger] : execDangers_) print.add(word, danger);
    return fingerprint_ = print.value();
}

namespace ahead {

std::vector<std::int64_t> facts(const Class& type, std::string_view name, Rights rights) {
    return {std::int64_t(type.fingerprint()), std::int64_t(rights), std::int64_t(hashOf(name))};
}

bool fit(const std::vector<std::int64_t>& facts, const Class& type, std::string_view name) {
    return facts.size() == 3 && facts[0] == std::int64_t(type.fingerprint()) && facts[2] == std::int64_t(hashOf(name));
}

Rights rightsIn(const std::vector<std::int64_t>& facts) { return Rights(facts[1]); }

// An EXEC may need the right operate because of a part of the object, and its words may name files. A caller without these rights has to ask.
void check(const Class& type, std::string_view object, Method method, const Message& m, Rights rights) {
    if (method != Method::exec) return checkWords(type, std::string(object), m.words, method == Method::ctrl, rights);
    const Rights needed = type.execRight() | Right::operate;
    if ((rights & needed) != needed || (!type.wordKinds().empty() && !isOwners(rights))) return;
    if (type.checks() & Class::undeclared) type.checkNamed(object, m);
}

}  // namespace ahead

}  // namespace sorma
