// text.h -- converts text between Tcl, the terminal and libedit, which uses wide characters; and computes its width.
#pragma once

#include <string>
#include <string_view>

#include "tcl/tclShim.h"

namespace sorma::edit {

// These go through real UTF-8. Tcl's own text differs from it for NUL and, in 8.6, beyond U+FFFF.
std::wstring toWide(Tcl_Obj* text);
std::wstring toWide(std::string_view utf8);         // bytes that are not UTF-8 become U+FFFD
std::string toUtf8(std::wstring_view text);
Tcl_Obj* newText(std::wstring_view text);           // reference count 0

// The number of Tcl characters of a text. It differs from text.size() only in 8.6, beyond U+FFFF.
int tclLength(std::wstring_view text);
// The first n Tcl characters of a text.
std::wstring_view tclPrefix(std::wstring_view text, int n);

// Width on a terminal in cells, as libedit shows it: control characters as ^X, others that cannot be shown as \U+XXXX.
int cells(wchar_t c);
int cells(std::wstring_view text);
// The text, cut to so many cells; cut text ends in "...".
std::wstring fitted(std::wstring_view text, int room);

}  // namespace sorma::edit
