#include "bus/utf8.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace sorma {

namespace {

// Length of the UTF-8 character that text begins with; 0 when it is none. text is not empty.
std::size_t characterLength(std::string_view text) {
    auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    auto follows = [&](std::size_t i) { return i < text.size() && (at(i) & 0xc0) == 0x80; };
    unsigned char c = at(0);
    if (c < 0x80) return 1;
    if (c < 0xc2) return 0;                                     // continuation, overlong
    if (c < 0xe0) return follows(1) ? 2 : 0;
    if (c < 0xf0) {
        if (!follows(1) || !follows(2)) return 0;
        if (c == 0xe0 && at(1) < 0xa0) return 0;                // overlong
        if (c == 0xed && at(1) > 0x9f) return 0;                // surrogate
        return 3;
    }
    if (c > 0xf4 || !follows(1) || !follows(2) || !follows(3)) return 0;
    if (c == 0xf0 && at(1) < 0x90) return 0;                    // overlong
    if (c == 0xf4 && at(1) > 0x8f) return 0;                    // beyond U+10FFFF
    return 4;
}

}  // namespace

std::size_t utf8Prefix(std::string_view text) {
    constexpr std::uint64_t kHighBits = 0x8080808080808080;
    const char* p = text.data();
    std::size_t i = 0, n = text.size();
    for (;;) {
        for (std::uint64_t eight; i + 8 <= n; i += 8) {
            std::memcpy(&eight, p + i, 8);
            if (eight & kHighBits) break;
        }
        // To the next character beyond ASCII and across it.
        for (std::size_t stop = std::min(n, i + 8); i < stop;) {
            std::size_t length = characterLength(text.substr(i));
            if (length == 0) return i;
            i += length;
        }
        if (i >= n) return n;
    }
}

bool isUtf8(std::string_view text) { return utf8Prefix(text) == text.size(); }

std::string withoutBadBytes(std::string_view word) {
    std::string clean;
    while (!word.empty()) {
        std::size_t good = utf8Prefix(word);
        clean += word.substr(0, good);
        word.remove_prefix(good);
        if (word.empty()) break;
        clean += "\xef\xbf\xbd";
        word.remove_prefix(1);
    }
    return clean;
}

}  // namespace sorma
