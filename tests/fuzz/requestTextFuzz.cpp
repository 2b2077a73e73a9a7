// requestTextFuzz.cpp -- any text as a request or a reply.
//
// It is refused, or it survives being written and read again, and its written text stays the same from then on.
//
// Build with -fsanitize=fuzzer,address,undefined together with generic/bus/{trail,catalogue,deadline,message,requestText}.cpp
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "bus/requestText.h"

using namespace sorma;

namespace {

void demand(bool condition, const char* what, const std::string& text) {
    if (condition) return;
    std::fprintf(stderr, "%s: %s\n", what, text.c_str());
    std::abort();
}

bool same(const Message& a, const Message& b) {
    if (a.floats.size() != b.floats.size()) return false;
    for (std::size_t i = 0; i < a.floats.size(); ++i) {
        if (std::isnan(a.floats[i]) && std::isnan(b.floats[i])) continue;
        if (std::bit_cast<std::uint64_t>(a.floats[i]) != std::bit_cast<std::uint64_t>(b.floats[i])) return false;
    }
    return a.text == b.text && a.ints == b.ints && a.any == b.any && a.words == b.words && a.code == b.code && a.trail == b.trail;
}

void request(std::string_view text) {
    std::string name, again, written, twice;
    Method method{}, methodAgain{};
    Message m, back;
    try {
        parseRequest(text, name, method, m);
    } catch (const Error& e) {
        demand(e.is("REQUEST SYNTAX"), "another error", e.what());
        return;
    }
    m.trail.clear();        // requests are written without
    appendRequest(written, name, method, m);
    parseRequest(written, again, methodAgain, back);
    demand(name == again && method == methodAgain && same(m, back), "a request changes", written);
    appendRequest(twice, again, methodAgain, back);
    demand(written == twice, "a canonical request changes", written);
}

void reply(std::string_view text) {
    std::string name, again, written, twice;
    Message m, back;
    try {
        parseReply(text, name, m);
    } catch (const Error& e) {
        demand(e.is("REQUEST SYNTAX"), "another error", e.what());
        return;
    }
    appendReply(written, name, m);
    parseReply(written, again, back);
    demand(name == again && same(m, back), "a reply changes", written);
    appendReply(twice, again, back);
    demand(written == twice, "a canonical reply changes", written);
    m.trail.toText();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view text(reinterpret_cast<const char*>(data), size);
    request(text);
    reply(text);
    std::string word;
    appendWord(word, text);     // any bytes make one word
    demand(splitWords(word).size() == 1, "not one word", word);
    return 0;
}
