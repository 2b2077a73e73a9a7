// busText.cpp -- checks of the bus's text modules without Tcl: words, numbers, requests. The sources beside it have the rest.
//
//     busText            runs all groups
//     busText GROUP      runs one; tests/requestText.test and its neighbours have one test for each
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <new>
#include <random>

#include "busText.h"
#include "bus/message.h"
#include "bus/trailText.h"

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
    for (const char* text : {"nop EXEC", "nop EXEC TMSG {a b}", "nop EXEC TMSG {TMSG} FMSG 3 0.1 -0 1e+300 IMSG 2 1 2 AMSG Zg== word",
                             "nop EXEC FMSG 1 1 {2} 3", "nop EXEC IMSG 1 1 {inf} inf", "nop EXEC FMSG 3 nan inf -inf", "nop EXEC {FMSG} 2",
                             "nop EXEC 2 3", "nop CTRL", "nop CTRL -a TMSG {} \"\\n\"", "nop DBX -why -a", "{} EXEC", "nop EXEC AMSG {TMSG}",
                             "nop EXEC FMSG 1 1 AMSG Zg== 5"})
        EQUAL(request(text), text);
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
    for (const char* text : {"nop RET 0", "nop RET -1 TMSG {a b} FMSG 1 0.5 IMSG 1 3 AMSG Zg==", "nop RET 2147483647", "nop RET -2147483648",
                             "nop RET 1 TDBX {warning {{CARRY DUSTY} 0.4} {dust on the lens} carry.slow robot carry.cpp 31 1700000000123456 {carry.slow EXEC}}",
                             "nop RET 1 TDBX {dropped 7}"})
        EQUAL(reply(text), text);
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
class Maker : public RandomWords {
public:
    using RandomWords::RandomWords;
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

}  // namespace

const std::vector<Group> kTextGroups{
    {"words", testWords}, {"quoting", testQuoting}, {"numbers", testNumbers}, {"utf8", testUtf8},
    {"base64", testBase64}, {"requests", testRequests}, {"replies", testReplies},
    {"properties", testProperties}, {"memory", testMemory},
};

int main(int argc, char** argv) {
    std::vector<Group> all = kTextGroups;
    for (auto* groups : {&kTrailGroups, &kCallGroups, &kNameGroups, &kDictionaryGroups}) all.insert(all.end(), groups->begin(), groups->end());
    return runGroups(all, argc, argv);
}
