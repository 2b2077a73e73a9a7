#include "bus/glob.h"

#include <cstdint>
#include <vector>

namespace sorma {

namespace {

constexpr std::uint32_t kNoUtf8 = 0x110000;         // beyond all code points: bytes that belong to none
constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};    // by length: a shorter form is no UTF-8

bool standsForItself(char c) { return static_cast<unsigned char>(c) < 0x80 && c != '*' && c != '?' && c != '[' && c != '\\'; }

// Takes one character off the front of a text that is not empty.
std::uint32_t take(std::string_view& text) {
    const auto byte = [&](std::size_t i) { return std::uint32_t(static_cast<unsigned char>(text[i])); };
    const std::uint32_t first = byte(0);
    std::size_t length = first < 0x80 ? 1 : first >= 0xc0 && first < 0xe0 ? 2 : first >= 0xe0 && first < 0xf0 ? 3
                         : first >= 0xf0 && first < 0xf8 ? 4 : 0;
    std::uint32_t character = length < 2 ? first : first & (0x7fu >> length);
    // The part that is cut off stays below the least of its length.
    for (std::size_t i = 1; i < length && i < text.size() && (byte(i) & 0xc0) == 0x80; ++i)
        character = character << 6 | (byte(i) & 0x3f);
    if (length == 0 || character < kLeast[length] || character >= kNoUtf8) character = kNoUtf8 + first, length = 1;
    text.remove_prefix(length);
    return character;
}

// Takes what stands for one character off the front of the pattern, which is not empty and has no * there. Does it match?
bool takeOne(std::string_view& pattern, std::uint32_t character) {
    const std::uint32_t p = take(pattern);
    if (p == '?') return true;
    if (p == '\\') return !pattern.empty() && take(pattern) == character;
    if (p != '[') return p == character;
    for (bool found = false; !found;) {
        if (pattern.empty() || pattern.front() == ']') return false;
        const std::uint32_t low = take(pattern);
        if (!pattern.empty() && pattern.front() == '-') {
            pattern.remove_prefix(1);
            if (pattern.empty()) return false;
            const std::uint32_t high = take(pattern);
            found = (low <= character && character <= high) || (high <= character && character <= low);
        } else {
            found = low == character;
        }
    }
    const auto end = pattern.find(']');
    pattern.remove_prefix(end == pattern.npos ? pattern.size() : end + 1);
    return true;
}

// In a range that ends with ], how much of the pattern belongs to the brackets depends on the character that they took. So
// all places of the pattern that the text may have reached are followed together.
bool matchEveryWay(std::string_view pattern, std::string_view text) {
    std::vector<bool> now(pattern.size() + 1), next(pattern.size() + 1);
    auto reach = [&](std::vector<bool>& places, std::size_t at) {
        for (places[at] = true; at < pattern.size() && pattern[at] == '*'; places[at] = true) ++at;
    };
    reach(now, 0);
    while (!text.empty()) {
        const std::uint32_t character = take(text);
        next.assign(next.size(), false);
        for (std::size_t at = 0; at < pattern.size(); ++at) {
            if (!now[at]) continue;
            auto rest = pattern.substr(at);
            if (pattern[at] == '*') reach(next, at);
            else if (takeOne(rest, character)) reach(next, pattern.size() - rest.size());
        }
        now.swap(next);
    }
    return now[pattern.size()];
}

}  // namespace

// Everything but * takes one character. So when it does not fit, it is enough to let the last * take one character more.
bool globMatch(std::string_view pattern, std::string_view text) {
    // Most patterns begin with letters that stand for themselves, and many have nothing else.
    std::size_t plain = 0;
    while (plain < pattern.size() && plain < text.size() && pattern[plain] == text[plain] && standsForItself(pattern[plain])) ++plain;
    pattern.remove_prefix(plain);
    text.remove_prefix(plain);
    if (pattern.empty() && text.empty()) return true;
    if (pattern.find("-]") != pattern.npos) return matchEveryWay(pattern, text);
    std::string_view afterStar, retry;
    for (;;) {
        if (!pattern.empty() && pattern.front() == '*') {
            do pattern.remove_prefix(1);
            while (!pattern.empty() && pattern.front() == '*');
            if (pattern.empty()) return true;
            afterStar = pattern;
            retry = text;
        }
        if (pattern.empty() && text.empty()) return true;
        if (!pattern.empty() && !text.empty() && takeOne(pattern, take(text))) continue;
        if (retry.empty()) return false;            // nor was there a * before
        take(retry);
        pattern = afterStar;
        text = retry;
    }
}

}  // namespace sorma
