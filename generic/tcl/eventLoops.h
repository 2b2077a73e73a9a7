// eventLoops.h -- Tcl's own commands that run an event loop: vwait, update, tkwait.
//
// What an event loop calls in the middle of a request has nothing to do with that request: an `after` script that happens to
// run there is not the client's. Tcl has no place where one could be told of it, so the commands are wrapped.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// For the commands that are there; those that `load` brings (tkwait, with Tk) are wrapped after it.
void wrapEventLoops(Interpreter& interpreter);

}  // namespace sorma
