// unknown.h -- words that no command has: names of service objects are among them.
//
// The unknown handler of the global namespace handles these:
//     NAME METHOD ...         METHOD is one of EXEC CTRL DBX exec configure cget info destroy, and the class of NAME can be found
//     NAME@WHERE ...          and all else with an address
//     CLASS create|new ...
//     sorma::so::NAME ...
// All else goes to the handler that was there before, and fails as if this one was not there.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initUnknown(Interpreter& interpreter);

}  // namespace sorma
