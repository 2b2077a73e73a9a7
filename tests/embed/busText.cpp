// busText.cpp -- checks of the bus's text modules without Tcl: words, requests, trails, names, the dictionary.
//
//     busText            runs all groups
//     busText GROUP      runs one; tests/requestText.test and its neighbours have one test for each
//
// Each failed check is one line; the last line is "N passed, N failed". Exit code 0 when none failed.
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <limits>
#include <new>
#include <random>
#include <sstream>

#include "bus/catalogue.h"
#include "bus/call.h"
#include "bus/client.h"
#include "bus/dictionary.h"
#include "bus/glob.h"
#include "bus/loop.h"
#include "bus/message.h"
#include "bus/name.h"
#include "bus/requestText.h"

using namespace sorma;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// ---- counting of allocations, for what promises to make none ----

static std::atomic<std::size_t> allocations{0};
[[gnu::noinline]] void* operator new(std::size_t size) {     // inlined, gcc takes them for a mismatch
    allocations.fetch_add(1, std::memory_order_relaxed);
    if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
    throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

int passed = 0, failed = 0;

void note(bool good, int line, const std::string& what) {
    ++(good ? passed : failed);
    if (!good) std::printf("line %d: %s\n", line, what.c_str());
}

std::string text(const std::string& s) { return s; }
std::string text(std::string_view s) { return std::string(s); }
std::string text(const char* s) { return s; }
template <class T> std::string text(const T& number) { return std::to_string(number); }

template <class A, class B> void compare(const A& got, const B& wanted, int line, const char* what) {
    std::string g = text(got), w = text(wanted);
    note(g == w, line, std::string(what) + "\n    got    " + g + "\n    wanted " + w);
}

template <class F> void fails(F body, const std::string& code, const std::string& message, int line, const char* what) {
    try {
        body();
        note(false, line, std::string(what) + " did not fail");
    } catch (const Error& e) {
        compare(joinWords(e.code()).substr(0, code.size()), code, line, what);
        compare(e.what(), message, line, what);
    }
}

#define CHECK(condition) note((condition), __LINE__, #condition)
#define EQUAL(got, wanted) compare((got), (wanted), __LINE__, #got)
#define FAILS(expression, code, message) fails([&] { (void)(expression); }, code, message, __LINE__, #expression)

// A line for each word, in brackets: quotes would hide differences.
std::string brackets(const std::vector<std::string>& words) {
    std::string out;
    for (auto& w : words) out += '[' + w + ']';
    return out;
}

std::string words(std::string_view t) { return brackets(splitWords(t)); }

std::string quoted(std::string_view word, bool keywords = false) {
    std::string out;
    appendWord(out, word, keywords);
    return out;
}

std::string request(std::string_view t) {      // parsed and written again
    std::string name, out;
    Method method;
    Message m;
    parseRequest(t, name, method, m);
    appendRequest(out, name, method, m);
    return out;
}

std::string reply(std::string_view t) {
    std::string name, out;
    Message m;
    parseReply(t, name, m);
    appendReply(out, name, m);
    return out;
}

// ---- requestText ----

void testWords() {
    EQUAL(words(""), "");
    EQUAL(words(" \t\n\v\f\r "), "");
    EQUAL(words("a b\tc\nd"), "[a][b][c][d]");
    EQUAL(words("  a  "), "[a]");
    // Bare words are literal whatever they hold behind the first character.
    EQUAL(words("a\\n b\"c don't x{ }y # $z [w]"), "[a\\n][b\"c][don't][x{][}y][#][$z][[w]]");
    EQUAL(words("\"a b\" 'c d' {e f}"), "[a b][c d][e f]");
    EQUAL(words("\"\" '' {}"), "[][][]");
    EQUAL(words("\"a\\\"b\\\\c\\nd\\te\\rf\\x41\\x7e\""), "[a\"b\\c\nd\te\rfA~]");
    EQUAL(words("\"\\xe9\\xFF\""), "[\xc3\xa9\xc3\xbf]");
    EQUAL(words("\"\\xaf\\xAF\""), "[\xc2\xaf\xc2\xaf]");
    EQUAL(words("\"\\$\\[\\ \\'\\{\""), "[$[ '{]");
    EQUAL(words("'a\\'"), "[a\\]");
    EQUAL(words("{a {b} \\n c}"), "[a {b} \\n c]");
    EQUAL(splitWords("\"\\x00\"")[0].size(), 1u);

    FAILS(splitWords("a \"b"), "REQUEST SYNTAX", "word 2: expected a closing \", got the end of the text");
    FAILS(splitWords("a \"b\\"), "REQUEST SYNTAX", "word 2: expected a closing \", got the end of the text");
    FAILS(splitWords("a \"b\\\""), "REQUEST SYNTAX", "word 2: expected a closing \", got the end of the text");
    FAILS(splitWords("'b"), "REQUEST SYNTAX", "word 1: expected a closing ', got the end of the text");
    FAILS(splitWords("a b {c {d}"), "REQUEST SYNTAX", "word 3: expected a closing }, got the end of the text");
    FAILS(splitWords("\"a\"b c"), "REQUEST SYNTAX", "word 1: expected white space after the closing \", got \"b\"");
    FAILS(splitWords("{a}}"), "REQUEST SYNTAX", "word 1: expected white space after the closing }, got \"}\"");
    FAILS(splitWords("\"C:\\dir\""), "REQUEST SYNTAX", "word 1: expected \\n, \\t, \\r, \\xHH or punctuation after a backslash, got \"\\d\"");
    FAILS(splitWords("\"\\x4\""), "REQUEST SYNTAX", "word 1: expected two hexadecimal digits after \\x, got \"\\x4\"");
    FAILS(splitWords("\"\\x4g\""), "REQUEST SYNTAX", "word 1: expected two hexadecimal digits after \\x, got \"\\x4g\"");

    WordReader reader("a {b} 3 {4} 5x");
    std::string_view w;
    double number = 0;
    CHECK(!reader.nextNumber(number));
    CHECK(reader.next(w) && w == "a" && !reader.quoted() && reader.index() == 1);
    CHECK(reader.next(w) && w == "b" && reader.quoted() && reader.index() == 2);
    CHECK(reader.nextNumber(number) && number == 3 && reader.index() == 3 && !reader.quoted());
    CHECK(!reader.nextNumber(number) && reader.index() == 3);
    CHECK(reader.next(w) && w == "4");
    CHECK(!reader.nextNumber(number));
    EQUAL(reader.rest(), " 5x");
    CHECK(reader.next(w) && w == "5x" && !reader.next(w));
}

void testQuoting() {
    EQUAL(quoted("a"), "a");
    EQUAL(quoted("#a$b[c];\\"), "#a$b[c];\\");
    EQUAL(quoted(""), "{}");
    EQUAL(quoted("a b"), "{a b}");
    EQUAL(quoted("don't"), "{don't}");
    EQUAL(quoted("a{b}"), "{a{b}}");
    EQUAL(quoted("a}b{"), "\"a}b{\"");
    EQUAL(quoted("a \\b"), "\"a \\\\b\"");
    EQUAL(quoted("\"{"), "\"\\\"{\"");
    EQUAL(quoted(std::string_view("\n\t\r\0\x1f\x7f", 6)), "\"\\n\\t\\r\\x00\\x1f\\x7f\"");
    EQUAL(quoted("gr\xc3\xbc\xc3\x9f"), "gr\xc3\xbc\xc3\x9f");
    EQUAL(quoted("a\xff" "b"), "a\xef\xbf\xbd" "b");
    EQUAL(quoted("TMSG"), "TMSG");
    EQUAL(quoted("TMSG", true), "{TMSG}");
    EQUAL(quoted("TMSGS", true), "TMSGS");
    std::string out = "a ";
    appendWord(out, "b");
    out += '\n';
    appendWord(out, "c");
    appendQuoted(out, "d");
    EQUAL(out, "a b\nc {d}");
    EQUAL(joinWords({"a", "b c", ""}), "a {b c} {}");
    EQUAL(shown("a\nb"), "\"a\\x0ab\"");
    EQUAL(shown(std::string(59, 'a') + "\xc3\xa9 and more"), "\"" + std::string(59, 'a') + "...\"");
}

void testNumbers() {
    EQUAL(numberText(3), "3");
    EQUAL(numberText(0.1), "0.1");
    EQUAL(numberText(-0.0), "-0");
    EQUAL(numberText(1e22), "1e+22");
    EQUAL(numberText(std::nan("")), "nan");
    EQUAL(numberText(-std::nan("")), "nan");
    EQUAL(numberText(-kInfinity), "-inf");
    EQUAL(numberText(5e-324), "5e-324");
    double d = 7;
    for (const char* good : {"1", "-1", "+1", "1.", ".5", "1e3", "1E-3", "inf", "-inf", "nan", "Infinity"}) CHECK(parseNumber(good, d));
    d = 7;
    for (const char* bad : {"", "+", "-", "+-1", " 1", "1 ", "0x10", "1,5", "1e", "1e999", "nan(1)", "one", "--1", "1_000"})
        note(!parseNumber(bad, d), __LINE__, std::string("taken for a float: ") + bad);
    EQUAL(d, 7.0);
    std::int64_t i = 7;
    CHECK(parseNumber("-9223372036854775808", i) && i == INT64_MIN);
    CHECK(parseNumber("+9223372036854775807", i) && i == INT64_MAX);
    for (const char* bad : {"", "9223372036854775808", "1.0", "1e3", "0x1", "-", "nan"})
        note(!parseNumber(bad, i), __LINE__, std::string("taken for an int: ") + bad);
    EQUAL(i, INT64_MAX);

    std::mt19937_64 random(1996);
    for (int round = 0; round < 20000; ++round) {
        double value = std::bit_cast<double>(random()), back = 0;
        if (std::isnan(value)) continue;
        CHECK(parseNumber(numberText(value), back) && std::bit_cast<std::uint64_t>(back) == std::bit_cast<std::uint64_t>(value));
    }
}

void testUtf8() {
    CHECK(isUtf8(""));
    CHECK(isUtf8("plain ASCII, longer than eight bytes"));
    CHECK(isUtf8("\xc3\xa4\xe2\x82\xac\xf0\x9f\xa4\x96 mixed with ASCII \xc3\xa4"));
    for (const char* edge : {"\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xee\x80\x80", "\xef\xbf\xbf", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"})
        note(isUtf8(edge), __LINE__, "not taken for UTF-8: " + shown(edge));
    for (const char* bad : {"\xf1\x80" "a\x80", "\x80", "\xc3", "\xc0\x80", "\xc1\xbf", "\xe0\x80\x80", "\xe2\x82", "\xed\xa0\x80", "\xf0\x80\x80\x80",
                            "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xff", "\xf0\x9f\xa4"}) {
        for (int before = 0; before < 18; ++before)
            for (int after : {0, 1, 9}) {
                std::string t = std::string(before, 'a') + bad + std::string(after, 'b');
                if (isUtf8(t)) note(false, __LINE__, "taken for UTF-8: " + shown(t));
            }
        ++passed;
    }
    FAILS(request("nop EXEC \xff"), "REQUEST SYNTAX", "the text is not UTF-8: byte 10 is \\xff");
}

void testBase64() {
    auto to = [](std::string_view s) {
        std::string out;
        appendBase64(out, reinterpret_cast<const unsigned char*>(s.data()), s.size());
        return out;
    };
    EQUAL(to(""), "");
    EQUAL(to("f"), "Zg==");
    EQUAL(to("fo"), "Zm8=");
    EQUAL(to("foo"), "Zm9v");
    EQUAL(to("foobar"), "Zm9vYmFy");
    std::vector<unsigned char> out = {1};
    CHECK(parseBase64("Zm9vYg==", out));
    EQUAL(out.size(), 5u);
    for (const char* bad : {"Z", "Zg", "Zg=", "Zh==", "Zm9=", "Z===", "====", "Zg==Zg==", "Zm9v\n", "Zm 9", "Zm=v", "\xc3\xa4\xc3\xa4"})
        note(!parseBase64(bad, out), __LINE__, std::string("taken for base64: ") + bad);
    EQUAL(out.size(), 5u);
    std::mt19937 random(7);
    for (std::size_t n = 0; n < 300; ++n) {
        std::vector<unsigned char> data(n), back;
        for (auto& byte : data) byte = static_cast<unsigned char>(random());
        std::string t;
        appendBase64(t, data.data(), n);
        CHECK(parseBase64(t, back) && back == data);
    }
}

void testRequests() {
    std::string name;
    Method method{};
    Message m;
    parseRequest("carry.slow@robot EXEC FMSG 6 3 4 0 4 5 0 IMSG 1 -7 TMSG 'good morning' AMSG Zm9v -now {and here}", name, method, m);
    EQUAL(name, "carry.slow@robot");
    CHECK(method == Method::exec);
    CHECK((m.floats == std::vector<double>{3, 4, 0, 4, 5, 0}));
    CHECK((m.ints == std::vector<std::int64_t>{-7}));
    EQUAL(m.text, "good morning");
    EQUAL(std::string(m.any.begin(), m.any.end()), "foo");
    EQUAL(brackets(m.words), "[-now][and here]");
    parseRequest("foo.a CTRL -where TMSG FMSG 2", name, method, m);
    CHECK(method == Method::ctrl && m.floats.empty() && m.text.empty());
    EQUAL(brackets(m.words), "[-where][TMSG][FMSG][2]");
    parseRequest("{a name} DBX -version", name, method, m);
    EQUAL(name, "a name");
    CHECK(method == Method::dbx);

    // Canonical text is given back as it is.
    for (const char* same : {"nop EXEC", "nop EXEC TMSG {a b}", "nop EXEC TMSG {TMSG} FMSG 3 0.1 -0 1e+300 IMSG 2 1 2 AMSG Zg== word",
                             "nop EXEC FMSG 1 1 {2} 3", "nop EXEC IMSG 1 1 {inf} inf", "nop EXEC FMSG 3 nan inf -inf", "nop EXEC {FMSG} 2",
                             "nop EXEC 2 3", "nop CTRL", "nop CTRL -a TMSG {} \"\\n\"", "nop DBX -why -a", "{} EXEC", "nop EXEC AMSG {TMSG}",
                             "nop EXEC FMSG 1 1 AMSG Zg== 5"})
        EQUAL(request(same), same);
    EQUAL(request("  nop\n EXEC  FMSG 0 TMSG \"\" IMSG\t{2} +1 \"2\""), "nop EXEC IMSG 2 1 2");

    FAILS(request(""), "REQUEST SYNTAX", "word 1: expected the name of a service object, got the end of the text");
    FAILS(request("nop"), "REQUEST SYNTAX", "word 2: expected CTRL, DBX, or EXEC, got the end of the text");
    FAILS(request("nop RUN"), "REQUEST SYNTAX", "bad method \"RUN\": must be CTRL, DBX, or EXEC");
    FAILS(request("nop exec"), "REQUEST SYNTAX", "bad method \"exec\": must be CTRL, DBX, or EXEC");
    FAILS(request("a EXEC FMSG"), "REQUEST SYNTAX", "word 4: expected the number of floats after FMSG, got the end of the text");
    FAILS(request("a EXEC FMSG x"), "REQUEST SYNTAX", "word 4: expected the number of floats after FMSG, got \"x\"");
    FAILS(request("a EXEC FMSG -1"), "REQUEST SYNTAX", "word 4: expected the number of floats after FMSG, got -1");
    FAILS(request("a EXEC FMSG 2.0 1 2"), "REQUEST SYNTAX", "word 4: expected the number of floats after FMSG, got \"2.0\"");
    FAILS(request("a EXEC FMSG 6 1 2 x"), "REQUEST SYNTAX", "word 7: expected the 3rd of 6 floats, got \"x\"");
    FAILS(request("a EXEC FMSG 6 1 2"), "REQUEST SYNTAX", "word 7: expected the 3rd of 6 floats, got the end of the text");
    EQUAL(request("a EXEC FMSG {0}"), "a EXEC");
    FAILS(request("a EXEC FMSG 11 1 2 3 4 5 6 7 8 9 10 x"), "REQUEST SYNTAX", "word 15: expected the 11th of 11 floats, got \"x\"");
    FAILS(request("a EXEC IMSG 1 1 2"), "REQUEST SYNTAX",
          "word 6: expected a keyword, a word or the end after IMSG 1 and its int, got the further number 2");
    FAILS(request("a EXEC FMSG 1 1e999x"), "REQUEST SYNTAX", "word 5: expected the 1st of 1 float, got \"1e999x\"");
    FAILS(request("a EXEC FMSG 2 1 IMSG 1 1"), "REQUEST SYNTAX", "word 6: expected the 2nd of 2 floats, got \"IMSG\"");
    FAILS(request("a EXEC FMSG 2 1 2 3"), "REQUEST SYNTAX",
          "word 7: expected a keyword, a word or the end after FMSG 2 and its floats, got the further number 3");
    FAILS(request("a EXEC FMSG 1 1e999"), "REQUEST SYNTAX", "word 5: expected the 1st of 1 float, got \"1e999\", which is out of range");
    FAILS(request("a EXEC IMSG 1 1.5"), "REQUEST SYNTAX", "word 5: expected the 1st of 1 int, got \"1.5\"");
    FAILS(request("a EXEC IMSG 1 9223372036854775808"), "REQUEST SYNTAX",
          "word 5: expected the 1st of 1 int, got \"9223372036854775808\", which is out of range");
    FAILS(request("a EXEC FMSG 9000000000000000000 1"), "REQUEST SYNTAX",
          "word 6: expected the 2nd of 9000000000000000000 floats, got the end of the text");
    FAILS(request("a EXEC TMSG"), "REQUEST SYNTAX", "word 4: expected a text after TMSG, got the end of the text");
    FAILS(request("a EXEC TMSG FMSG 1 1"), "REQUEST SYNTAX",
          "word 4: expected a text after TMSG, got the keyword FMSG (as a word it is written {FMSG})");
    FAILS(request("a EXEC TMSG a TMSG b"), "REQUEST SYNTAX", "word 5: expected TMSG once at most, got a second one");
    FAILS(request("a EXEC TMSG {} TMSG {}"), "REQUEST SYNTAX", "word 5: expected TMSG once at most, got a second one");
    FAILS(request("a EXEC FMSG 0 IMSG 0 FMSG 0"), "REQUEST SYNTAX", "word 7: expected FMSG once at most, got a second one");
    FAILS(request("a EXEC AMSG Zg"), "REQUEST SYNTAX", "word 4: expected base64 after AMSG, got \"Zg\"");
    FAILS(request("a EXEC {%s%n {} {"), "REQUEST SYNTAX", "word 3: expected a closing }, got the end of the text");
    FAILS(request("a EXEC FMSG 1 {}{}%n"), "REQUEST SYNTAX", "word 5: expected white space after the closing }, got \"{}%n\"");
    // The name is known as soon as it is read, for the reply that tells of the error.
    try {
        parseRequest("carry RUN", name, method, m);
    } catch (const Error&) {
    }
    EQUAL(name, "carry");
}

void testReplies() {
    for (const char* same : {"nop RET 0", "nop RET -1 TMSG {a b} FMSG 1 0.5 IMSG 1 3 AMSG Zg==", "nop RET 2147483647", "nop RET -2147483648",
                             "nop RET 1 TDBX {warning {{CARRY DUSTY} 0.4} {dust on the lens} carry.slow robot carry.cpp 31 1700000000123456 {carry.slow EXEC}}",
                             "nop RET 1 TDBX {dropped 7}"})
        EQUAL(reply(same), same);
    FAILS(reply("nop RET"), "REQUEST SYNTAX", "word 3: expected the code after RET, got the end of the text");
    FAILS(reply("nop RET x"), "REQUEST SYNTAX", "word 3: expected the code after RET, an integer of 32 bits, got \"x\"");
    FAILS(reply("nop RET 2147483648"), "REQUEST SYNTAX", "word 3: expected the code after RET, an integer of 32 bits, got \"2147483648\"");
    FAILS(reply("nop EXEC"), "REQUEST SYNTAX", "word 2: expected RET, got \"EXEC\"");
    FAILS(reply("nop RET 0 word"), "REQUEST SYNTAX", "word 4: expected TMSG, FMSG, IMSG, AMSG, TDBX or the end, got \"word\"");
    FAILS(reply("nop RET 0 TDBX {error}"), "REQUEST SYNTAX",
          "word 5: bad trail after TDBX: word 2: expected the symbol and its details, got the end of the text");
    FAILS(reply("nop RET 0 TDBX {oops}"), "REQUEST SYNTAX",
          "word 5: bad trail after TDBX: word 1: expected verbose, warning or error, got \"oops\"");
    // A reply has no free words, whatever the message holds.
    Message m;
    m.words = {"nearestTo"};
    std::string out;
    appendReply(out, "shmem_r", m);
    EQUAL(out, "shmem_r RET 0");
}

// Random messages: what is nasty is more likely than chance would make it.
class Maker {
public:
    explicit Maker(unsigned seed) : random_(seed) {}
    std::size_t below(std::size_t n) { return random_() % n; }
    std::string word() {
        static const char* const kPieces[] = {"a", "b", " ", "\"", "'", "{", "}", "\\", "\n", "\t", "\r", "\x01", "\x7f", "#", "$", "[", "]",
                                              ";", "TMSG", "FMSG", "AMSG", "TDBX", "3", "-1.5", "nan", "\xc3\xa4", "\xe2\x82\xac", "\xf0\x9f\xa4\x96",
                                              "\\x41", "\\\n", "{a b}", "\"x y\"", "@", "%n%s", "{}"};
        std::string out;
        for (std::size_t n = below(5); n > 0; --n) {
            if (below(40) == 0) out += '\0';
            else out += kPieces[below(std::size(kPieces))];
        }
        return out;
    }
    double real() {
        switch (below(6)) {
            case 0: return std::numeric_limits<double>::quiet_NaN();
            case 1: return below(2) ? kInfinity : -kInfinity;
            case 2: return below(2) ? 0.0 : -0.0;
            case 3: return static_cast<double>(below(1000));
            default: break;
        }
        double d = std::bit_cast<double>(random_());
        return std::isnan(d) ? 1 : d;
    }
    std::int64_t integer() {
        switch (below(4)) {
            case 0: return INT64_MIN;
            case 1: return INT64_MAX;
            case 2: return static_cast<std::int64_t>(below(10));
            default: return static_cast<std::int64_t>(random_());
        }
    }
    Trail trail() {
        Trail t;
        for (std::size_t n = below(4); n > 0; --n) {
            Entry e;
            e.severity = static_cast<Severity>(below(3));
            e.symbol = below(2) ? "OPTION RANGE" : word();
            for (std::size_t k = below(3); k > 0; --k) e.details.push_back(word());
            e.text = word();
            e.so = word();
            e.daemon = word();
            e.file = word();
            e.line = static_cast<int>(integer());
            e.time = integer();
            e.request = below(2) ? word() : "a EXEC TMSG " + quoted(word());
            t.add(e);
        }
        if (below(5) == 0) t.setDropped(1 + below(100));
        return t;
    }
    Message message() {
        Message m;
        if (below(2)) m.text = word();
        for (std::size_t n = below(2) * below(100); n > 0; --n) m.floats.push_back(real());
        for (std::size_t n = below(2) * below(100); n > 0; --n) m.ints.push_back(integer());
        for (std::size_t n = below(2) * below(10); n > 0; --n) m.any.push_back(static_cast<unsigned char>(random_()));
        for (std::size_t n = below(2) * below(5); n > 0; --n) m.words.push_back(word());
        m.code = static_cast<int>(integer());
        m.trail = trail();
        return m;
    }

private:
    std::mt19937_64 random_;
};

bool sameBits(const Message& a, const Message& b) {
    if (a.floats.size() != b.floats.size()) return false;
    for (std::size_t i = 0; i < a.floats.size(); ++i) {
        double x = a.floats[i], y = b.floats[i];
        if (std::isnan(x) != std::isnan(y)) return false;
        if (!std::isnan(x) && std::bit_cast<std::uint64_t>(x) != std::bit_cast<std::uint64_t>(y)) return false;
    }
    return a.text == b.text && a.ints == b.ints && a.any == b.any && a.words == b.words && a.code == b.code && a.trail == b.trail;
}

void testProperties() {
    Maker make(19960701);
    std::string name, out, again;
    Message back;
    for (int round = 0; round < 20000; ++round) {
        std::string word = make.word();
        for (bool keywords : {false, true}) {
            std::string t = quoted(word, keywords);
            note(brackets({word}) == words(t), __LINE__, "a word changes: " + t);
        }
        Message m = make.message();
        std::string called = make.word();
        Method method = static_cast<Method>(make.below(3)), read{};
        Message sent = m;
        sent.code = 0;
        sent.trail.clear();
        if (method != Method::exec) {
            sent = {};
            sent.words = m.words;
        }
        out.clear();
        appendRequest(out, called, method, m);
        try {
            parseRequest(out, name, read, back);
            note(name == called && read == method && sameBits(sent, back), __LINE__, "a request changes: " + out);
            again.clear();
            appendRequest(again, name, read, back);
            note(again == out, __LINE__, "a canonical request changes: " + out);
        } catch (const Error& e) {
            note(false, __LINE__, out + "\n    " + e.what());
        }
        sent = m;
        sent.words.clear();
        out.clear();
        appendReply(out, called, m);
        try {
            parseReply(out, name, back);
            note(name == called && sameBits(sent, back), __LINE__, "a reply changes: " + out);
            again.clear();
            appendReply(again, name, back);
            note(again == out, __LINE__, "a canonical reply changes: " + out);
        } catch (const Error& e) {
            note(false, __LINE__, out + "\n    " + e.what());
        }
        note(out.find('\n') == out.npos, __LINE__, "a newline in a reply: " + out);
    }
}

void testMemory() {
    std::string name, out, in = "a.name.that.is.longer.than.a.short.string EXEC TMSG {a text that is longer than fifteen} FMSG 10";
    for (int i = 0; i < 10; ++i) in += " 0.12345678901234567";
    in += " IMSG 3 1 2 3 AMSG Zm9vYmFy";
    Method method;
    Message m;
    auto round = [&] {
        parseRequest(in, name, method, m);
        out.clear();
        appendReply(out, name, m);
    };
    round();
    std::size_t before = allocations;
    for (int i = 0; i < 100; ++i) round();
    EQUAL(allocations - before, 0u);
    // A count that the text cannot hold reserves nothing.
    m = {};
    try {
        parseRequest("a EXEC FMSG 1000000000 1 2 3 4 x", name, method, m);
    } catch (const Error&) {
    }
    CHECK(m.floats.capacity() < 100);
}

// ---- trail and catalogue ----

Entry entry(Severity severity, const std::string& t) {
    Entry e;
    e.severity = severity;
    e.symbol = "TEST ENTRY";
    e.text = t;
    return e;
}

std::string texts(const Trail& trail) {
    std::string out;
    for (auto& e : trail.entries()) out += e.text + ' ';
    return out + std::to_string(trail.dropped());
}

void testTrail() {
    Severity s{};
    CHECK(fromText("warning", s) && s == Severity::warning);
    CHECK(!fromText("Warning", s) && s == Severity::warning);
    EQUAL(toText(Severity::verbose), "verbose");

    Trail t;
    CHECK(t.empty() && !t.cause());
    EQUAL(t.toText(), "");
    t.add(entry(Severity::verbose, "v1"));
    CHECK(t.cause() && t.cause()->text == "v1");
    t.add(entry(Severity::error, "e1"));
    t.add(entry(Severity::error, "e2"));
    EQUAL(t.cause()->text, "e1");

    Trail::setLimit(4);
    t.add(entry(Severity::warning, "w1"));
    t.add(entry(Severity::verbose, "v2"));
    EQUAL(texts(t), "e1 e2 w1 v2 1");
    t.add(entry(Severity::warning, "w2"));
    EQUAL(texts(t), "e1 e2 w1 w2 2");
    t.add(entry(Severity::verbose, "v3"));              // the oldest verbose entry is this one itself
    EQUAL(texts(t), "e1 e2 w1 w2 3");
    t.add(entry(Severity::error, "e3"));
    t.add(entry(Severity::error, "e4"));
    EQUAL(texts(t), "e1 e2 e3 e4 5");
    t.add(entry(Severity::error, "e5"));                // the cause stays
    EQUAL(texts(t), "e1 e3 e4 e5 6");
    Trail other;
    other.setDropped(10);
    other.add(entry(Severity::warning, "w3"));
    other.append(t);
    EQUAL(texts(other), "e1 e3 e4 e5 17");
    Trail::setLimit(1);
    t.add(entry(Severity::error, "e6"));
    EQUAL(texts(t), "e1 10");
    Trail::setLimit(0);
    EQUAL(Trail::limit(), 1u);
    Trail::setLimit(Trail::kDefaultLimit);
    other.append(other);
    EQUAL(other.entries().size(), 8u);

    setenv("TZ", "UTC", 1);
    Entry e = entry(Severity::error, "carry.slow: -transferSpeed 7 is\noutside");
    e.symbol = "OPTION RANGE";
    e.so = "carry.slow";
    e.daemon = "robot";
    e.file = "carry.cpp";
    e.line = 31;
    e.time = std::int64_t{10 * 3600 + 31 * 60 + 2} * 1'000'000 + 123'456;
    Trail people;
    people.add(e);
    EQUAL(people.toText(), "error SORMA OPTION RANGE: carry.slow: -transferSpeed 7 is outside  (carry.slow@robot, carry.cpp:31, 10:31:02.123)");
    people.setDropped(3);
    e.so = e.daemon = e.file = "";
    e.severity = Severity::warning;
    e.time = -1;
    people.add(e);
    CHECK(people.toText().starts_with("3 older messages were dropped\nerror SORMA"));
    CHECK(people.toText().ends_with("\nwarning SORMA OPTION RANGE: carry.slow: -transferSpeed 7 is outside  (23:59:59.999)"));

    // A peer's trail of any length costs one pass.
    std::string line = "verbose {{A B}} t so d f 1 2 {}\n", big;
    for (int i = 0; i < 100'000; ++i) big += line;
    Trail read = trailFromWord(big);
    EQUAL(read.entries().size(), Trail::kDefaultLimit);
    EQUAL(read.dropped(), 100'000 - Trail::kDefaultLimit);
}

const Prototype kRange{Severity::error, "TEST RANGE", 2, "{}: {} {} is outside {} .. {} {}"};
const Prototype kNumbers{Severity::error, "TEST NUMBERS", 0, "{:.3f}, {:03}, {}, {}, {}"};
const Prototype kBroken{Severity::warning, "TEST BROKEN", 1, "{} {} {"};

void testCatalogue() {
    try {
        fail(kRange, "carry", std::string("-speed"), 7, 0.01, 1.5, std::string_view("m/s"));
    } catch (const Error& e) {
        EQUAL(e.what(), "carry: -speed 7 is outside 0.01 .. 1.5 m/s");
        EQUAL(brackets(e.code()), "[TEST][RANGE][carry][-speed]");
        CHECK(e.is("TEST RANGE") && !e.is("TEST"));
        const Entry& entry = *e.trail.cause();
        EQUAL(entry.file, "busText.cpp");
        CHECK(entry.line > kRange.line);
        CHECK(std::abs(entry.time - wallNow()) < 60'000'000);
    }
    // What comes from outside is never a format.
    FAILS(fail(kRange, "{}", "{0}%n", "{", "}", "{:>999999999}", ""), "TEST RANGE", "{}: {0}%n { is outside } .. {:>999999999} ");
    Message m;
    m.warn(kBroken, "a", true);
    EQUAL(m.trail.entries()[0].text, "{} {} { a true");
    EQUAL(brackets(m.trail.entries()[0].details), "[a]");

    // Numbers may be formatted; without a format they are as people write them.
    FAILS(fail(kNumbers, 2.0 / 3, 7, 1000.0, 1e6, 1e300), "TEST NUMBERS", "0.667, 007, 1000, 1000000, 1e+300");
    // What was warned of before the result is made stays.
    m.text = "old";
    m.clear();
    EQUAL(m.trail.entries().size(), 1u);
    EQUAL(m.text, "");
    m.reset();
    CHECK(m.trail.empty());

    auto count = [](std::string_view symbol) {
        int n = 0;
        for (auto* p : catalogue()) n += p->symbol == symbol;
        return n;
    };
    EQUAL(count("TEST RANGE"), 1);
    {
        Prototype first{Severity::verbose, "TEST PASSING", 0, ""}, second{Severity::verbose, "TEST PASSING", 0, ""};
        EQUAL(count("TEST PASSING"), 2);
        EQUAL(first.file, "busText.cpp");
    }
    EQUAL(count("TEST PASSING"), 0);
    auto all = catalogue();
    bool sorted = true;
    for (std::size_t i = 1; i < all.size(); ++i) sorted = sorted && std::strcmp(all[i - 1]->symbol, all[i]->symbol) <= 0;
    CHECK(sorted);

    auto trailOf = [](auto thrown) {
        try {
            throw thrown;
        } catch (...) {
            return trailOfCurrentException("carry");
        }
    };
    EQUAL(trailOf(std::runtime_error("100% {}")).cause()->text, "carry: 100% {}");
    EQUAL(trailOf(std::runtime_error("x")).cause()->symbol, "SERVICE FAILED");
    EQUAL(trailOf(std::bad_alloc()).cause()->text, "carry: out of memory");
    EQUAL(trailOf(7).cause()->text, "carry: an exception of unknown type");
    Trail t = trailOf(Error(entry(Severity::error, "e")));
    EQUAL(t.cause()->so, "carry");
    EQUAL(trailOf(Error(Trail())).entries().size(), 0u);
    EQUAL(Error(Trail()).what(), "unknown error");
}

void testDeadline() {
    CHECK(Deadline().none() && !Deadline().passed() && Deadline::in(0).none());
    CHECK(Deadline::at(1).passed() && Deadline::at(1).left() == 0);
    Deadline soon = Deadline::in(1000), late = Deadline::in(100'000);
    EQUAL(soon.earlier(late).when(), soon.when());
    EQUAL(late.earlier(soon).when(), soon.when());
    EQUAL(Deadline().earlier(soon).when(), soon.when());
    EQUAL(soon.earlier(Deadline()).when(), soon.when());
    CHECK(CallContext::current() == nullptr && CallContext::currentDeadline().none());
    CHECK(&CallContext::currentCaller() == &Caller::self());
    Caller other{"joe", "lab", "tclsh", "unix", 77, {}};
    EQUAL(other.toText(), "joe@lab tclsh[77]");
    Caller far{"joe", "lab", "tclsh", "10.0.0.7:4711", 77, "10.0.0.7"};
    EQUAL(far.toText(), "10.0.0.7 (claims joe@lab tclsh[77])");
    EQUAL(Caller::self().process, static_cast<std::int64_t>(getpid()));
    CHECK(!Caller::self().user.empty() && !Caller::self().host.empty() && !Caller::self().program.empty());
    auto client = std::make_shared<Client>(other);
    const ClientPointer none;
    const std::string nobody, joe = "joe@lab";
    KeptCallPointer kept;
    {
        // A context keeps no copy of client and callers, so it takes no temporary ones.
        static_assert(std::is_constructible_v<CallContext, const ClientPointer&, Deadline, int, const std::string&>);
        static_assert(!std::is_constructible_v<CallContext, std::nullptr_t, Deadline, int, const std::string&>);
        static_assert(!std::is_constructible_v<CallContext, const ClientPointer&, Deadline, int, const char*>);
        CallContext outer(client, soon, 7, nobody);
        {
            // A request that comes in meanwhile inherits nothing, and bills nothing.
            CallContext inner(none, late, 8, joe);
            EQUAL(inner.deadline.when(), late.when());
            inner.subTime = 5;
            CHECK(CallContext::current() == &inner);
            EQUAL(CallContext::currentCallers(), Caller::self().toText() + " for joe@lab");
        }
        EQUAL(outer.subTime, 0u);
        CHECK(&CallContext::currentCaller() == &client->caller);
        EQUAL(CallContext::currentDeadline().when(), soon.when());
        kept = CallContext::keep();
        CHECK(kept == CallContext::keep());
        {
            CallContext::Fresh fresh;           // an event loop
            CHECK(CallContext::current() == nullptr && CallContext::currentDeadline().none() && !CallContext::keep());
        }
    }
    CHECK(CallContext::current() == nullptr);
    {
        CallContext again(kept);                // work that waited
        EQUAL(CallContext::currentRequest(), 7u);
        CHECK(CallContext::currentClient() == client && !CallContext::currentCancelled());
        kept->cancel();
        CHECK(CallContext::currentCancelled());
    }
    {
        CallContext fresh{KeptCallPointer()};
        CHECK(CallContext::current() == nullptr);
    }
    // Work in a mailbox has the context that was kept for it, or none; what one item throws loses no other.
    Mailbox box;
    int done = 0;
    box.post([&] { done += CallContext::current() == nullptr; });
    box.post(kept, [&] { done += CallContext::currentRequest() == 7 ? 10 : 0; });
    box.post([&] { throw std::runtime_error("no"); });
    box.post([&] { done += 100; });
    bool thrown = false;
    try {
        box.run();
    } catch (const std::runtime_error&) {
        thrown = true;
    }
    CHECK(thrown);
    box.run();
    EQUAL(done, 111);
    // Who waits within an item sees what comes after it.
    box.post([&] { box.run(); done += 1000; });
    box.post([&] { done *= 2; });
    box.run();
    EQUAL(done, 1222);
    CHECK(CallContext::current() == nullptr);
}

// ---- names and addresses ----

void testNames() {
    Name n = Name::parse("carry.slow@robot");
    EQUAL(n.service, "carry.slow");
    EQUAL(n.className, "carry");
    EQUAL(n.flavor, "slow");
    EQUAL(n.where, "robot");
    CHECK(!n.local() && !n.byDefault);
    n = Name::parse("CARRY.Slow");
    EQUAL(n.service, "carry.Slow");
    EQUAL(n.className, "carry");
    CHECK(n.byDefault && !n.local());
    EQUAL(n.toText(), "CARRY.Slow");
    CHECK(Name::parse("carry").local());
    for (const char* good : {"a", "z", "Z", "a_1", "carry.slow", "carry.a.b", "carry.%*!?#'<>|=+-~^&(),/:", "carry.gr\xc3\xbcn", "A", "carry@a", "carry@localhost:7014",
                             "carry.x@host:0x14", "carry@/run/user/1000/robot.sock", "carry@[::1]:7014", "carry@[fe80::1%eth0]:0x1f", "carry@self"}) {
        EQUAL(Name::parse(good).toText(), good);
        CHECK(Name::isName(good));
    }
    EQUAL(Name::parse("findBall.Main@Robot").toText(), "findball.Main@Robot");
    auto bad = [&](std::string_view name, const std::string& why, int line) {
        fails([&] { Name::parse(name); }, "NAME SYNTAX", "bad name " + shown(name) + ": " + why, line, "Name::parse");
        note(!Name::isName(name), line, "isName");
    };
    bad("", "at character 1, the class is missing", __LINE__);
    bad(".a", "at character 1, \".\", must be a letter: a name begins with its class", __LINE__);
    bad("@robot", "at character 1, \"@\", must be a letter: a name begins with its class", __LINE__);
    bad("1a", "at character 1, \"1\", must be a letter: a name begins with its class", __LINE__);
    bad("_a", "at character 1, \"_\", must be a letter: a name begins with its class", __LINE__);
    bad("car-ry", "at character 4, \"-\", must not be in a class (letters, digits, _)", __LINE__);
    bad("Carry", "at character 2, \"a\", mixes cases: a class begins in lower case (served here or behind @) or is all upper case (at its default location)", __LINE__);
    bad("carry.", "at character 7, the flavor is missing after the dot", __LINE__);
    bad("carry..slow", "at character 7, a part of the flavor between dots is empty", __LINE__);
    bad("carry.slow.", "at character 11, a part of the flavor between dots is empty", __LINE__);
    bad("carry.a..b@robot", "at character 9, a part of the flavor between dots is empty", __LINE__);
    bad("carry.@a", "at character 7, the flavor is missing after the dot", __LINE__);
    bad("carry.gr\xc3\xbc$", "at character 10, \"$\", must not be in a flavor (it is special to Tcl)", __LINE__);
    for (char c : std::string("[]{}$\"\\;"))
        bad(std::string("carry.a") + c, "at character 8, " + shown(std::string(1, c)) + ", must not be in a flavor (it is special to Tcl)", __LINE__);
    bad("carry.a b", "at character 8, \" \", must not be in a flavor (white space and control characters)", __LINE__);
    bad("carry.a\n", "at character 8, \"\\x0a\", must not be in a flavor (white space and control characters)", __LINE__);
    bad(std::string_view("carry.\0", 7), "at character 7, \"\\x00\", must not be in a flavor (white space and control characters)", __LINE__);
    bad("gr\xc3\xbcn", "at character 3, \"\xc3\xbc\", must not be in a class (letters, digits, _)", __LINE__);
    bad("CARRY@robot", "at character 6, \"@\", must not follow a class in upper case, which is served at its default location", __LINE__);
    bad("carry@", "at character 7, an address is missing: HOST:PORT, HOST:0xPROGRAM, /PATH or an alias", __LINE__);
    bad("carry.\xff", "at character 7, the flavor is not UTF-8", __LINE__);
    bad("carry.a@\xff", "at character 9, " + shown("\xff") + ", must not be in an alias (letters, digits, _ - .)", __LINE__);
    bad("carry@a@b", "at character 8, \"@\", must not be in an alias (letters, digits, _ - .)", __LINE__);
    bad("carry@host:99999", "at character 12, the port must be 1 to 65535", __LINE__);
}

// One ? stands for one character, and each byte that belongs to none is one.
void testPatterns() {
    auto characters = [](const std::string& text) {
        for (std::size_t n = 0; n <= text.size(); ++n)
            if (globMatch(std::string(n, '?'), text)) return int(n);
        return -1;
    };
    for (const char* one : {"\x7f", "\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xef\xbf\xbf", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"})
        note(characters(one) == 1, __LINE__, "not one character: " + shown(one));
    for (const char* bytes : {"\x80", "\xc3", "\xc3" "a", "\xc0\x80", "\xe2\x82", "\xe2" "a\x82", "\xe0\x80\x80", "\xbf\xbf\xbf", "\xf0\x80\x80\x80",
                              "\xf4\x90\x80\x80", "\x81\x80\x80\x80", "\xf8\x90\x80\x80"})
        note(characters(bytes) == int(std::strlen(bytes)), __LINE__, "not as many characters as bytes: " + shown(bytes));
    CHECK(globMatch("\xff", "\xff") && !globMatch("\x80", "\xc2\x80"));
    CHECK(!globMatch("\xc3\xa4", "\xc2\xa4") && !globMatch("\xc3\xa4", "\xc3\xa5"));
    // A byte that belongs to none is no character either, in whatever order they are counted.
    CHECK(!globMatch("\xf4\x8f\xbe\x80", "\x80") && !globMatch("\x80", "\xf4\x8f\xbe\x80"));
    // Brackets that end with a range to ] reach to the next ] only for what is in the range, and take the second * with them.
    CHECK(globMatch("*[ba-]*]", "b^") && globMatch("*[ba-]*]", "bb]") && !globMatch("*[ba-]*]", "bb"));
}

void testAddresses() {
    auto parsed = [](std::string_view t) {
        Address a = Address::parse(t);
        static const char* const kKinds[] = {"self", "tcp", "program", "path", "alias"};
        return std::string(kKinds[static_cast<int>(a.kind)]) + ' ' + a.host + ' ' + std::to_string(a.number) + ' ' + a.toText();
    };
    EQUAL(parsed("self"), "self  0 self");
    EQUAL(parsed("lab-1.uni.de:7014"), "tcp lab-1.uni.de 7014 lab-1.uni.de:7014");
    EQUAL(parsed("127.0.0.1:00080"), "tcp 127.0.0.1 80 127.0.0.1:80");
    EQUAL(parsed("h:65535"), "tcp h 65535 h:65535");
    EQUAL(parsed("h:0x1FFFFFFF"), "program h 536870911 h:0x1fffffff");
    EQUAL(parsed("h:0x0"), "program h 0 h:0x0");
    EQUAL(parsed("[::1]:7014"), "tcp ::1 7014 [::1]:7014");
    EQUAL(parsed("[::ffff:10.0.0.1]:0x14"), "program ::ffff:10.0.0.1 20 [::ffff:10.0.0.1]:0x14");
    EQUAL(parsed("/a:b@c.sock"), "path /a:b@c.sock 0 /a:b@c.sock");
    EQUAL(parsed("robot_2.arm-left"), "alias robot_2.arm-left 0 robot_2.arm-left");
    FAILS(Address::parse(":7014"), "NAME SYNTAX :7014", "bad address \":7014\": at character 1, the host before the colon is missing");
    FAILS(Address::parse("h:"), "NAME SYNTAX", "bad address \"h:\": at character 3, a port (1 to 65535) or a program (0x0 to 0x1fffffff) is missing after the colon");
    FAILS(Address::parse("h:0"), "NAME SYNTAX", "bad address \"h:0\": at character 3, the port must be 1 to 65535");
    FAILS(Address::parse("h:99999999999999"), "NAME SYNTAX", "bad address \"h:99999999999999\": at character 3, the port must be 1 to 65535");
    FAILS(Address::parse("h:70x"), "NAME SYNTAX", "bad address \"h:70x\": at character 5, \"x\", must be a digit of a port");
    FAILS(Address::parse("h:0x"), "NAME SYNTAX", "bad address \"h:0x\": at character 5, the hexadecimal digits of a program are missing after 0x");
    FAILS(Address::parse("h:0x1g"), "NAME SYNTAX", "bad address \"h:0x1g\": at character 6, \"g\", must be a hexadecimal digit of a program");
    FAILS(Address::parse("h:0x20000000"), "NAME SYNTAX", "bad address \"h:0x20000000\": at character 5, the program must be less than 0x20000000");
    FAILS(Address::parse("::1:7014"), "NAME SYNTAX", "bad address \"::1:7014\": at character 1, the host before the colon is missing");
    FAILS(Address::parse("fe80::1:7014"), "NAME SYNTAX", "bad address \"fe80::1:7014\": at character 1, an IPv6 host is written in brackets: [::1]:7014");
    FAILS(Address::parse("[::1"), "NAME SYNTAX", "bad address \"[::1\": at character 5, the closing bracket of an IPv6 host is missing");
    FAILS(Address::parse("[::1]"), "NAME SYNTAX", "bad address \"[::1]\": at character 6, a colon and the port are missing after the IPv6 host");
    CHECK(Name::isName("carry@[A::F]:1"));
    FAILS(Address::parse("[::1]7014"), "NAME SYNTAX", "bad address \"[::1]7014\": at character 6, a colon and the port are missing after the IPv6 host");
    FAILS(Address::parse("[::g]:1"), "NAME SYNTAX", "bad address \"[::g]:1\": at character 4, \"g\", must not be in an IPv6 host");
    FAILS(Address::parse("[abc]:1"), "NAME SYNTAX", "bad address \"[abc]:1\": at character 2, brackets are for IPv6 hosts, which have colons");
    FAILS(Address::parse("h_ost$:1"), "NAME SYNTAX", "bad address \"h_ost$:1\": at character 6, \"$\", must not be in a host (letters, digits, _ - .)");
    FAILS(Address::parse("/a b"), "NAME SYNTAX", "bad address \"/a b\": at character 3, \" \", must not be in the path of a socket");
}

void testResolve() {
    Dictionary d;
    d.loadText("@robot localhost:7014\n@arm @robot\n@left arm\n@here self\n@a @b\n@b c\n@c @a\n@me @me\n@empty\n@bad host:0\n"
               "@late h:1 -wait\n@later @late\nCARRY @left\nNOP /tmp/n.sock\nECHO self\nFOO unknown\nBAR @a\n@sub -SUBST @robot\n", "t.dict");
    auto at = [&](const char* name) { return resolve(Name::parse(name), d).toText(); };
    EQUAL(at("carry"), "self");
    EQUAL(at("carry@robot"), "localhost:7014");
    EQUAL(at("carry@left"), "localhost:7014");
    EQUAL(at("carry@sub"), "localhost:7014");
    EQUAL(at("carry@here"), "self");
    EQUAL(at("carry@self"), "self");
    EQUAL(at("carry@h:1"), "h:1");
    EQUAL(at("CARRY.slow"), "localhost:7014");
    EQUAL(at("NOP"), "/tmp/n.sock");
    auto waits = [&](const char* name) { return resolve(Name::parse(name), d).wait; };
    CHECK(waits("x@late") && waits("x@later") && !waits("x@robot") && !waits("x@left"));
    EQUAL(at("ECHO"), "self");
    CHECK(resolve(Name::parse("carry@nowhere"), d).kind == Address::Kind::alias);
    EQUAL(at("FOO"), "unknown");
    // What of the dictionary belongs to a name: where it is, and its recipe.
    auto entries = [](const char* name) { return Name::parse(name).location() + " | " + Name::parse(name).recipeKey(); };
    EQUAL(entries("carry.slow"), " | carry.slow");
    EQUAL(entries("carry.slow@robot"), "@robot | carry.slow@robot");
    EQUAL(entries("CARRY.slow"), "CARRY | CARRY.slow");
    EQUAL(entries("CARRY"), "CARRY | ");
    CHECK(Name::isElsewhere("carry@robot") && Name::isElsewhere("CARRY.slow") && !Name::isElsewhere("carry.Slow") && !Name::isElsewhere(""));
    CHECK(Name::isLocation("@robot") && Name::isLocation("CARRY") && !Name::isLocation("CARRY.slow") && !Name::isLocation("carry@robot"));
    // Which entry decides, when the connection is made anew.
    auto rule = [&](const char* name) {
        std::string out;
        resolve(Name::parse(name), d, &out);
        return out;
    };
    EQUAL(rule("carry@robot"), "@robot");
    EQUAL(rule("carry@left"), "@robot");
    EQUAL(rule("carry@h:1"), "@h:1");
    EQUAL(rule("NOP"), "NOP");
    EQUAL(rule("FOO"), "@unknown");
    EQUAL(rule("x@nowhere"), "@nowhere");
    CHECK(resolve(Name::parse("FOO"), d).kind == Address::Kind::alias);
    FAILS(at("VISION.left"), "ADDRESS UNRESOLVED VISION.left",
          "VISION.left: class VISION has no default location; give it one: dict CTRL -add VISION @DAEMON");
    FAILS(at("x@a"), "DICT LOOP x@a", "x@a: addresses in the dictionary lead in a circle: @a -> @b -> @c -> @a");
    FAILS(at("BAR"), "DICT LOOP BAR", "BAR: addresses in the dictionary lead in a circle: BAR -> @a -> @b -> @c -> @a");
    FAILS(at("x@me"), "DICT LOOP", "x@me: addresses in the dictionary lead in a circle: @me -> @me");
    FAILS(at("x@empty"), "ADDRESS UNRESOLVED x@empty",
          "x@empty: the dictionary's entry @empty holds no address; give it one: dict CTRL -add @empty HOST:PORT");
    FAILS(at("x@bad"), "ADDRESS UNRESOLVED", "x@bad: the dictionary's entry @bad: bad address \"host:0\": at character 6, the port must be 1 to 65535");
}

// ---- dictionary ----

std::string get(const Dictionary& d, std::string_view word) {
    auto* found = d.get(word);
    return found ? brackets(*found) : "none";
}

std::string expanded(const Dictionary& d, std::string_view word) {
    std::vector<std::string> out;
    for (auto& w : d.expand(word)) out.push_back(w.text);
    return brackets(out);
}

// A folder of this test alone, removed with it.
class Folder {
public:
    Folder() {
        char name[] = "/tmp/sorma-busText-XXXXXX";
        path_ = mkdtemp(name);
    }
    ~Folder() {
        std::string command = "rm -rf " + path_;
        if (std::system(command.c_str()) != 0) std::perror("rm");
    }
    std::string write(const std::string& name, std::string_view content) {
        std::ofstream(path_ + '/' + name, std::ios::binary) << content;
        return path_ + '/' + name;
    }
    std::string file(const std::string& name) { return path_ + '/' + name; }
    static std::string read(const std::string& file) {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

private:
    std::string path_;
};

void testDictionary() {
    Dictionary d;
    d.loadText("\xef\xbb\xbf# comment \"unbalanced\n"
               "carry   -transferSpeed 0.5 \\\n   -greeting 'good morning' # and so on\n"
               "\n  carry.slow\t-SUBST carry -transferSpeed 0.2\r\n"
               "@robot localhost:7014\n"
               "twice a\n"
               "odd a#b '#c' {#d} #e {\n"
               "empty\n"
               "# a comment \\\n goes on\n"
               "dos a\\\\\n"
               "twice b c", "t.dict");
    EQUAL(d.size(), 7u);
    EQUAL(get(d, "carry"), "[-transferSpeed][0.5][-greeting][good morning]");
    EQUAL(get(d, "carry.slow"), "[-SUBST][carry][-transferSpeed][0.2]");
    EQUAL(expanded(d, "carry.slow"), "[-transferSpeed][0.5][-greeting][good morning][-transferSpeed][0.2]");
    EQUAL(get(d, "twice"), "[b][c]");
    EQUAL(get(d, "odd"), "[a#b][#c][#d]");
    EQUAL(get(d, "empty"), "");
    EQUAL(get(d, "dos"), "[a\\\\]");
    EQUAL(get(d, "goes"), "none");
    CHECK(d.has("empty") && !d.has("Empty"));
    EQUAL(expanded(d, "nothing"), "");
    EQUAL(brackets(d.words("carry*")), "[carry][carry.slow]");
    EQUAL(brackets(d.words()), "[@robot][carry][carry.slow][dos][empty][odd][twice]");

    auto origins = d.expand("carry.slow");
    EQUAL(origins[1].origin.toText(), "t.dict:2 via carry");
    EQUAL(origins[5].origin.toText(), "t.dict:5");
    d.add("carry.fast", {"-SUBST carry.slow -x 'a b'"}, "joe@lab sormad[77]");
    origins = d.expand("carry.fast");
    EQUAL(expanded(d, "carry.fast"), "[-transferSpeed][0.5][-greeting][good morning][-transferSpeed][0.2][-x][a b]");
    EQUAL(origins[0].origin.toText(), "t.dict:2 via carry.slow -> carry");
    EQUAL(origins[6].origin.toText(), "added by joe@lab sormad[77]");
    d.add("a", {"-x", "a b"}, "");
    EQUAL(get(d, "a"), "[-x][a b]");
    d.add("a", {"single"}, "");
    EQUAL(get(d, "a"), "[single]");
    d.add("a", {}, "");
    EQUAL(get(d, "a"), "");
    CHECK(d.remove("a") && !d.remove("a"));

    // Refused, and nothing changes.
    FAILS(d.add("carry", {"-SUBST", "carry.fast"}, ""), "DICT LOOP carry",
          "dictionary entry carry: -SUBST leads in a loop: carry -> carry.fast -> carry.slow -> carry");
    EQUAL(get(d, "carry"), "[-transferSpeed][0.5][-greeting][good morning]");
    FAILS(d.add("self", {"-SUBST", "self"}, ""), "DICT LOOP self", "dictionary entry self: -SUBST leads in a loop: self -> self");
    FAILS(d.add("", {}, ""), "DICT SYNTAX", "dictionary entry \"\": the word is empty");
    FAILS(d.add("#a", {}, ""), "DICT SYNTAX #a", "dictionary entry \"#a\": the word begins with #, like a comment");
    FAILS(d.add("\xef\xbb\xbf" "a", {}, ""), "DICT SYNTAX", "dictionary entry \"\xef\xbb\xbf" "a\": the word begins with a byte order mark");
    FAILS(d.add("a b", {}, ""), "DICT SYNTAX {a b}", "dictionary entry \"a b\": the word holds white space");
    FAILS(d.add("a", {"-x", "-SUBST"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": -SUBST needs the word of an entry after it");
    FAILS(d.add("a", {"-x 'b"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": word 2: expected a closing ', got the end of the text");
    FAILS(d.add("a", {"\xff"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": \"\xef\xbf\xbd\" is not UTF-8");
    CHECK(!d.has("a") && !d.has("self"));

    FAILS(d.loadText("ok 1\nbad {a\n", "u.dict"), "DICT SYNTAX u.dict 2", "u.dict:2: word 2: expected a closing }, got the end of the text");
    FAILS(d.loadText("ok 1\n\nbad -SUBST\n", "u.dict"), "DICT SYNTAX u.dict 3", "u.dict:3: -SUBST needs the word of an entry after it");
    FAILS(d.loadText("'a b' c\n", "u.dict"), "DICT SYNTAX u.dict 1", "u.dict:1: the word holds white space");
    FAILS(d.loadText("'#a' c\n", "u.dict"), "DICT SYNTAX u.dict 1", "u.dict:1: the word begins with #, like a comment");
    FAILS(d.loadText("ok 1\nbad \xff\n", "u.dict"), "DICT SYNTAX u.dict 2", "u.dict:2: the line is not UTF-8");
    FAILS(d.loadText("ok 1\np -SUBST p\n", "u.dict"), "DICT LOOP p", "dictionary entry p: -SUBST leads in a loop: p -> p (u.dict:2)");
    CHECK(!d.has("ok") && !d.has("p"));
    FAILS(d.load("/nonexistent/x.dict", Permit::owner()), "DICT FILE /nonexistent/x.dict", "cannot read dictionary file \"/nonexistent/x.dict\": No such file or directory");
    FAILS(d.load("/tmp", Permit::owner()), "DICT FILE /tmp", "cannot read dictionary file \"/tmp\": Is a directory");
}

void testLoops() {
    auto loop = [](std::string_view t, const std::string& word, const std::string& message, int line) {
        Dictionary d;
        fails([&] { d.loadText(t, "l.dict"); }, "DICT LOOP " + word, message, line, "loop");
        note(d.size() == 0, line, "nothing changes");
    };
    loop("a x -SUBST a\n", "a", "dictionary entry a: -SUBST leads in a loop: a -> a (l.dict:1)", __LINE__);
    Dictionary across;
    across.loadText("a -SUBST b\nc 1\n", "1.dict");
    FAILS(across.loadText("b -SUBST a\n", "2.dict"), "DICT LOOP b", "dictionary entry b: -SUBST leads in a loop: b -> a -> b (2.dict:1)");
    CHECK(!across.has("b"));
    across.loadText("b -SUBST c -SUBST c\n", "2.dict");     // twice is no loop
    EQUAL(expanded(across, "a"), "[1][1]");

    // Entries that double at each step are bounded, and so is depth; neither is an error to load.
    Dictionary bomb;
    std::string t = "x0 word\n", chain = "y0 word\n";
    for (int i = 1; i <= 60; ++i) t += "x" + std::to_string(i) + " -SUBST x" + std::to_string(i - 1) + " -SUBST x" + std::to_string(i - 1) + "\n";
    for (int i = 1; i <= 20000; ++i) chain += "y" + std::to_string(i) + " -SUBST y" + std::to_string(i - 1) + "\n";
    bomb.loadText(t + chain, "b.dict");
    FAILS(bomb.expand("x60"), "DICT SYNTAX x60", "dictionary entry x60: its expansion exceeds 10000 words");
    FAILS(bomb.expand("y20000"), "DICT SYNTAX y20000", "dictionary entry y20000: its expansion exceeds 200 levels of -SUBST");
    EQUAL(expanded(bomb, "y200"), "[word]");
    FAILS(bomb.add("y0", {"-SUBST", "y3"}, ""), "DICT LOOP", "dictionary entry y0: -SUBST leads in a loop: y0 -> y3 -> y2 -> y1 -> y0");
}

void testSave() {
    Folder folder;
    const std::string original =
        "# robots\n"
        "carry      -speed 0.5   -grip soft   # keep\n"
        "carry.slow -SUBST carry \\\n"
        "           -speed 0.2   # joined\n"
        "\n"
        "  bar\t\t-tea 1.5 \r\n"
        "gone 1 2\n"
        "# end";
    std::string file = folder.write("a.dict", original);
    chmod(file.c_str(), 0640);
    Dictionary d;
    FAILS(d.save(), "DICT FILE", "no dictionary file is loaded; name the one to write: dict CTRL -save FILE");
    d.load(file, Permit::owner());
    d.save();
    EQUAL(Folder::read(file), original);

    d.add("carry", {"-speed", "0.7", "", "two words", "#x", "a\\", "new\nline"}, "joe");
    d.add("bar", {"-tea", "2"}, "joe");
    d.add("zoo", {"1"}, "joe");
    d.add("new", {"-x", "y"}, "joe");
    d.remove("gone");
    EQUAL(d.expand("carry")[0].origin.toText(), "added by joe");
    d.save();
    EQUAL(Folder::read(file),
          "# robots\n"
          "carry      -speed 0.7 {} {two words} {#x} \"a\\\\\" \"new\\nline\"  # keep\n"
          "carry.slow -SUBST carry \\\n"
          "           -speed 0.2   # joined\n"
          "\n"
          "  bar\t\t-tea 2\r\n"
          "# end\n"
          "new -x y\n"
          "zoo 1\n");
    struct stat s {};
    stat(file.c_str(), &s);
    EQUAL(s.st_mode & 07777, 0640u);
    EQUAL(d.expand("zoo")[0].origin.toText(), file + ":9");
    EQUAL(d.expand("bar")[0].origin.toText(), file + ":6");
    Dictionary again;
    again.load(file, Permit::owner());
    for (auto& w : d.words()) EQUAL(get(again, w), get(d, w));
    EQUAL(again.size(), d.size());

    // A line that was joined becomes one line; an entry removed and added again keeps its place.
    d.add("carry.slow", {"-SUBST", "carry"}, "joe");
    d.remove("bar");
    d.add("bar", {"-tea", "3"}, "joe");
    d.save();
    CHECK(Folder::read(file).find("\ncarry.slow -SUBST carry  # joined\n\n  bar\t\t-tea 3\r\n") != std::string::npos);

    // What others wrote meanwhile stays, and entries are found again.
    std::string edited = "# someone was here\nother 1\n" + Folder::read(file) + "spoilt {\n";
    folder.write("a.dict", edited);
    d.add("zoo", {"2"}, "joe");
    d.save();
    std::string wanted = edited;
    wanted.replace(wanted.find("zoo 1"), 5, "zoo 2");
    EQUAL(Folder::read(file), wanted);
    EQUAL(get(d, "other"), "none");
    FAILS(d.reload(), "DICT SYNTAX", file + ":11: word 2: expected a closing }, got the end of the text");
    EQUAL(get(d, "other"), "none");
    folder.write("a.dict", edited.substr(0, edited.size() - 9));
    d.add("runtime", {"1"}, "joe");
    d.add("zoo", {"3"}, "joe");
    d.remove("new");
    d.reload();
    EQUAL(get(d, "other"), "[1]");
    EQUAL(get(d, "zoo"), "[1]");            // as the file says
    EQUAL(get(d, "new"), "[-x][y]");
    EQUAL(get(d, "runtime"), "[1]");        // no file knew it
}

void testSaveFiles() {
    Folder folder;
    std::string first = folder.write("1.dict", "a 1\nshared 1\n"), second = folder.write("2.dict", "b 1\nshared 2\n");
    Dictionary d;
    d.load(first, Permit::owner());
    d.load(second, Permit::owner());
    EQUAL(brackets(d.files()), "[" + first + "][" + second + "]");
    d.add("a", {"2"}, "");
    d.add("n", {"1"}, "");
    d.save();
    EQUAL(Folder::read(first), "a 2\nshared 1\n");
    EQUAL(Folder::read(second), "b 1\nshared 2\nn 1\n");
    // A copy of everything, which is not loaded by that.
    std::string copy = folder.write("copy.dict", "# mine\nb 7\nkept\n");
    d.save(copy, Permit::owner());
    EQUAL(Folder::read(copy), "# mine\nb 1\nkept\na 2\nn 1\nshared 2\n");
    EQUAL(d.files().size(), 2u);
    // A file that has gone is written anew.
    unlink(second.c_str());
    d.add("b", {"2"}, "");
    d.save(second, Permit::owner());
    EQUAL(Folder::read(second), "b 2\nn 1\nshared 2\n");
    // The first file ever becomes the one that -save means; a symbolic link stays one.
    Dictionary fresh;
    std::string target = folder.write("target", "x 1 \\"), link = folder.file("link");
    CHECK(symlink(target.c_str(), link.c_str()) == 0);
    fresh.add("y", {"1"}, "");
    fresh.save(link, Permit::owner());
    EQUAL(Folder::read(target), "x 1 \\\n\ny 1\n");
    struct stat s {};
    CHECK(lstat(link.c_str(), &s) == 0 && S_ISLNK(s.st_mode));
    fresh.add("y", {"2"}, "");
    fresh.save();
    EQUAL(Folder::read(target), "x 1 \\\n\ny 2\n");
    FAILS(fresh.save(folder.file("no/such/folder"), Permit::owner()), "DICT FILE",
          "cannot write dictionary file \"" + folder.file("no/such/folder") + "\": No such file or directory");
    // No temporary file is left.
    std::string list = "ls " + folder.file("") + " | grep -c new-";
    FILE* pipe = popen((list + " || true").c_str(), "r");
    char count[16] = "";
    CHECK(pipe && std::fgets(count, sizeof count, pipe));
    if (pipe) pclose(pipe);
    EQUAL(std::string(count), "0\n");
    // Text that is no file is changed at run time only.
    Dictionary builtin;
    builtin.loadText("c 1\n", "builtin");
    builtin.add("c", {"2"}, "joe");
    builtin.save(folder.file("c.dict"), Permit::owner());
    EQUAL(Folder::read(folder.file("c.dict")), "c 2\n");
}

void testEnvironment() {
    Folder folder;
    std::string first = folder.write("1.dict", "a 1\nb 1\n"), second = folder.write("2.dict", "b 2\n");
    setenv("SORMA_DICT", (first + "::" + second + ":").c_str(), 1);
    setenv("SORMA_ENTRY_carry", "-speed 0.5 'a b'", 1);
    setenv("SORMA_ENTRY_one", "{a b}", 1);
    Dictionary d;
    d.loadEnvironment();
    EQUAL(get(d, "a"), "[1]");
    EQUAL(get(d, "b"), "[2]");
    EQUAL(get(d, "carry"), "[-speed][0.5][a b]");
    EQUAL(get(d, "one"), "[a b]");
    EQUAL(d.expand("one")[0].origin.toText(), "added by environment variable SORMA_ENTRY_one");
    setenv("SORMA_ENTRY_carry", "{", 1);
    d.loadEnvironment();
    EQUAL(d.leftOut().size(), std::size_t{1});
    EQUAL(d.leftOut()[0], std::string("environment variable SORMA_ENTRY_carry: word 1: expected a closing }, got the end of the text"));
    EQUAL(get(d, "one"), "[a b]");
    for (const char* name : {"SORMA_DICT", "SORMA_ENTRY_carry", "SORMA_ENTRY_one"}) unsetenv(name);
}

// Random edits, saved and read again, against a plain map.
void testSaveProperties() {
    Folder folder;
    Maker make(1997);
    std::string file = folder.write("r.dict", "# first\nw0 a b # c\nw1\nw2 'x y' \\\n z\n");
    Dictionary d;
    d.load(file, Permit::owner());
    for (int round = 0; round < 300; ++round) {
        for (std::size_t n = make.below(4); n > 0; --n) {
            std::string word = "w" + std::to_string(make.below(12));
            if (make.below(4) == 0) {
                d.remove(word);
                continue;
            }
            std::vector<std::string> expansion;
            for (std::size_t k = make.below(4); k > 0; --k) expansion.push_back(make.word());
            if (expansion.size() == 1) expansion.push_back("");
            d.add(word, expansion, "");
        }
        d.save();
        Dictionary again;
        again.load(file, Permit::owner());
        EQUAL(brackets(again.words()), brackets(d.words()));
        for (auto& w : d.words()) {
            EQUAL(get(again, w), get(d, w));
            if (!d.get(w)->empty()) EQUAL(again.expand(w)[0].origin.toText(), d.expand(w)[0].origin.toText());
        }
    }
    CHECK(Folder::read(file).starts_with("# first\n"));
}

void testManyEntries() {
    std::string t;
    for (int i = 0; i < 10000; ++i) t += "carry." + std::to_string(i) + " -SUBST base -transferSpeed 0." + std::to_string(i) + "\n";
    const std::clock_t start = std::clock();            // of this process: others may be busy
    Dictionary d;
    d.loadText(t + "base -grip soft\n", "big.dict");
    EQUAL(d.size(), 10001u);
    for (int i = 0; i < 10000; ++i) d.add("n" + std::to_string(i), {"-SUBST", "base"}, "");
    std::size_t found = 0;
    for (int i = 0; i < 100; ++i)
        for (int k = 0; k < 10000; k += 10) found += d.has("carry." + std::to_string(k));
    EQUAL(found, 100'000u);
    CHECK(std::clock() - start < 5 * CLOCKS_PER_SEC);   // some 30 ms; anything quadratic takes minutes
}

const struct Group {
    const char* name;
    void (*run)();
} kGroups[] = {
    {"words", testWords},           {"quoting", testQuoting},       {"numbers", testNumbers},     {"utf8", testUtf8},
    {"base64", testBase64},         {"requests", testRequests},     {"replies", testReplies},     {"properties", testProperties},
    {"memory", testMemory},         {"trail", testTrail},           {"catalogue", testCatalogue}, {"deadline", testDeadline},
    {"names", testNames},           {"patterns", testPatterns},     {"addresses", testAddresses},   {"resolve", testResolve},     {"dictionary", testDictionary},
    {"loops", testLoops},           {"save", testSave},             {"saveFiles", testSaveFiles}, {"environment", testEnvironment},
    {"saveProperties", testSaveProperties}, {"manyEntries", testManyEntries},
};

}  // namespace

int main(int argc, char** argv) {
    bool known = argc < 2;
    for (auto& group : kGroups) {
        if (argc > 1 && std::strcmp(argv[1], group.name) != 0) continue;
        known = true;
        try {
            group.run();
        } catch (const std::exception& e) {
            note(false, 0, std::string(group.name) + " threw: " + e.what());
        }
    }
    if (!known) {
        std::printf("bad group \"%s\"\n", argv[1]);
        return 2;
    }
    std::printf("%d passed, %d failed\n", passed, failed);
    return failed > 0;
}
