// amounts.h -- ranges, counts and choices in words, for messages and help.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/option.h"
#include "bus/requestText.h"

namespace sorma {

// "0.01 .. 1.5", ">= 0"; empty: any number
inline std::string rangeText(double low, double high) {
    if (low == -kInfinity && high == kInfinity) return {};
    if (low == -kInfinity) return "<= " + plainNumber(high);
    if (high == kInfinity) return ">= " + plainNumber(low);
    return plainNumber(low) + " .. " + plainNumber(high);
}

// "3", "1 to 4", "at least 2"
inline std::string countText(Count count) {
    if (count.low == count.high) return std::to_string(count.low);
    if (count.high == SIZE_MAX) return count.low == 0 ? "any number of" : "at least " + std::to_string(count.low);
    return std::to_string(count.low) + " to " + std::to_string(count.high);
}

// words, which is a plural, or their singular for "1" and "at least 1".
inline std::string wordsFor(Count count, std::string_view words) {
    if (count.low == 1 && (count.high == 1 || count.high == SIZE_MAX) && words.ends_with('s')) words.remove_suffix(1);
    return std::string(words);
}

inline std::string amountText(Count count, std::string_view words) { return countText(count) + ' ' + wordsFor(count, words); }

// "a, b, or c", in this order
inline std::string joinChoices(const std::vector<std::string>& choices) {
    std::string out;
    for (std::size_t i = 0; i < choices.size(); ++i) {
        if (i > 0) out += i + 1 < choices.size() ? ", " : choices.size() > 2 ? ", or " : " or ";
        out += choices[i];
    }
    return out;
}

}  // namespace sorma
