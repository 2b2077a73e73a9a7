// commands.h -- the commands sorma::dispatch, create, remove, exists, names, classes, catalogue, trail, configure, grant.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initCommands(Interpreter& interpreter);

}  // namespace sorma
