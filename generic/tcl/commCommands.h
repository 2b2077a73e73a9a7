// commCommands.h -- the commands sorma::serve, unserve and daemons, and the settings of COMM in sorma::configure.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

class Comm;

// Give the interpreter COMM: names with @ work from now on. COMM ends with the interpreter, or with the process: then
// clients are told, and socket files are removed.
void initCommCommands(Interpreter& interpreter);
Comm& commOf(Interpreter& interpreter);     // of that interpreter

}  // namespace sorma
