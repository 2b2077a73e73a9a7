#include "bus/name.h"

#include <algorithm>
#include <charconv>
#include <vector>

#include "bus/catalogue.h"
#include "bus/dictionary.h"
#include "bus/requestText.h"

namespace sorma {

namespace {

const Prototype kName{Severity::error, "NAME SYNTAX", 1, "bad name {1}: {2}"};
const Prototype kAddress{Severity::error, "NAME SYNTAX", 1, "bad address {1}: {2}"};
const Prototype kNoDefault{Severity::error, "ADDRESS UNRESOLVED", 1,
                           "{0}: class {1} has no default location; give it one: dict CTRL -add {1} @DAEMON"};
const Prototype kNoAddress{Severity::error, "ADDRESS UNRESOLVED", 1,
                           "{0}: the dictionary's entry {1} holds no address; give it one: dict CTRL -add {1} HOST:PORT"};
const Prototype kBadEntry{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: the dictionary's entry {}: {}"};
const Prototype kCircle{Severity::error, "DICT LOOP", 1, "{}: addresses in the dictionary lead in a circle: {}"};

constexpr std::uint32_t kPrograms = 0x20000000;

bool isLower(char c) { return c >= 'a' && c <= 'z'; }
bool isUpper(char c) { return c >= 'A' && c <= 'Z'; }
bool isDigit(char c) { return c >= '0' && c <= '9'; }
bool isHex(char c) { return isDigit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }
bool isWordCharacter(char c) { return isLower(c) || isUpper(c) || isDigit(c) || c == '_' || c == '-' || c == '.'; }
bool isSeparator(char c) { return static_cast<unsigned char>(c) <= ' ' || c == 0x7f; }  // white space and control
char lower(char c) { return isUpper(c) ? static_cast<char>(c - 'A' + 'a') : c; }
char upper(char c) { return isLower(c) ? static_cast<char>(c - 'a' + 'A') : c; }

template <class F> std::string mapped(std::string_view text, F f) {
    std::string out(text);
    std::transform(out.begin(), out.end(), out.begin(), f);
    return out;
}

// The first wrong character of a text, and why it is wrong. why null: the text is right.
struct Problem {
    std::size_t at = 0;             // byte
    const char* why = nullptr;
    bool character = true;          // it is the character at that place which is wrong
    explicit operator bool() const { return why; }
};
Problem here(std::size_t at, const char* why) { return {at, why, true}; }
Problem missing(std::size_t at, const char* why) { return {at, why, false}; }

// "character 8, "$", ..." counted in characters, not bytes.
std::string describe(std::string_view text, const Problem& p) {
    std::size_t number = 1;
    for (std::size_t i = 0; i < p.at && i < text.size(); ++i)
        number += i + 1 >= text.size() || (static_cast<unsigned char>(text[i + 1]) & 0xc0) != 0x80;
    std::string out = "at character " + std::to_string(number) + ", ";
    if (p.character && p.at < text.size()) {
        std::size_t length = 1;
        while (p.at + length < text.size() && (static_cast<unsigned char>(text[p.at + length]) & 0xc0) == 0x80 && length < 4) ++length;
        out += shown(text.substr(p.at, length)) + ", ";
    }
    return out + p.why;
}

// ---- addresses ----

Problem checkNumber(std::string_view text, std::size_t at, Address& out) {
    std::string_view number = text.substr(at);
    if (number.empty()) return missing(at, "a port (1 to 65535) or a program (0x0 to 0x1fffffff) is missing after the colon");
    bool program = number.starts_with("0x") || number.starts_with("0X");
    if (program) {
        at += 2;
        number.remove_prefix(2);
        if (number.empty()) return missing(at, "the hexadecimal digits of a program are missing after 0x");
    }
    auto wrong = std::find_if(number.begin(), number.end(), [&](char c) { return program ? !isHex(c) : !isDigit(c); });
    if (wrong != number.end())
        return here(at + static_cast<std::size_t>(wrong - number.begin()),
                    program ? "must be a hexadecimal digit of a program" : "must be a digit of a port");
    std::uint32_t value = 0;
    auto result = std::from_chars(number.data(), number.data() + number.size(), value, program ? 16 : 10);
    bool fits = result.ec == std::errc();
    if (program && (!fits || value >= kPrograms)) return missing(at, "the program must be less than 0x20000000");
    if (!program && (!fits || value < 1 || value > 65535)) return missing(at, "the port must be 1 to 65535");
    out.kind = program ? Address::Kind::program : Address::Kind::tcp;
    out.number = value;
    out.as = out.host;
    return {};
}

Problem checkAddress(std::string_view text, Address& out) {
    if (text.empty()) return missing(0, "an address is missing: HOST:PORT, HOST:0xPROGRAM, /PATH or an alias");
    std::size_t at = 0;
    if (text[0] == '/') {
        for (; at < text.size(); ++at)
            if (isSeparator(text[at])) return here(at, "must not be in the path of a socket");
        if (!isUtf8(text)) return missing(0, "the path is not UTF-8");
        out.kind = Address::Kind::path;
        out.host = text;
        return {};
    }
    if (text[0] == '[') {
        std::size_t close = text.find(']');
        if (close == text.npos) return missing(text.size(), "the closing bracket of an IPv6 host is missing");
        std::string_view host = text.substr(1, close - 1);
        if (host.empty()) return missing(1, "the IPv6 host between the brackets is missing");
        bool zone = false;      // fe80::1%eth0
        for (at = 0; at < host.size(); ++at) {
            if (host[at] == '%') zone = true;
            bool good = zone ? isWordCharacter(host[at]) || host[at] == '%' : isHex(host[at]) || host[at] == ':' || host[at] == '.';
            if (!good) return here(at + 1, "must not be in an IPv6 host");
        }
        // Without a colon it would come out of toText() as another kind of host.
        if (host.find(':') == host.npos) return missing(1, "brackets are for IPv6 hosts, which have colons");
        if (close + 1 == text.size() || text[close + 1] != ':')
            return missing(close + 1, "a colon and the port are missing after the IPv6 host");
        out.host = host;
        return checkNumber(text, close + 2, out);
    }
    std::size_t colon = text.find(':');
    std::string_view word = text.substr(0, colon);
    if (word.empty()) return missing(0, "the host before the colon is missing");
    for (; at < word.size(); ++at)
        if (!isWordCharacter(word[at]))
            return here(at, colon == text.npos ? "must not be in an alias (letters, digits, _ - .)"
                                               : "must not be in a host (letters, digits, _ - .)");
    if (colon == text.npos) {
        out.kind = text == "self" ? Address::Kind::self : Address::Kind::alias;
        if (out.kind == Address::Kind::alias) out.host = text;
        return {};
    }
    if (text.find(':', colon + 1) != text.npos) return missing(0, "an IPv6 host is written in brackets: [::1]:7014");
    out.host = word;
    return checkNumber(text, colon + 1, out);
}

// ---- names ----

Problem checkName(std::string_view text, Name* out) {
    std::size_t dot = text.size(), at = std::min(text.find('@'), text.size());
    bool lowerCase = false, upperCase = false;
    for (std::size_t i = 0; i < at; ++i) {
        char c = text[i];
        if (c == '.') {
            dot = i;
            break;
        }
        if (isLower(c) || isUpper(c)) {
            if (isUpper(c) && isLower(text[0])) continue;       // findBall is findball
            (isLower(c) ? lowerCase : upperCase) = true;
            if (lowerCase && upperCase)
                return here(i, "mixes cases: a class begins in lower case (served here or behind @) or is all upper case (at its default location)");
        } else if (i == 0) {
            return here(i, "must be a letter: a name begins with its class");
        } else if (!isDigit(c) && c != '_') {
            return here(i, "must not be in a class (letters, digits, _)");
        }
    }
    std::size_t end = std::min(dot, at);
    if (end == 0) return text.empty() ? missing(0, "the class is missing") : here(0, "must be a letter: a name begins with its class");
    if (dot < at) {
        if (dot + 1 == at) return missing(at, "the flavor is missing after the dot");
        constexpr std::string_view kSpecial = "[]{}$\"\\;";
        for (std::size_t i = dot + 1; i < at; ++i) {
            if (text[i] == '.' && (text[i - 1] == '.' || i + 1 == at)) return missing(i, "a part of the flavor between dots is empty");
            if (isSeparator(text[i])) return here(i, "must not be in a flavor (white space and control characters)");
            if (kSpecial.find(text[i]) != kSpecial.npos) return here(i, "must not be in a flavor (it is special to Tcl)");
        }
        std::string_view flavor = text.substr(dot + 1, at - dot - 1);
        if (!isUtf8(flavor)) return missing(dot + 1, "the flavor is not UTF-8");
    }
    std::string_view where;
    if (at < text.size()) {
        if (upperCase) return here(at, "must not follow a class in upper case, which is served at its default location");
        where = text.substr(at + 1);
        Address address;
        if (Problem p = checkAddress(where, address)) {
            p.at += at + 1;
            return p;
        }
    }
    if (out) {
        out->className = mapped(text.substr(0, end), lower);
        out->flavor = dot < at ? text.substr(dot + 1, at - dot - 1) : std::string_view();
        out->service = out->className;
        out->service += text.substr(end, at - end);
        out->where = where;
        out->byDefault = upperCase;
    }
    return {};
}

}  // namespace

std::string Address::toText() const {
    std::string text = host.find(':') == host.npos || kind == Kind::path ? host : '[' + host + ']';
    switch (kind) {
        case Kind::self: return "self";
        case Kind::tcp: return text + ':' + std::to_string(number);
        case Kind::program: {
            char digits[16];
            return text + ":0x" + std::string(digits, std::to_chars(digits, digits + sizeof digits, number, 16).ptr);
        }
        case Kind::path:
        case Kind::alias: break;
    }
    return text;
}

Address Address::parse(std::string_view text) {
    Address out;
    if (Problem p = checkAddress(text, out)) fail(kAddress, text, shown(text), describe(text, p));
    return out;
}

std::string Name::toText() const {
    if (byDefault) return mapped(className, upper) + service.substr(className.size());
    return where.empty() ? service : service + '@' + where;
}

Name Name::parse(std::string_view text) {
    Name out;
    if (Problem p = checkName(text, &out)) fail(kName, text, shown(text), describe(text, p));
    return out;
}

std::string Name::location() const {
    if (byDefault) return mapped(className, upper);
    return where.empty() ? std::string() : '@' + where;
}

std::string Name::recipeKey() const { return byDefault && flavor.empty() ? std::string() : toText(); }

bool Name::isElsewhere(std::string_view text) {
    return !text.empty() && (isUpper(text[0]) || text.find('@') != text.npos);
}

bool Name::isLocation(std::string_view word) {
    return !word.empty() && (word[0] == '@' || (isUpper(word[0]) && word.find_first_of(".@") == word.npos));
}

bool Name::isName(std::string_view text) { return !checkName(text, nullptr); }

// An address as an entry says it: with or without @ before it.
static std::string_view withoutAt(std::string_view word) { return word.starts_with('@') ? word.substr(1) : word; }

std::string whereOf(const Name& name, const Dictionary& dictionary) {
    if (!name.byDefault) return name.where;
    auto words = dictionary.expand(name.location());
    return words.empty() ? std::string() : std::string(withoutAt(words[0].text));
}

// Reads the word after -tls in an entry.
static Address::Tls tlsOf(std::string_view word, const std::string& whole, const std::string& entry) {
    if (word == "yes") return Address::Tls::yes;
    if (word == "no") return Address::Tls::no;
    if (word == "try") return Address::Tls::tries;
    fail(kBadEntry, whole, entry, "-tls expects yes, no or try, got \"" + std::string(word) + "\"");
}

Address resolve(const Name& name, const Dictionary& dictionary, std::string* rule) {
    const std::string whole = name.toText();
    std::vector<std::string> chain;         // entries that were looked at
    bool wait = false;
    auto tls = Address::Tls::unsaid;
    // The address in an entry, whose word is in the chain already.
    auto follow = [&](std::string key) {
        bool again = std::find(chain.begin(), chain.end(), key) != chain.end();
        chain.push_back(std::move(key));
        if (again) {
            std::string text;
            for (auto& word : chain) text += (text.empty() ? "" : " -> ") + word;
            fail(kCircle, whole, text);
        }
        auto words = dictionary.expand(chain.back());
        if (words.empty()) fail(kNoAddress, whole, chain.back());
        wait = wait || std::any_of(words.begin() + 1, words.end(), [](auto& word) { return word.text == "-wait"; });
        for (std::size_t i = 1; i < words.size(); ++i)
            if (words[i].text == "-tls") tls = tlsOf(i + 1 < words.size() ? words[i + 1].text : std::string(), whole, chain.back());
        try {
            return Address::parse(withoutAt(words[0].text));
        } catch (const Error& e) {
            fail(kBadEntry, whole, chain.back(), e.what());
        }
    };
    Address address;
    if (name.byDefault) {
        std::string key = name.location();
        if (!dictionary.has(key)) fail(kNoDefault, whole, key);
        address = follow(key);
    } else if (!name.where.empty()) {
        address = Address::parse(name.where);
    }
    while (address.kind == Address::Kind::alias && dictionary.has('@' + address.host)) address = follow('@' + address.host);
    if (rule) *rule = address.kind == Address::Kind::alias ? '@' + address.host : chain.empty() ? name.location() : chain.back();
    address.wait = wait;
    address.tls = tls;
    if (!chain.empty() && chain.back().starts_with('@')) address.as = chain.back().substr(1);
    return address;
}

}  // namespace sorma
