#include "tcl/convert.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "bus/requestText.h"
#include "bus/service.h"
#include "bus/trailText.h"
#include "bus/utf8.h"

namespace sorma {

namespace {

const Prototype kWord{Severity::error, "REQUEST SYNTAX", 0, "expected {} but got \"{}\""};
const Prototype kEnd{Severity::error, "REQUEST SYNTAX", 0, "expected {} after {} but the request ends"};
const Prototype kTwice{Severity::error, "REQUEST SYNTAX", 0, "{} stands twice"};
const Prototype kPartLate{Severity::error, "REQUEST SYNTAX", 0, "{} stands after the word \"{}\": parts stand before words; words behind -- are never parts"};
const Prototype kCount{Severity::error, "REQUEST SYNTAX", 0, "{} announces {} numbers but {} {}"};
const Prototype kWide{Severity::error, "REQUEST SYNTAX", 0, "integer \"{}\" does not fit in 64 bits"};
const Prototype kSurrogate{Severity::error, "REQUEST SYNTAX", 0, "half a surrogate pair in text cannot be written as UTF-8"};
const Prototype kBytes{Severity::error, "REQUEST SYNTAX", 0, "expected bytes but got a character above 255"};
const Prototype kResult{Severity::error, "SERVICE RESULT", 0, "{}: method exec returned {}"};

using Byte = unsigned char;

// A lead byte of ED begins half of a character in 8.6's habit; in both, an ordinary Korean letter (ED 80..9F).
bool ordinary(std::string_view tclText) {
    for (char c : tclText)
        if (Byte(c) == 0xC0 || Byte(c) == 0xED) return false;
    return true;
}

int halfAt(std::string_view s, std::size_t i) {     // the surrogate that begins there, or -1
    if (i + 2 >= s.size() || Byte(s[i]) != 0xED || Byte(s[i + 1]) < 0xA0) return -1;
    return 0xD000 | (Byte(s[i + 1]) & 0x3F) << 6 | (Byte(s[i + 2]) & 0x3F);
}

// Length of the UTF-8 character at i, 0 when there is none.
std::size_t characterAt(std::string_view s, std::size_t i) {
    Byte c = Byte(s[i]);
    std::size_t n = c < 0x80 ? 1 : c >= 0xC2 && c < 0xE0 ? 2 : c >= 0xE0 && c < 0xF0 ? 3 : c >= 0xF0 && c < 0xF5 ? 4 : 0;
    return n > 0 && i + n <= s.size() && isUtf8(s.substr(i, n)) ? n : 0;
}

Tcl_Obj* newTextSlowly(std::string_view utf8) {
    std::string out;
    out.reserve(utf8.size() + 16);
    for (std::size_t i = 0; i < utf8.size();) {
        std::size_t n = characterAt(utf8, i);
        if (utf8[i] == 0) {
            out += "\xC0\x80";
        } else if (n == 0) {
            appendUtf8(out, Byte(utf8[i]));
            n = 1;
#if TCL_UTF_MAX <= 3
        } else if (n == 4) {
            unsigned c = (Byte(utf8[i]) & 7u) << 18 | (Byte(utf8[i + 1]) & 0x3Fu) << 12 |
                         (Byte(utf8[i + 2]) & 0x3Fu) << 6 | (Byte(utf8[i + 3]) & 0x3Fu);
            appendUtf8(out, 0xD800 + ((c - 0x10000) >> 10));
            appendUtf8(out, 0xDC00 + ((c - 0x10000) & 0x3FF));
#endif
        } else {
            out += utf8.substr(i, n);
        }
        i += n;
    }
    return Tcl_NewStringObj(out.data(), tclSize(out.size()));
}

enum class Keyword { none, tmsg, fmsg, imsg, amsg };

Keyword keyword(Tcl_Obj* o) {
    std::string_view w = view(o);
    if (w.size() != 4 || w[1] != 'M' || w[2] != 'S' || w[3] != 'G') return Keyword::none;
    switch (w[0]) {
        case 'T': return Keyword::tmsg;
        case 'F': return Keyword::fmsg;
        case 'I': return Keyword::imsg;
        case 'A': return Keyword::amsg;
        default: return Keyword::none;
    }
}

template <class T, class Read>
void readNumbers(std::span<Tcl_Obj* const> words, std::size_t& at, const char* key, std::vector<T>& out, Read read) {
    if (at == words.size()) fail(kEnd, "a count", key);
    Tcl_WideInt n;
    if (Tcl_GetWideIntFromObj(nullptr, words[at], &n) != TCL_OK || n < 0) fail(kWord, "a count", toUtf8(words[at]));
    const std::size_t rest = words.size() - at - 1;
    if (std::size_t(n) > rest) fail(kCount, key, std::int64_t(n), rest == 0 ? "none" : "only " + std::to_string(rest), rest == 1 ? "follows" : "follow");
    ++at;
    out.reserve(out.size() + std::size_t(n));
    for (const std::size_t end = at + std::size_t(n); at < end; ++at) out.push_back(read(words[at]));
}

// Says which object the request is for, and where in it the error is. at: of the word, among those after the method.
[[noreturn]] [[gnu::cold]] void failIn(std::string_view object, std::string_view method, std::span<Tcl_Obj* const> words,
                                       std::size_t at, Error e, const std::string& within = {}) {
    constexpr std::size_t kBefore = 3, kAfter = 2;
    std::string around;
    const std::size_t from = at > kBefore ? at - kBefore : 0, to = std::min(words.size(), at + kAfter + 1);
    for (std::size_t k = from; k < to; ++k) {
        std::string word = shown(toUtf8(words[k]));             // cut, and without control characters
        appendWord(around, std::string_view(word).substr(1, word.size() - 2));
    }
    auto& cause = e.trail.entries().front();
    const std::size_t first = 2 + std::size_t(std::count(method.begin(), method.end(), ' '));
    cause.text = std::string(object) + ": word " + std::to_string(first + at + 1) + within + ": " + cause.text + ", in: " +
                 (from > 0 ? "..." : std::string(object) + ' ' + std::string(method)) + ' ' + around + (to < words.size() ? " ..." : "");
    throw e;
}

}  // namespace

Tcl_Size tclSize(std::size_t n) {
    if (n > std::size_t(TCL_SIZE_MAX) - 1) throw std::length_error("more than this Tcl can hold in one value");
    return Tcl_Size(n);
}

// ---- text ----

void appendUtf8(std::string& out, Tcl_Obj* o) {
    std::string_view s = view(o);
    if (ordinary(s)) [[likely]] {
        out.append(s);
        return;
    }
    for (std::size_t i = 0; i < s.size();) {
        if (Byte(s[i]) == 0xC0 && i + 1 < s.size() && Byte(s[i + 1]) == 0x80) {
            out += '\0';
            i += 2;
        } else if (int high = halfAt(s, i); high >= 0) {
            int low = halfAt(s, i + 3);
            if (high >= 0xDC00 || low < 0xDC00) fail(kSurrogate);
            appendUtf8(out, 0x10000u + ((unsigned(high) - 0xD800u) << 10) + (unsigned(low) - 0xDC00u));
            i += 6;
        } else {
            out += s[i++];
        }
    }
}

std::string toUtf8(Tcl_Obj* o) {
    std::string out;
    appendUtf8(out, o);
    return out;
}

Tcl_Obj* newText(std::string_view utf8) {
    bool plain = true;
    for (char c : utf8) plain = plain && Byte(c - 1) < 0x7F;        // 1 .. 127
    return plain ? Tcl_NewStringObj(utf8.data(), tclSize(utf8.size())) : newTextSlowly(utf8);
}

// ---- lists and numbers ----

std::span<Tcl_Obj* const> listElements(Tcl_Obj* list) {
    Tcl_Size n;
    Tcl_Obj** elements;
    if (Tcl_ListObjGetElements(nullptr, list, &n, &elements) != TCL_OK) fail(kWord, "a list", toUtf8(list));
    return {elements, std::size_t(n)};
}

std::vector<std::string> listStrings(Tcl_Obj* list) {
    std::vector<std::string> out;
    for (auto* o : listElements(list)) out.push_back(toUtf8(o));
    return out;
}

double toDouble(Tcl_Obj* o) {
    double x;
    if (Tcl_GetDoubleFromObj(nullptr, o, &x) == TCL_OK) [[likely]] return x;
    if (parseNumber(view(o), x)) return x;      // Tcl takes no NaN
    fail(kWord, "a number", toUtf8(o));
}

std::int64_t toInteger(Tcl_Obj* o) {
    Tcl_WideInt n;
    if (Tcl_GetWideIntFromObj(nullptr, o, &n) != TCL_OK) {
        Tcl_Obj* copy = Tcl_DuplicateObj(o);    // if Tcl reads it as an integer, that has more than 64 bits
        Obj keep(copy);
        double x;
        if (Tcl_GetDoubleFromObj(nullptr, copy, &x) == TCL_OK && std::fabs(x) >= 9.2e18) fail(kWide, toUtf8(o));
        fail(kWord, "an integer", toUtf8(o));
    }
    if (n < 0 && view(o).find('-') == std::string_view::npos) fail(kWide, toUtf8(o));     // 8.6 wraps 2^63 .. 2^64 - 1
    return n;
}

bool toBoolean(Tcl_Obj* o) {
    int yes;
    if (Tcl_GetBooleanFromObj(nullptr, o, &yes) != TCL_OK) fail(kWord, "a boolean", toUtf8(o));
    return yes != 0;
}

void toBytes(Tcl_Obj* o, std::vector<unsigned char>& out) {
    if (o->bytes)       // 8.6 cuts such characters off without a word
        for (char c : view(o))
            if (Byte(c) > 0xC3) fail(kBytes);
    Tcl_Size n;
    const unsigned char* bytes = Tcl_GetByteArrayFromObj(o, &n);
    if (!bytes) fail(kBytes);
    out.insert(out.end(), bytes, bytes + n);
}

Constants::Constants() {
    auto word = [](const char* text) { return Obj(Tcl_NewStringObj(text, -1)); };
    empty = Tcl_NewObj();
    ret = word("RET");
    tmsg = word("TMSG");
    fmsg = word("FMSG");
    imsg = word("IMSG");
    amsg = word("AMSG");
    tdbx = word("TDBX");
    text = word("text");
    floats = word("floats");
    ints = word("ints");
    any = word("any");
    words = word("words");
    code = word("code");
    trail = word("trail");
    for (std::int64_t i = kLow; i < kHigh; ++i) small_[std::size_t(i - kLow)] = Tcl_NewWideIntObj(i);
    Tcl_Obj* both[] = {ret, integer(0)};
    ret0 = Tcl_NewListObj(2, both);
    Tcl_Obj* dict = Tcl_NewDictObj();
    Tcl_DictObjPut(nullptr, dict, code, integer(0));
    code0 = dict;
    yield = word("::yield");
    infoCoroutine = word("::tcl::info::coroutine");
    coroutine = word("::coroutine");
    runExec = word("::sorma::tcloo::Run");
}

// ---- requests ----

namespace {

// i: the word that is being read, also when it fails.
void takeParts(std::span<Tcl_Obj* const> words, std::size_t& i, Message& m) {
    bool seen[5] = {};
    while (i < words.size()) {
        Keyword key = keyword(words[i]);
        if (key != Keyword::none && std::exchange(seen[int(key)], true)) fail(kTwice, toUtf8(words[i]));
        ++i;
        switch (key) {
            case Keyword::none:
                m.words.push_back(toUtf8(words[i - 1]));
                break;
            case Keyword::tmsg:
                if (i == words.size()) fail(kEnd, "a text", "TMSG");
                appendUtf8(m.text, words[i++]);
                break;
            case Keyword::fmsg:
                readNumbers(words, i, "FMSG", m.floats, toDouble);
                break;
            case Keyword::imsg:
                readNumbers(words, i, "IMSG", m.ints, toInteger);
                break;
            case Keyword::amsg:
                if (i == words.size()) fail(kEnd, "base64", "AMSG");
                if (!parseBase64(view(words[i]), m.any)) fail(kWord, "base64", toUtf8(words[i]));
                ++i;
                break;
        }
    }
}

// element: the one that is being read, from 1; 0 when all have been.
template <class T, class Read> void readList(Tcl_Obj* list, std::vector<T>& out, std::size_t& element, Read read) {
    out.clear();
    element = 0;
    for (auto* o : listElements(list)) ++element, out.push_back(read(o));
    element = 0;
}

void takeOptions(std::span<Tcl_Obj* const> words, std::size_t& i, std::size_t& element, Message& m) {
    bool all = false;
    auto isPart = [](std::string_view w) { return w == "-text" || w == "-floats" || w == "-ints" || w == "-any"; };
    for (; i < words.size(); ++i) {
        std::string_view w = view(words[i]);
        bool text = w == "-text", floats = w == "-floats", ints = w == "-ints", any = w == "-any";
        if (w == "--") {
            ++i;
            all = true;
            break;
        }
        if (!text && !floats && !ints && !any) break;
        if (i + 1 == words.size()) fail(kEnd, text ? "a text" : any ? "bytes" : "a list of numbers", w);
        Tcl_Obj* value = words[++i];
        if (text) {
            m.text.clear();
            appendUtf8(m.text, value);
        } else if (floats) {
            readList(value, m.floats, element, toDouble);
        } else if (ints) {
            readList(value, m.ints, element, toInteger);
        } else {
            m.any.clear();
            toBytes(value, m.any);
        }
    }
    for (; i < words.size(); ++i) {
        if (!all && isPart(view(words[i]))) fail(kPartLate, view(words[i]), m.words.front());
        m.words.push_back(toUtf8(words[i]));
    }
}

}  // namespace

void readParts(std::string_view object, std::span<Tcl_Obj* const> words, Message& m) {
    std::size_t i = 0;
    try {
        takeParts(words, i, m);
    } catch (const Error& e) {
        failIn(object, "EXEC", words, i, e);
    }
}

void readOptions(std::string_view object, std::span<Tcl_Obj* const> words, Message& m, std::string_view method) {
    std::size_t i = 0, element = 0;
    try {
        takeOptions(words, i, element, m);
    } catch (const Error& e) {
        failIn(object, method, words, i, e, element ? ", element " + std::to_string(element) : std::string());
    }
}

// ---- replies ----

Tcl_Obj* flatReply(const Constants& constants, const Message& m) {
    std::size_t n = 2 + (m.text.empty() ? 0 : 2) + (m.floats.empty() ? 0 : 2 + m.floats.size()) +
                    (m.ints.empty() ? 0 : 2 + m.ints.size()) + (m.any.empty() ? 0 : 2) + (m.trail.empty() ? 0 : 2);
    if (n == 2 && m.code == 0) return constants.ret0;
    constexpr std::size_t kOnStack = 64;
    Tcl_Obj* few[kOnStack];
    std::vector<Tcl_Obj*> many;
    Tcl_Obj** out = few;
    if (n > kOnStack) {
        many.resize(n);
        out = many.data();
    }
    Tcl_Size count = tclSize(n);
    Tcl_Obj** at = out;
    *at++ = constants.ret;
    *at++ = constants.integer(m.code);
    if (!m.text.empty()) {
        *at++ = constants.tmsg;
        *at++ = newText(m.text);
    }
    if (!m.floats.empty()) {
        *at++ = constants.fmsg;
        *at++ = constants.integer(std::int64_t(m.floats.size()));
        for (double x : m.floats) *at++ = Tcl_NewDoubleObj(x);
    }
    if (!m.ints.empty()) {
        *at++ = constants.imsg;
        *at++ = constants.integer(std::int64_t(m.ints.size()));
        for (auto x : m.ints) *at++ = constants.integer(x);
    }
    if (!m.any.empty()) {
        std::string base64;
        appendBase64(base64, m.any.data(), m.any.size());
        *at++ = constants.amsg;
        *at++ = Tcl_NewStringObj(base64.data(), tclSize(base64.size()));
    }
    if (!m.trail.empty()) {
        *at++ = constants.tdbx;
        *at++ = newText(trailToWord(m.trail));
    }
    return Tcl_NewListObj(count, out);
}

namespace {

template <class T, class Make> Tcl_Obj* newNumbers(const std::vector<T>& numbers, Make make) {
    Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
    for (T x : numbers) Tcl_ListObjAppendElement(nullptr, list, make(x));
    return list;
}

Tcl_Obj* newFloats(const Message& m) { return newNumbers(m.floats, Tcl_NewDoubleObj); }
Tcl_Obj* newInts(const Message& m) { return newNumbers(m.ints, [](std::int64_t n) { return Tcl_NewWideIntObj(n); }); }
Tcl_Obj* newBytes(const Message& m) { return Tcl_NewByteArrayObj(m.any.data(), tclSize(m.any.size())); }

void put(Tcl_Obj* dict, const char* key, Tcl_Obj* value) {
    Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value);
}

}  // namespace

Tcl_Obj* dictReply(const Constants& c, const Message& m) {
    if (m.code == 0 && m.text.empty() && m.floats.empty() && m.ints.empty() && m.any.empty() && m.trail.empty())
        return c.code0;
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto put = [&](Tcl_Obj* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, key, value); };
    if (!m.text.empty()) put(c.text, newText(m.text));
    if (!m.floats.empty()) put(c.floats, newFloats(m));
    if (!m.ints.empty()) put(c.ints, newInts(m));
    if (!m.any.empty()) put(c.any, newBytes(m));
    put(c.code, c.integer(m.code));
    if (!m.trail.empty()) put(c.trail, trailList(m.trail));
    return dict;
}

Tcl_Obj* errorCode(const Entry& entry) {
    Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
    for (auto& word : entry.code()) Tcl_ListObjAppendElement(nullptr, list, newText(word));
    return list;
}

Tcl_Obj* trailList(const Trail& trail) {
    Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
    if (trail.dropped() > 0) {
        Tcl_Obj* dict = Tcl_NewDictObj();
        put(dict, "severity", Tcl_NewStringObj("verbose", -1));
        put(dict, "code", Tcl_NewStringObj("SORMA TRAIL DROPPED", -1));
        put(dict, "text", newText(std::to_string(trail.dropped()) + " older messages were dropped"));
        for (auto key : {"so", "daemon", "file"}) put(dict, key, Tcl_NewObj());
        for (auto key : {"line", "time"}) put(dict, key, Tcl_NewWideIntObj(0));
        Tcl_ListObjAppendElement(nullptr, list, dict);
    }
    for (auto& e : trail.entries()) {
        Tcl_Obj* dict = Tcl_NewDictObj();
        put(dict, "severity", Tcl_NewStringObj(toText(e.severity), -1));
        put(dict, "code", errorCode(e));
        put(dict, "text", newText(e.text));
        put(dict, "so", newText(e.so));
        put(dict, "daemon", newText(e.daemon));
        put(dict, "file", newText(e.file));
        put(dict, "line", Tcl_NewWideIntObj(e.line));
        put(dict, "time", Tcl_NewWideIntObj(e.time));
        if (!e.request.empty()) put(dict, "request", newText(e.request));
        Tcl_ListObjAppendElement(nullptr, list, dict);
    }
    return list;
}

// ---- TclOO services ----

Tcl_Obj* messageDict(const Constants& c, const Message& m) {
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto put = [&](Tcl_Obj* key, bool empty, auto make) {
        Tcl_DictObjPut(nullptr, dict, key, empty ? static_cast<Tcl_Obj*>(c.empty) : make());
    };
    put(c.text, m.text.empty(), [&] { return newText(m.text); });
    put(c.floats, m.floats.empty(), [&] { return newFloats(m); });
    put(c.ints, m.ints.empty(), [&] { return newInts(m); });
    put(c.any, m.any.empty(), [&] { return newBytes(m); });
    put(c.words, m.words.empty(), [&] {
        Tcl_Obj* list = Tcl_NewListObj(0, nullptr);
        for (auto& w : m.words) Tcl_ListObjAppendElement(nullptr, list, newText(w));
        return list;
    });
    return dict;
}

Tcl_Obj* eventDict(const Constants& c, const Received& e) {
    Tcl_Obj* dict = Tcl_NewDictObj();
    auto put = [&](const char* key, Tcl_Obj* value) { Tcl_DictObjPut(nullptr, dict, Tcl_NewStringObj(key, -1), value); };
    put("object", newText(e.object));
    put("event", newText(e.name));
    put("number", Tcl_NewWideIntObj(Tcl_WideInt(e.number)));
    put("lost", Tcl_NewWideIntObj(e.lost));
    put("time", Tcl_NewWideIntObj(e.time));
    put("request", Tcl_NewWideIntObj(Tcl_WideInt(e.request)));
    Obj content(messageDict(c, e.message));
    Tcl_DictSearch search;
    Tcl_Obj *key, *value;
    int done;
    for (Tcl_DictObjFirst(nullptr, content, &search, &key, &value, &done); !done; Tcl_DictObjNext(&search, &key, &value, &done))
        Tcl_DictObjPut(nullptr, dict, key, value);
    return dict;
}

void readResult(Tcl_Obj* dict, const std::string& so, Message& m) {
    m.text.clear();
    m.floats.clear();
    m.ints.clear();
    m.any.clear();
    m.code = 0;
    Tcl_Size n;
    Tcl_Obj** pairs;
    if (Tcl_ListObjGetElements(nullptr, dict, &n, &pairs) != TCL_OK || n % 2 != 0)
        fail(kResult, so, "\"" + toUtf8(dict) + "\": must be a dict of text, floats, ints, any, and code");
    for (Tcl_Size i = 0; i < n; i += 2) {
        std::string_view key = view(pairs[i]);
        Tcl_Obj* value = pairs[i + 1];
        try {
            if (key == "text") {
                appendUtf8(m.text, value);
            } else if (key == "floats") {
                for (auto* o : listElements(value)) m.floats.push_back(toDouble(o));
            } else if (key == "ints") {
                for (auto* o : listElements(value)) m.ints.push_back(toInteger(o));
            } else if (key == "any") {
                toBytes(value, m.any);
            } else if (key == "code") {
                m.code = int(toInteger(value));
            } else if (key != "words" && key != "trail") {      // as they came in, or from a reply that is passed on
                fail(kResult, so, "the key \"" + toUtf8(pairs[i]) + "\": must be text, floats, ints, any, or code");
            }
        } catch (const Error& e) {
            if (e.is("SERVICE RESULT")) throw;
            fail(kResult, so, std::string(key) + ": " + e.what());
        }
    }
}

Tcl_Obj* newValue(const Value& value) {
    return std::visit([](const auto& v) -> Tcl_Obj* {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, bool>) return Tcl_NewWideIntObj(v);
        else if constexpr (std::is_same_v<T, double>) return Tcl_NewDoubleObj(v);
        else if constexpr (std::is_same_v<T, std::int64_t>) return Tcl_NewWideIntObj(v);
        else if constexpr (std::is_same_v<T, std::string>) return newText(v);
        else return newNumbers(v, Tcl_NewDoubleObj);
    }, value);
}

}  // namespace sorma
