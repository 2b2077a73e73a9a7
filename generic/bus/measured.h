// measured.h -- options that nobody sets: readings of an instrument, results, counters. The object alone gives them their values.
//
// In the table of a class it is an option that has a get, and none of set, refer and entrust. A recipe and CTRL are refused (OPTION READONLY).
#pragma once

#include "bus/option.h"

namespace sorma {

inline bool isMeasured(const Option& option) { return !option.set && !option.refer && !option.entrust; }

}  // namespace sorma
