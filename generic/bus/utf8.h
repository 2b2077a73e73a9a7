// utf8.h -- the one place that writes a character as UTF-8. Header only: generic/edit stands alone.
#pragma once

#include <string>

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

}  // namespace sorma
