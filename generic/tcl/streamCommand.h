// streamCommand.h -- the command sorma::stream: reads a reply in pieces, see bus/pieces.h.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initStreamCommand(Interpreter& interpreter);

}  // namespace sorma
