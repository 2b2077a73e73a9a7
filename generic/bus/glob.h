// glob.h -- Tcl's string match for the patterns of names and catalogue symbols: * ? [a-z] and backslash.
#pragma once

#include <string_view>

namespace sorma {

// Does the whole text match? Never fails; any thread.
bool globMatch(std::string_view pattern, std::string_view text);

}  // namespace sorma
