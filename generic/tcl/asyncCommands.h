// asyncCommands.h -- futures, subscriptions and health as Tcl commands.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initAsyncCommands(Interpreter& interpreter);

}  // namespace sorma
