// look.h -- shared by the sources of the recorder: recorder.cpp and look.cpp. Not installed.
#pragma once

#include <string>
#include <string_view>

#include "bus/message.h"
#include "bus/sorm.h"

namespace sorma::recording {

bool fits(const std::string& pattern, std::string_view name);      // as Tcl's string match
// The same message without the values of secret options, also where a request is inside of a part.
Message masked(const Sorm& sorm, const Message& m);

}  // namespace sorma::recording
