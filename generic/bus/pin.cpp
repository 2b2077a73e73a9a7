#include "bus/pin.h"

#include <algorithm>

#include "bus/catalogue.h"
#include "bus/requestText.h"

namespace sorma {

namespace {

const Prototype kPin{Severity::error, "REQUEST SYNTAX", 1,
                     "\"{}\" is no pin: must be \"name in|out at length unit help\", length a number or open"};

}  // namespace

std::string Pin::toText() const {
    std::string out;
    for (auto& word : {name, std::string(input ? "in" : "out"), std::to_string(at),
                       length == kOpen ? std::string("open") : std::to_string(length), unit, help})
        appendWord(out, word);
    return out;
}

std::vector<Pin> Pin::fromText(std::string_view lines) {
    std::vector<Pin> pins;
    while (!lines.empty()) {
        auto line = lines.substr(0, lines.find('\n'));
        lines.remove_prefix(std::min(lines.size(), line.size() + 1));
        auto words = splitWords(line);
        std::int64_t at = -1, length = -1;
        bool good = words.size() == 6 && (words[1] == "in" || words[1] == "out") && parseNumber(words[2], at) && at >= 0 &&
                    (words[3] == "open" || (parseNumber(words[3], length) && length >= 0));
        if (!good) fail(kPin, line);
        pins.push_back({words[0], words[1] == "in", std::size_t(at), words[3] == "open" ? kOpen : std::size_t(length), words[4],
                        words[5]});
    }
    return pins;
}

}  // namespace sorma
