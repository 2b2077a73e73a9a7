// glob.h -- Tcl's string match: the only matcher of patterns in SORMA.
//
//     *        any characters, also none            [chars]  one of these; a-z and z-a are ranges, also over many letters
//     ?        one character                        \x       the character x itself
//
// All as in Tcl: [!a] and [^a] are no negations, [:alpha:] is no class, and \ in brackets is a character like others. A
// pattern that ends within a range or after \ matches nothing. Characters are code points, as in Tcl 9; a byte that is no
// UTF-8 is a character that equals only itself.
//
// Cost: at most the length of the text times that of the pattern. Ranges that end with ], as in [a-], cost that times the
// length of the brackets, since Tcl looks for another ] there.
#pragma once

#include <string_view>

namespace sorma {

// Does the whole text match? Never fails; any thread. Allocates only for a pattern with "-]".
bool globMatch(std::string_view pattern, std::string_view text);

}  // namespace sorma
