// utf8.h -- text as UTF-8: written by character, and checked. generic/edit, which stands alone, uses what is inline.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sorma {

// Also half of a surrogate pair, of which Tcl 8.6 makes three bytes.
inline void appendUtf8(std::string& out, char32_t c) {
    if (c < 0x80) {
        out += char(c);
        return;
    }
    const int more = c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;           // bytes that follow
    out += char((0xff00 >> (more + 1) & 0xff) | c >> 6 * more);
    for (int k = more - 1; k >= 0; --k) out += char(0x80 | (c >> 6 * k & 0x3f));
}

bool isUtf8(std::string_view text);
// Offset of the first byte that is not UTF-8; size when there is none.
std::size_t utf8Prefix(std::string_view text);
// U+FFFD in place of each byte that is not UTF-8.
std::string withoutBadBytes(std::string_view text);

}  // namespace sorma
