#include "edit/text.h"

#include <cwchar>
#include <stdexcept>

#include "bus/utf8.h"

namespace sorma {

// This module stands alone: what the shim declares is the bus's there, and ours here.
Tcl_Size tclSize(std::size_t n) {
    if (n > std::size_t(TCL_SIZE_MAX)) throw std::length_error("text too long for Tcl");
    return Tcl_Size(n);
}

}  // namespace sorma

namespace sorma::edit {

std::wstring toWide(std::string_view s) {
    std::wstring out;
    for (std::size_t at = 0; at < s.size();) {
        auto lead = static_cast<unsigned char>(s[at]);
        int more = lead < 0x80 ? 0 : lead >= 0xf0 && lead < 0xf8 ? 3 : lead >= 0xe0 && lead < 0xf0 ? 2 : lead >= 0xc2 && lead < 0xe0 ? 1 : -1;
        if (more < 0 || at + std::size_t(more) >= s.size()) {
            out += L'\xfffd';
            ++at;
            continue;
        }
        char32_t c = more == 0 ? lead : lead & (0x3f >> more);
        bool good = true;
        for (int k = 1; k <= more; ++k) {
            auto next = static_cast<unsigned char>(s[at + std::size_t(k)]);
            good = good && (next & 0xc0) == 0x80;
            c = c << 6 | (next & 0x3f);
        }
        out += good ? wchar_t(c) : L'\xfffd';
        at += good ? std::size_t(more) + 1 : 1;
    }
    return out;
}

std::string toUtf8(std::wstring_view text) {
    std::string out;
    for (wchar_t w : text) appendUtf8(out, char32_t(w));
    return out;
}

namespace {

Tcl_Encoding utf8() {
    static Tcl_Encoding encoding = Tcl_GetEncoding(nullptr, "utf-8");
    return encoding;
}

bool isPair([[maybe_unused]] wchar_t c) {
#if TCL_MAJOR_VERSION < 9
    return char32_t(c) > 0xffff;
#else
    return false;
#endif
}

}  // namespace

std::wstring toWide(Tcl_Obj* text) {
    std::string_view internal = view(text);
    Tcl_DString out;
    Tcl_UtfToExternalDString(utf8(), internal.data(), tclSize(internal.size()), &out);
    std::wstring wide = toWide(std::string_view(Tcl_DStringValue(&out), std::size_t(Tcl_DStringLength(&out))));
    Tcl_DStringFree(&out);
    return wide;
}

Tcl_Obj* newText(std::wstring_view text) {
    std::string bytes = toUtf8(text);
    Tcl_DString out;
    Tcl_ExternalToUtfDString(utf8(), bytes.data(), tclSize(bytes.size()), &out);
    Tcl_Obj* o = Tcl_NewStringObj(Tcl_DStringValue(&out), Tcl_DStringLength(&out));
    Tcl_DStringFree(&out);
    return o;
}

int tclLength(std::wstring_view text) {
    int n = 0;
    for (wchar_t c : text) n += isPair(c) ? 2 : 1;
    return n;
}

std::wstring_view tclPrefix(std::wstring_view text, int n) {
    std::size_t at = 0;
    for (; at < text.size() && n > 0; ++at) n -= isPair(text[at]) ? 2 : 1;
    return text.substr(0, at);
}

int cells(wchar_t c) {
    if (c < L' ' || c == 0x7f) return 2;
    int n = wcwidth(c);
    return n >= 0 ? n : c > 0xffff ? 8 : 7;
}

int cells(std::wstring_view text) {
    int n = 0;
    for (wchar_t c : text) n += cells(c);
    return n;
}

std::wstring fitted(std::wstring_view text, int room) {
    if (cells(text) <= room) return std::wstring(text);
    if (room <= 3) return {};
    int n = 0;
    std::size_t at = 0;
    while (n + cells(text[at]) <= room - 3) n += cells(text[at++]);
    return std::wstring(text.substr(0, at)) + L"...";
}

}  // namespace sorma::edit
