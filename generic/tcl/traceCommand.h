// traceCommand.h -- the command sorma::trace.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// Call it once for each interpreter.
void initTraceCommand(Interpreter& interpreter);

}  // namespace sorma
