#include "bus/requestText.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <climits>
#include <cstring>

#include "bus/trailText.h"

namespace sorma {

namespace {

const Prototype kSyntax{Severity::error, "REQUEST SYNTAX", 0, "word {}: expected {}, got {}"};
const Prototype kTrailSyntax{Severity::error, "REQUEST SYNTAX", 0, "word {}: bad trail after TDBX: {}"};
const Prototype kMethod{Severity::error, "REQUEST SYNTAX", 0, "bad method {}: must be CTRL, DBX, or EXEC"};
const Prototype kUtf8{Severity::error, "REQUEST SYNTAX", 0, "the text is not UTF-8: byte {} is {}"};

constexpr const char* kEnd = "the end of the text";

// ---- classes of characters ----

enum : std::uint8_t {
    kWhite = 1,         // ends a bare word
    kControl = 2,       // white space but the blank, and all that is not to be seen
    kQuote = 4,
    kBrace = 8,
    kBackslash = 16,
    kHigh = 32,         // beyond ASCII
};

constexpr std::array<std::uint8_t, 256> kTraits = [] {
    std::array<std::uint8_t, 256> t{};
    for (int c = 0; c < 0x20; ++c) t[c] = kControl;
    for (int c = 0x80; c < 0x100; ++c) t[c] = kHigh;
    for (int c : {'\t', '\n', '\v', '\f', '\r'}) t[c] = kWhite | kControl;
    t[' '] = kWhite;
    t[0x7f] = kControl;
    t['"'] = t['\''] = kQuote;
    t['{'] = t['}'] = kBrace;
    t['\\'] = kBackslash;
    return t;
}();

inline std::uint8_t traits(char c) { return kTraits[static_cast<unsigned char>(c)]; }
inline bool isWhite(char c) { return traits(c) & kWhite; }

// ---- keywords ----

enum class Keyword { none, text, floats, ints, any, trail };

Keyword keyword(std::string_view word) {
    if (word.size() != 4) return Keyword::none;
    if (word == "TMSG") return Keyword::text;
    if (word == "FMSG") return Keyword::floats;
    if (word == "IMSG") return Keyword::ints;
    if (word == "AMSG") return Keyword::any;
    if (word == "TDBX") return Keyword::trail;
    return Keyword::none;
}

std::string ordinal(std::uint64_t n) {
    const char* ending = "th";
    if (n / 10 % 10 != 1) {
        if (n % 10 == 1) ending = "st";
        if (n % 10 == 2) ending = "nd";
        if (n % 10 == 3) ending = "rd";
    }
    return std::to_string(n) + ending;
}

void appendHex(std::string& out, char c) {
    constexpr const char* kDigits = "0123456789abcdef";
    auto u = static_cast<unsigned char>(c);
    out += "\\x";
    out += kDigits[u >> 4];
    out += kDigits[u & 15];
}

int hexDigit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

void needUtf8(std::string_view text) {
    std::size_t bad = utf8Prefix(text);
    if (bad == text.size()) [[likely]] return;
    std::string byte;
    appendHex(byte, text[bad]);
    fail(kUtf8, bad + 1, byte);
}

// ---- numbers ----

constexpr std::size_t kNumberSize = 32;     // more than any double or 64-bit integer takes

char* putNumber(char* at, double value) {
    if (value != value) [[unlikely]] {      // to_chars tells the sign of a NaN, which nobody means
        std::memcpy(at, "nan", 3);
        return at + 3;
    }
    return std::to_chars(at, at + kNumberSize, value).ptr;
}

char* putNumber(char* at, std::int64_t value) { return std::to_chars(at, at + kNumberSize, value).ptr; }

template <class T> void appendOne(std::string& out, T value) {
    char buffer[kNumberSize];
    out.append(buffer, static_cast<std::size_t>(putNumber(buffer, value) - buffer));
}

// A keyword, the count and the numbers, through a buffer: the string neither fills what is then overwritten nor is
// asked for room number by number.
template <class T> void appendNumbers(std::string& out, const char* key, const std::vector<T>& values) {
    constexpr std::size_t kChunk = 64;
    char buffer[kChunk * (kNumberSize + 1)];
    out += key;
    appendOne(out, static_cast<std::int64_t>(values.size()));
    for (std::size_t i = 0; i < values.size();) {
        char* at = buffer;
        for (std::size_t stop = std::min(values.size(), i + kChunk); i < stop; ++i) {
            *at++ = ' ';
            at = putNumber(at, values[i]);
        }
        out.append(buffer, static_cast<std::size_t>(at - buffer));
    }
}

// Number at the beginning of a text: where it ends, or null.
template <class T> const char* readNumber(const char* from, const char* to, T& value) {
    auto [end, problem] = std::from_chars(from, to, value);
    if (problem != std::errc()) return nullptr;
    if (end[-1] == ')') return nullptr;     // nan(payload)
    return end;
}

template <class T> bool parseWhole(std::string_view text, T& value) {
    const char *from = text.data(), *to = from + text.size();
    if (text.size() > 1 && *from == '+' && from[1] != '-') ++from;      // from_chars does not know it, people do
    T read;
    if (from == to || readNumber(from, to, read) != to) return false;
    value = read;
    return true;
}

bool looksNumeric(std::string_view word) {
    double number;
    return parseNumber(word, number);       // any integer is one too
}

// Why a word is no such number, in words.
template <class T> std::string whatCame(std::string_view word) {
    std::string text = shown(word);
    T value;
    const char *from = word.data(), *to = from + word.size();
    auto [end, problem] = std::from_chars(from, to, value);
    if (problem == std::errc::result_out_of_range && end == to) text += ", which is out of range";
    return text;
}

// ---- parts ----

struct PartNames {
    const char *keyword, *one, *many;
};
constexpr PartNames kFloats{"FMSG", "float", "floats"}, kInts{"IMSG", "int", "ints"};

[[noreturn]] void failEnd(const WordReader& reader, std::string_view expected) {
    fail(kSyntax, reader.index() + 1, expected, kEnd);
}

template <class T>
[[noreturn]] [[gnu::noinline]] void failNumber(const WordReader& reader, const PartNames& names, std::uint64_t index,
                                               std::uint64_t count, const std::string_view* word) {
    std::string expected = "the " + ordinal(index) + " of " + std::to_string(count) + ' ' + (count == 1 ? names.one : names.many);
    if (!word) failEnd(reader, expected);
    fail(kSyntax, reader.index(), expected, whatCame<T>(*word));
}

[[noreturn]] [[gnu::noinline]] void failTooMany(const WordReader& reader, const PartNames& names, std::size_t count,
                                                std::string_view word) {
    std::string expected = std::string("a keyword, a word or the end after ") + names.keyword + ' ' + std::to_string(count) +
                           " and its " + (count == 1 ? names.one : names.many);
    fail(kSyntax, reader.index(), expected, "the further number " + std::string(word));
}

template <class T> void parseNumbers(WordReader& reader, const PartNames& names, std::vector<T>& out) {
    std::string_view word;
    std::int64_t count = 0;
    if (!reader.nextNumber(count) || count < 0) {
        std::string expected = std::string("the number of ") + names.many + " after " + names.keyword;
        if (count < 0) fail(kSyntax, reader.index(), expected, count);
        if (!reader.next(word)) failEnd(reader, expected);
        if (!parseNumber(word, count) || count < 0) fail(kSyntax, reader.index(), expected, shown(word));
    }
    const auto n = static_cast<std::uint64_t>(count);
    // A number takes two characters at least: do not believe a count that the text cannot hold.
    out.reserve(std::min<std::uint64_t>(n, reader.rest().size() / 2));
    for (std::uint64_t i = 1; i <= n; ++i) {
        T value;
        if (!reader.nextNumber(value)) {
            if (!reader.next(word)) failNumber<T>(reader, names, i, n, nullptr);
            if (!parseNumber(word, value)) failNumber<T>(reader, names, i, n, &word);
        }
        out.push_back(value);
    }
}

// The word after TMSG, AMSG or TDBX.
std::string_view argument(WordReader& reader, const char* expected) {
    std::string_view word;
    if (!reader.next(word)) failEnd(reader, expected);
    if (!reader.quoted() && keyword(word) != Keyword::none)
        fail(kSyntax, reader.index(), expected, "the keyword " + std::string(word) + " (as a word it is written {" + std::string(word) + "})");
    return word;
}

void parseTrail(WordReader& reader, Message& message) {
    std::string_view word = argument(reader, "a trail after TDBX");
    Trail trail;
    try {
        trail = trailFromWord(word);
    } catch (const Error& e) {
        fail(kTrailSyntax, reader.index(), e.what());
    }
    message.trail.append(trail);
}

// Parts of EXEC, or of a reply, where free words have no place.
void parseExec(WordReader& reader, bool reply, Message& message) {
    unsigned seen = 0;
    const PartNames* numbers = nullptr;     // the part just read, when it was one of numbers
    std::string_view word;
    while (reader.next(word)) {
        Keyword key = reader.quoted() ? Keyword::none : keyword(word);
        if (key == Keyword::none) {
            if (numbers && !reader.quoted() && looksNumeric(word))
                failTooMany(reader, *numbers, numbers == &kFloats ? message.floats.size() : message.ints.size(), word);
            if (reply) fail(kSyntax, reader.index(), "TMSG, FMSG, IMSG, AMSG, TDBX or the end", shown(word));
            message.words.emplace_back(word);
            numbers = nullptr;
            continue;
        }
        const unsigned bit = 1u << static_cast<int>(key);
        if (seen & bit) fail(kSyntax, reader.index(), std::string(word) + " once at most", "a second one");
        seen |= bit;
        numbers = nullptr;
        switch (key) {
            case Keyword::text: message.text.assign(argument(reader, "a text after TMSG")); break;
            case Keyword::floats:
                parseNumbers(reader, kFloats, message.floats);
                numbers = &kFloats;
                break;
            case Keyword::ints:
                parseNumbers(reader, kInts, message.ints);
                numbers = &kInts;
                break;
            case Keyword::any:
                word = argument(reader, "base64 after AMSG");
                if (!parseBase64(word, message.any)) fail(kSyntax, reader.index(), "base64 after AMSG", shown(word));
                break;
            case Keyword::trail: parseTrail(reader, message); break;
            case Keyword::none: break;
        }
    }
}

void separate(std::string& out) {
    if (!out.empty() && !isWhite(out.back())) out += ' ';
}

bool bracesBalance(std::string_view word) {
    std::size_t depth = 0;
    for (char c : word) {
        if (c == '{') ++depth;
        if (c == '}' && depth-- == 0) return false;
    }
    return depth == 0;
}

void putWord(std::string& out, std::string_view word, bool bareAllowed) {
    std::uint8_t all = 0;
    for (char c : word) all |= traits(c);
    if ((all & kHigh) && !isUtf8(word)) return putWord(out, withoutBadBytes(word), bareAllowed);
    separate(out);
    if (bareAllowed && !word.empty() && !(all & (kWhite | kControl | kQuote | kBrace))) {
        out += word;
    } else if (!(all & (kControl | kBackslash)) && (!(all & kBrace) || bracesBalance(word))) {
        out += '{';
        out += word;
        out += '}';
    } else {
        out += '"';
        for (char c : word) {
            switch (c) {
                case '"': out += "\\\""; break;
                case '\\': out += "\\\\"; break;
                case '\n': out += "\\n"; break;
                case '\t': out += "\\t"; break;
                case '\r': out += "\\r"; break;
                default:
                    if (traits(c) & kControl) appendHex(out, c);
                    else out += c;
            }
        }
        out += '"';
    }
}

}  // namespace

// ---- words ----

bool WordReader::next(std::string_view& word) {
    const char *const begin = text_.data(), *const end = begin + text_.size();
    const char* p = begin + at_;
    while (p != end && isWhite(*p)) ++p;
    at_ = static_cast<std::size_t>(p - begin);
    if (p == end) return false;
    ++index_;
    if (*p == '"' || *p == '\'' || *p == '{') [[unlikely]] return nextQuoted(word);
    const char* from = p;
    while (p != end && !isWhite(*p)) ++p;
    at_ = static_cast<std::size_t>(p - begin);
    quoted_ = false;
    word = std::string_view(from, static_cast<std::size_t>(p - from));
    return true;
}

bool WordReader::nextQuoted(std::string_view& word) {
    const char open = text_[at_], close = open == '{' ? '}' : open;
    const std::size_t from = at_ + 1, none = std::string_view::npos;
    std::size_t at = from;
    bool escapes = false;
    if (open == '\'') {
        at = text_.find('\'', from);
    } else if (open == '{') {
        std::size_t depth = 1;
        for (;; ++at) {
            at = text_.find_first_of("{}", at);
            if (at == none) break;
            if (text_[at] == '{') ++depth;
            else if (--depth == 0) break;
        }
    } else {
        for (;; at += 2) {
            at = text_.find_first_of("\"\\", at);
            if (at == none || text_[at] == '"') break;
            escapes = true;
        }
    }
    if (at == none) fail(kSyntax, index_, std::string("a closing ") + close, kEnd);
    if (at + 1 < text_.size() && !isWhite(text_[at + 1])) {
        std::size_t stop = at + 1;
        while (stop < text_.size() && !isWhite(text_[stop])) ++stop;
        fail(kSyntax, index_, std::string("white space after the closing ") + close, shown(text_.substr(at + 1, stop - at - 1)));
    }
    at_ = at + 1;
    quoted_ = true;
    word = text_.substr(from, at - from);
    if (!escapes) return true;

    scratch_.clear();
    for (std::size_t i = 0; i < word.size(); ++i) {
        if (word[i] != '\\') {
            scratch_ += word[i];
            continue;
        }
        char c = word[++i];     // there is one: a backslash never stands before the closing quote
        switch (c) {
            case 'n': scratch_ += '\n'; continue;
            case 't': scratch_ += '\t'; continue;
            case 'r': scratch_ += '\r'; continue;
            case 'x': {
                int high = i + 2 < word.size() ? hexDigit(word[i + 1]) : -1;
                int low = i + 2 < word.size() ? hexDigit(word[i + 2]) : -1;
                if (high < 0 || low < 0) fail(kSyntax, index_, "two hexadecimal digits after \\x", shown(word.substr(i - 1, 4)));
                appendUtf8(scratch_, char32_t(high * 16 + low));
                i += 2;
                continue;
            }
            default: break;
        }
        bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (letter || (traits(c) & (kControl | kHigh)))
            fail(kSyntax, index_, "\\n, \\t, \\r, \\xHH or punctuation after a backslash", shown(word.substr(i - 1, 2)));
        scratch_ += c;
    }
    word = scratch_;
    return true;
}

template <class T> bool WordReader::takeNumber(T& value) {
    const char *const begin = text_.data(), *const end = begin + text_.size();
    const char* p = begin + at_;
    while (p != end && isWhite(*p)) ++p;
    if (p == end) return false;
    T read;
    p = readNumber(p, end, read);
    if (!p || (p != end && !isWhite(*p))) return false;
    at_ = static_cast<std::size_t>(p - begin);
    ++index_;
    quoted_ = false;
    value = read;
    return true;
}

bool WordReader::nextNumber(double& value) { return takeNumber(value); }
bool WordReader::nextNumber(std::int64_t& value) { return takeNumber(value); }

std::vector<std::string> splitWords(std::string_view text) {
    std::vector<std::string> words;
    WordReader reader(text);
    for (std::string_view word; reader.next(word);) words.emplace_back(word);
    return words;
}

void appendWord(std::string& out, std::string_view word, bool keywords) {
    putWord(out, word, !keywords || keyword(word) == Keyword::none);
}

void appendQuoted(std::string& out, std::string_view word) { putWord(out, word, false); }

std::string joinWords(const std::vector<std::string>& words) {
    std::string out;
    for (auto& word : words) appendWord(out, word);
    return out;
}

std::string shown(std::string_view word) {
    constexpr std::size_t kMost = 60;
    bool cut = word.size() > kMost;
    if (cut) {
        std::size_t at = kMost;
        while (at > kMost - 4 && (static_cast<unsigned char>(word[at]) & 0xc0) == 0x80) --at;   // not inside a character
        word = word.substr(0, at);
    }
    std::string clean = isUtf8(word) ? std::string(word) : withoutBadBytes(word), out = "\"";
    for (char c : clean) {
        if (traits(c) & kControl) appendHex(out, c);
        else out += c;
    }
    return out += cut ? "...\"" : "\"";
}

// ---- numbers ----

void appendNumber(std::string& out, double value) { appendOne(out, value); }
void appendNumber(std::string& out, std::int64_t value) { appendOne(out, value); }

std::string numberText(double value) {
    std::string out;
    appendOne(out, value);
    return out;
}

std::string plainNumber(double value) {
    double size = std::fabs(value);
    if (size != 0 && !(size >= 1e-4 && size < 1e15)) return numberText(value);
    char buffer[64];
    return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed).ptr);
}

bool parseNumber(std::string_view text, double& value) { return parseWhole(text, value); }
bool parseNumber(std::string_view text, std::int64_t& value) { return parseWhole(text, value); }

// ---- requests and replies ----

void parseParts(WordReader& reader, Method method, Message& message) {
    if (method == Method::exec) {
        parseExec(reader, false, message);
    } else {
        for (std::string_view word; reader.next(word);) message.words.emplace_back(word);
    }
}

void parseRequest(std::string_view text, std::string& name, Method& method, Message& message) {
    message.reset();
    name.clear();
    needUtf8(text);
    WordReader reader(text);
    std::string_view word;
    if (!reader.next(word)) failEnd(reader, "the name of a service object");
    name.assign(word);
    if (!reader.next(word)) failEnd(reader, "CTRL, DBX, or EXEC");
    if (!fromText(word, method)) fail(kMethod, shown(word));
    parseParts(reader, method, message);
}

void parseReply(std::string_view text, std::string& name, Message& message) {
    message.reset();
    name.clear();
    needUtf8(text);
    WordReader reader(text);
    std::string_view word;
    if (!reader.next(word)) failEnd(reader, "the name of a service object");
    name.assign(word);
    if (!reader.next(word)) failEnd(reader, "RET");
    if (word != "RET") fail(kSyntax, reader.index(), "RET", shown(word));
    if (!reader.next(word)) failEnd(reader, "the code after RET");
    std::int64_t code;
    if (!parseNumber(word, code) || code < INT_MIN || code > INT_MAX)
        fail(kSyntax, reader.index(), "the code after RET, an integer of 32 bits", shown(word));
    message.code = static_cast<int>(code);
    parseExec(reader, true, message);
}

void appendParts(std::string& out, const Message& message) {
    if (!message.text.empty()) {
        separate(out);
        out += "TMSG";
        appendWord(out, message.text, true);
    }
    if (!message.floats.empty()) {
        separate(out);
        appendNumbers(out, "FMSG ", message.floats);
    }
    if (!message.ints.empty()) {
        separate(out);
        appendNumbers(out, "IMSG ", message.ints);
    }
    if (!message.any.empty()) {
        separate(out);
        out += "AMSG ";
        std::size_t at = out.size();
        appendBase64(out, message.any.data(), message.any.size());
        if (keyword(std::string_view(out).substr(at)) != Keyword::none) {   // some three bytes read TMSG in base64
            out.insert(at, 1, '{');
            out += '}';
        }
    }
}

void appendRequest(std::string& out, std::string_view name, Method method, const Message& message) {
    appendWord(out, name);
    out += ' ';
    out += toText(method);
    if (method == Method::exec) appendParts(out, message);
    bool exec = method == Method::exec;
    bool afterNumbers = exec && message.any.empty() && !(message.floats.empty() && message.ints.empty());
    for (auto& word : message.words) {
        if (afterNumbers && looksNumeric(word)) appendQuoted(out, word);
        else appendWord(out, word, exec);
        afterNumbers = false;
    }
}

void appendReply(std::string& out, std::string_view name, const Message& message, bool plain) {
    if (plain) out += name;
    else appendWord(out, name);
    if (message.code == 0) {
        out += " RET 0";
    } else {
        out += " RET ";
        appendNumber(out, std::int64_t{message.code});
    }
    appendParts(out, message);
    if (!message.trail.empty()) {
        out += " TDBX";
        appendWord(out, trailToWord(message.trail), true);
    }
}

}  // namespace sorma
