#include "bus/trailText.h"

#include <climits>
#include <cstdint>
#include <utility>

#include "bus/requestText.h"

namespace sorma {

namespace {

const Prototype kSyntax{Severity::error, "REQUEST SYNTAX", 0, "word {}: expected {}, got {}"};

}  // namespace

std::string trailToWord(const Trail& trail) {
    std::string out;
    if (trail.dropped() > 0) out = "dropped " + std::to_string(trail.dropped());
    std::string code;
    for (auto& e : trail.entries()) {
        if (!out.empty()) out += '\n';
        code.clear();
        appendWord(code, e.symbol);
        for (auto& detail : e.details) appendWord(code, detail);
        appendWord(out, toText(e.severity));
        appendWord(out, code);
        appendWord(out, e.text);
        appendWord(out, e.so);
        appendWord(out, e.daemon);
        appendWord(out, e.file);
        appendWord(out, std::to_string(e.line));
        appendWord(out, std::to_string(e.time));
        appendWord(out, e.request);
    }
    return out;
}

Trail trailFromWord(std::string_view text) {
    Trail all;
    WordReader reader(text);
    std::string_view word;
    auto need = [&](const char* what) {
        if (!reader.next(word)) fail(kSyntax, reader.index() + 1, what, "the end of the text");
        return word;
    };
    auto integer = [&](const char* what, std::int64_t low, std::int64_t high) {
        std::int64_t value;
        if (!parseNumber(need(what), value) || value < low || value > high) fail(kSyntax, reader.index(), what, shown(word));
        return value;
    };
    for (bool first = true; reader.next(word); first = false) {
        if (first && word == "dropped") {
            all.setDropped(static_cast<std::size_t>(integer("how many entries were dropped", 1, INT64_MAX)));
            continue;
        }
        Entry e;
        if (!fromText(word, e.severity)) fail(kSyntax, reader.index(), "verbose, warning or error", shown(word));
        e.details = splitWords(need("the symbol and its details"));
        if (e.details.empty()) fail(kSyntax, reader.index(), "the symbol and its details", "an empty word");
        e.symbol = std::move(e.details.front());
        e.details.erase(e.details.begin());
        e.text = need("the text of the entry");
        e.so = need("a service object");
        e.daemon = need("a daemon");
        e.file = need("a source file");
        e.line = static_cast<int>(integer("a line number", INT_MIN, INT_MAX));
        e.time = integer("a time", INT64_MIN, INT64_MAX);
        e.request = need("a request");
        all.entries().push_back(std::move(e));      // not add(): the bound is applied once, to all of them
    }
    Trail trail;
    trail.append(all);
    return trail;
}

}  // namespace sorma
