#include "tcl/errorPlace.h"

#include <algorithm>
#include <charconv>
#include <vector>

namespace sorma {

namespace {

// A text in braces as Tcl reads it: a backslash at the end of a line, with the white space after it, becomes one space.
struct Joined {
    std::string text;
    std::vector<std::size_t> lines;     // of the source, from 1: that of each line of the text
};

Joined join(std::string_view source) {
    Joined out;
    std::size_t line = 1;
    out.lines.push_back(line);
    for (std::size_t i = 0; i < source.size(); ++i) {
        if (source[i] == '\\' && i + 1 < source.size() && source[i + 1] == '\n') {
            ++line;
            i += 1;
            while (i + 1 < source.size() && (source[i + 1] == ' ' || source[i + 1] == '\t')) ++i;
            out.text += ' ';
            continue;
        }
        out.text += source[i];
        if (source[i] == '\n') out.lines.push_back(++line);
        else if (source[i] == '\\' && i + 1 < source.size()) out.text += source[++i];
    }
    return out;
}

}  // namespace

ErrorPlace innermostMethod(std::string_view info, const std::function<bool(const std::string&)>& known) {
    constexpr std::string_view kClass = "\n    (class \"", kMethod = "\" method \"", kLine = "\" line ";
    for (std::size_t at = info.find(kClass); at != std::string_view::npos; at = info.find(kClass, at + 1)) {
        std::size_t name = at + kClass.size(), end = info.find('\n', name);
        std::size_t method = info.find(kMethod, name), line = info.find(kLine, name);
        if (method >= end || line >= end) continue;
        ErrorPlace place{std::string(info.substr(name, method - name)), {}, 0};
        method += kMethod.size();
        place.method = info.substr(method, line - method);
        line += kLine.size();
        std::from_chars(info.data() + line, info.data() + info.size(), place.line);
        if (place.line > 0 && known(place.className)) return place;
    }
    return {};
}

int lineOfBody(std::string_view source, std::string_view body, int line) {
    if (body.empty() || line < 1) return 0;
    Joined joined = join(source);
    std::string wanted = "{" + std::string(body) + "}";
    std::size_t at = joined.text.find(wanted);
    if (at == std::string::npos || joined.text.find(wanted, at + 1) != std::string::npos) return 0;
    std::size_t first = std::size_t(std::count(joined.text.begin(), joined.text.begin() + std::ptrdiff_t(at), '\n'));
    std::size_t index = first + std::size_t(line) - 1;
    return index < joined.lines.size() ? int(joined.lines[index]) : 0;
}

}  // namespace sorma
