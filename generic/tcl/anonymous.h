// anonymous.h -- objects without a name, made by the command of their class: `gain create g -factor 2`, `gain new`.
//
// The holder of its command owns the object. It ends with the command, as a TclOO object does. The repository does not have it,
// so it has no recipe, and no other process can call it.
//
// Threads: the interpreter's.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

bool makesObject(Tcl_Obj* word);        // create or new

// objv: CLASS create command ?-option value ...?, or CLASS new ?-option value ...?. The result is the command with all its
// namespaces. A class in Tcl gets the words as its own command does. Throws Error: NAME UNKNOWN_CLASS, SERVICE EXISTS when the
// command is taken, NAME SYNTAX, or as Sorm::makeAnonymous.
int makeByClass(Interpreter& interpreter, const std::string& className, int objc, Tcl_Obj* const objv[]);

// The command sorma::anonymous. Call it once for each interpreter.
void initAnonymous(Interpreter& interpreter);

}  // namespace sorma
