// enumText.h -- finds the enumerator whose toText() a text is.
#pragma once

#include <string_view>

namespace sorma {

// Look from first to last, which are numbered without a gap. Returns whether it was found.
template <class E> bool findText(std::string_view text, E first, E last, E& out) {
    for (int i = static_cast<int>(first); i <= static_cast<int>(last); ++i)
        if (text == toText(static_cast<E>(i))) return out = static_cast<E>(i), true;
    return false;
}

}  // namespace sorma
