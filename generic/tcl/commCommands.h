// commCommands.h -- serve, unserve, daemons, and the settings of COMM, for one interpreter.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// Give the interpreter COMM: names with @ work from now on.
void initCommCommands(Interpreter& interpreter);

}  // namespace sorma
