// commands.h -- the commands sorma::dispatch, create, remove, exists, names, classes, catalogue, trail, configure, grant.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// Call it once for each interpreter.
void initCommands(Interpreter& interpreter);

}  // namespace sorma
