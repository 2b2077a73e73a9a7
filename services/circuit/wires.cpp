#include "wires.h"

#include <algorithm>
#include <span>

#include <sorma.h>

namespace circuit {

namespace {

using sorma::Prototype;
using sorma::Severity;
using Words = std::span<const std::string_view>;

const Prototype kArrow{Severity::error, "CIRCUIT SYNTAX", 1,
                       "{}: wire {} {}: must be \"source -> sink\", with white space around the arrow"};
const Prototype kEnd{Severity::error, "CIRCUIT SYNTAX", 1,
                     "{}: wire {} {}: {} is no pin: must be OBJECT.PIN, or a pin of the circuit's own, with [i] or [i:j] behind it "
                     "when it is a part"};
const Prototype kIndex{Severity::error, "CIRCUIT SYNTAX", 1,
                       "{}: wire {} {}: bad slice in {}: must be [i] or [i:j], i <= j, both below {}"};
const Prototype kOwnPin{Severity::error, "CIRCUIT SYNTAX", 1,
                        "{}: {} {}: must be \"name ?length? ?unit?\", length from 1 to {}"};
const Prototype kTwice{Severity::error, "CIRCUIT SYNTAX", 1, "{}: {}: pin {} is declared twice"};

bool isSpace(char c) { return c == ' ' || c == '\t' || c == '\r'; }
bool isLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool isDigit(char c) { return c >= '0' && c <= '9'; }

bool isPin(std::string_view text) {
    return !text.empty() && isLetter(text[0]) &&
           std::all_of(text.begin(), text.end(), [](char c) { return isLetter(c) || isDigit(c) || c == '-'; });
}

bool parseIndex(std::string_view text, std::size_t& out) {
    std::int64_t n = 0;
    if (text.empty() || !isDigit(text[0]) || !sorma::parseNumber(text, n) || n >= std::int64_t(kMaxElements)) return false;
    out = std::size_t(n);
    return true;
}

std::vector<std::string_view> wordsOf(std::string_view text) {
    std::vector<std::string_view> out;
    for (std::size_t i = 0; i < text.size();) {
        if (isSpace(text[i])) {
            ++i;
            continue;
        }
        std::size_t start = i;
        while (i < text.size() && !isSpace(text[i])) ++i;
        out.push_back(text.substr(start, i - start));
    }
    return out;
}

// Calls use(statement) for each that is not empty, without comments and white space around it.
template <class Use> void eachStatement(std::string_view text, Use use) {
    while (!text.empty()) {
        if (isSpace(text[0]) || text[0] == ';' || text[0] == '\n') {
            text.remove_prefix(1);
            continue;
        }
        if (text[0] == '#') {
            text.remove_prefix(std::min(text.find('\n'), text.size()));
            continue;
        }
        std::size_t end = 0;        // names may hold # too
        while (end < text.size() && text[end] != ';' && text[end] != '\n' && !(text[end] == '#' && isSpace(text[end - 1]))) ++end;
        auto statement = text.substr(0, end);
        text.remove_prefix(end);
        while (isSpace(statement.back())) statement.remove_suffix(1);
        use(statement);
    }
}

End parseEnd(std::string_view owner, const Wire& wire, std::string_view text) {
    End end;
    auto rest = text;
    if (rest.ends_with(']')) {
        auto open = rest.rfind('[');
        auto inner = open == rest.npos ? std::string_view() : rest.substr(open + 1, rest.size() - open - 2);
        auto colon = inner.find(':');
        if (!parseIndex(inner.substr(0, colon), end.first) ||
            !parseIndex(colon == inner.npos ? inner : inner.substr(colon + 1), end.last) || end.first > end.last)
            fail(kIndex, owner, wire.number, sorma::shown(wire.text), sorma::shown(text), kMaxElements);
        end.whole = false;
        rest = rest.substr(0, open);
    }
    auto dot = rest.rfind('.');
    end.pin = dot == rest.npos ? rest : rest.substr(dot + 1);
    if (dot != rest.npos) end.object = rest.substr(0, dot);
    if (!isPin(end.pin) || (dot != rest.npos && !sorma::Name::isName(end.object)))
        fail(kEnd, owner, wire.number, sorma::shown(wire.text), sorma::shown(text));
    return end;
}

End parseSource(std::string_view owner, const Wire& wire, Words words) {
    End numbers;
    for (auto word : words) {
        double value = 0;
        if (isLetter(word[0]) || !sorma::parseNumber(word, value)) {
            if (words.size() == 1) return parseEnd(owner, wire, word);
            fail(kEnd, owner, wire.number, sorma::shown(wire.text), sorma::shown(word));
        }
        numbers.constants.push_back(value);
    }
    return numbers;
}

}  // namespace

std::string sliceText(const std::string& pin, std::size_t first, std::size_t length) {
    std::string out = pin + "[" + std::to_string(first);
    if (length != 1) out += ":" + std::to_string(first + length - 1);
    return out + "]";
}

std::string End::toText() const {
    if (!constant()) return whole ? pinText() : sliceText(pinText(), first, last - first + 1);
    std::string out;
    for (double x : constants) {
        if (!out.empty()) out += ' ';
        sorma::appendNumber(out, x);
    }
    return out;
}

std::vector<Wire> parseWires(std::string_view owner, std::string_view text) {
    std::vector<Wire> wires;
    eachStatement(text, [&](std::string_view statement) {
        Wire wire;
        wire.number = wires.size() + 1;
        wire.text = statement;
        auto words = wordsOf(statement);
        auto arrow = std::find(words.begin(), words.end(), "->");
        if (arrow == words.begin() || words.end() - arrow != 2) fail(kArrow, owner, wire.number, sorma::shown(statement));
        wire.source = parseSource(owner, wire, Words(words.begin(), arrow));
        wire.sink = parseEnd(owner, wire, words.back());
        wires.push_back(std::move(wire));
    });
    return wires;
}

std::vector<OwnPin> parsePins(std::string_view owner, std::string_view option, std::string_view text) {
    std::vector<OwnPin> pins;
    eachStatement(text, [&](std::string_view statement) {
        auto words = wordsOf(statement);
        OwnPin pin;
        std::int64_t length = 0;
        std::size_t next = 1;
        bool good = isPin(words[0]);
        pin.name = words[0];
        if (next < words.size() && sorma::parseNumber(words[next], length)) {
            good = good && length >= 1 && length <= std::int64_t(kMaxElements);
            pin.length = std::size_t(length);
            ++next;
        }
        if (next < words.size()) pin.unit = words[next++];
        if (!good || next < words.size()) fail(kOwnPin, owner, option, sorma::shown(statement), kMaxElements);
        for (auto& other : pins)
            if (other.name == pin.name) fail(kTwice, owner, option, pin.name);
        pins.push_back(std::move(pin));
    });
    return pins;
}

}  // namespace circuit
