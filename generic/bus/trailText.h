// trailText.h -- a trail as the one word after TDBX, and back.
//
// The word has a line for each entry: severity {SYMBOL detail...} {text} so daemon file line time {request}, with words quoted
// as in requests (requestText.h). The line "dropped n" comes first when entries were dropped.
//
// Errors: REQUEST SYNTAX; the message says what was expected and at which word.
#pragma once

#include <string>
#include <string_view>

#include "bus/trail.h"

namespace sorma {

std::string trailToWord(const Trail& trail);
// Drops entries beyond Trail::limit().
Trail trailFromWord(std::string_view word);

}  // namespace sorma
