// eventLoops.h -- wraps Tcl's commands that run an event loop: vwait, update, tkwait.
//
// A service may run an event loop in the middle of a request. The scripts that run there (`after`, file events) have nothing to do
// with that request. They must not get its caller, rights or deadline. Tcl has no hook for this, so the commands are wrapped.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// Wrap the commands that exist, and `load`, after which it looks again: tkwait comes with Tk.
void wrapEventLoops(Interpreter& interpreter);

}  // namespace sorma
