// busText.h -- what the sources of the program busText share. Each has the groups of some files of the bus.
#pragma once

#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "bus/requestText.h"
#include "checks.h"

extern const std::vector<Group> kTrailGroups, kCallGroups, kNameGroups, kDictionaryGroups;

template <class F> void fails(F body, const std::string& code, const std::string& message, int line, const char* what) {
    try {
        body();
        note(false, line, std::string(what) + " did not fail");
    } catch (const sorma::Error& e) {
        same(sorma::joinWords(e.code()).substr(0, code.size()), code, line);
        same(e.what(), message, line);
    }
}
#define FAILS(expression, code, message) fails([&] { (void)(expression); }, code, message, __LINE__, #expression)

// All words in brackets: quotes would hide differences.
inline std::string brackets(const std::vector<std::string>& words) {
    std::string out;
    for (auto& w : words) out += '[' + w + ']';
    return out;
}

// What is nasty is more likely than chance would make it.
class RandomWords {
public:
    explicit RandomWords(unsigned seed) : random_(seed) {}
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

protected:
    std::mt19937_64 random_;
};
