#include "bus/glob.h"

#include <fnmatch.h>

#include <string>

namespace sorma {

bool globMatch(std::string_view pattern, std::string_view text) {
    if (pattern == "*") return true;
    return fnmatch(std::string(pattern).c_str(), std::string(text).c_str(), 0) == 0;
}

}  // namespace sorma
