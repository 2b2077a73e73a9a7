// listText.h -- writes Tcl lists, for answers that programs read.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

namespace sorma {

// Append an element to a Tcl list, with a space before it unless the list is empty. Tcl reads any text back unchanged.
void appendListElement(std::string& list, std::string_view element);
template <class Texts> std::string listOf(const Texts& elements) {
    std::string list;
    for (auto& e : elements) appendListElement(list, e);
    return list;
}
inline std::string listOf(std::initializer_list<std::string> elements) { return listOf<>(elements); }

// Keys and values of a Tcl dict, as text.
class DictText {
public:
    void put(std::string_view key, std::string_view value) {
        appendListElement(text_, key);
        appendListElement(text_, value);
    }
    const std::string& text() const { return text_; }

private:
    std::string text_;
};

}  // namespace sorma
