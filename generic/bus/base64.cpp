#include "bus/base64.h"

#include <array>
#include <cstdint>

namespace sorma {

namespace {

constexpr char kBase64[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::array<std::uint8_t, 256> kFromBase64 = [] {
    std::array<std::uint8_t, 256> t{};
    for (auto& value : t) value = 0xff;
    for (std::uint8_t i = 0; i < 64; ++i) t[static_cast<unsigned char>(kBase64[i])] = i;
    return t;
}();

}  // namespace

void appendBase64(std::string& out, const unsigned char* data, std::size_t size) {
    std::size_t at = out.size();
    out.resize(at + (size + 2) / 3 * 4);
    char* to = out.data() + at;
    std::size_t i = 0;
    for (; i + 3 <= size; i += 3) {
        unsigned three = unsigned{data[i]} << 16 | unsigned{data[i + 1]} << 8 | data[i + 2];
        *to++ = kBase64[three >> 18];
        *to++ = kBase64[three >> 12 & 63];
        *to++ = kBase64[three >> 6 & 63];
        *to++ = kBase64[three & 63];
    }
    if (i == size) return;
    bool two = size - i == 2;
    unsigned rest = unsigned{data[i]} << 16 | (two ? unsigned{data[i + 1]} << 8 : 0);
    *to++ = kBase64[rest >> 18];
    *to++ = kBase64[rest >> 12 & 63];
    *to++ = two ? kBase64[rest >> 6 & 63] : '=';
    *to = '=';
}

bool parseBase64(std::string_view text, std::vector<unsigned char>& out) {
    if (text.size() % 4 != 0) return false;
    if (text.empty()) return true;
    std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
    const std::size_t start = out.size(), full = text.size() / 4 - (padding > 0);
    out.resize(start + text.size() / 4 * 3 - padding);
    unsigned char* to = out.data() + start;
    auto value = [&](std::size_t i) { return unsigned{kFromBase64[static_cast<unsigned char>(text[i])]}; };
    bool good = true;
    for (std::size_t i = 0; i < full && good; ++i) {
        unsigned a = value(4 * i), b = value(4 * i + 1), c = value(4 * i + 2), d = value(4 * i + 3);
        good = (a | b | c | d) < 64;
        unsigned three = a << 18 | b << 12 | c << 6 | d;
        *to++ = static_cast<unsigned char>(three >> 16);
        *to++ = static_cast<unsigned char>(three >> 8);
        *to++ = static_cast<unsigned char>(three);
    }
    if (good && padding > 0) {
        unsigned a = value(4 * full), b = value(4 * full + 1), c = padding == 1 ? value(4 * full + 2) : 0;
        // Bits that stand for nothing must be 0: one block, one text.
        good = (a | b | c) < 64 && (padding == 1 ? c & 3 : b & 15) == 0;
        *to++ = static_cast<unsigned char>(a << 2 | b >> 4);
        if (padding == 1) *to++ = static_cast<unsigned char>(b << 4 | c >> 2);
    }
    if (!good) out.resize(start);
    return good;
}

}  // namespace sorma
