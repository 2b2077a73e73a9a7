// nearest.h -- "did you mean -tempo?": the known words that a mistyped one resembles most.
//
// Two words are near when few letters are wrong, missing, too many or swapped: one for each three letters, at most three.
// They are also near when one is the beginning of the other. Upper and lower case count as equal.
//
// Threads: any.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sorma {

// The nearest ones, at most three that are equally near, sorted; none when nothing is near or the word has more than 64 bytes.
std::vector<std::string> nearest(std::string_view word, const std::vector<std::string>& known);

// " (did you mean -tempo?)" for a message, after the word that is wrong; empty when nothing is near.
std::string didYouMean(std::string_view word, const std::vector<std::string>& known);

// "-a, -b, or -c": all that there are, sorted, each once.
std::string oneOf(std::vector<std::string> words);

}  // namespace sorma
