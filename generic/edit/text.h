// text.h -- text between Tcl, the terminal and libedit, which edits wide characters; and how much room it takes.
#pragma once

#include <string>
#include <string_view>

#include "tcl/tclShim.h"

namespace sorma::edit {

// Through UTF-8 as others know it: Tcl's own text differs from it for NUL and, in 8.6, beyond the first 65536 characters.
std::wstring toWide(Tcl_Obj* text);
std::wstring toWide(std::string_view utf8);         // what is not UTF-8 becomes U+FFFD
std::string toUtf8(std::wstring_view text);
Tcl_Obj* newText(std::wstring_view text);           // reference count 0

// The number of Tcl characters of a text: differs from its length only beyond U+FFFF in 8.6.
int tclLength(std::wstring_view text);
// The first n Tcl characters of it.
std::wstring_view tclPrefix(std::wstring_view text, int n);

// Cells that a character takes on a terminal, as libedit shows it: control characters as ^X, odd ones as \U+XXXX.
int cells(wchar_t c);
int cells(std::wstring_view text);
// As much of it as fits into so many cells; cut text ends in "...".
std::wstring fitted(std::wstring_view text, int room);

}  // namespace sorma::edit
