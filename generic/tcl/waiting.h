// waiting.h -- lets a Tcl command wait for answers. In a coroutine only that coroutine waits.
#pragma once

#include <functional>
#include <vector>

#include "bus/reply.h"
#include "tcl/interpreter.h"

namespace sorma {

// Call it at the end of the procedure of an NRE command, and return its result.
//
// It waits until all futures are done (all: false: one of them), or the deadline has passed. Then it calls finish(), which
// sets the interpreter's result, returns Tcl's code and must not throw. In a coroutine the command yields meanwhile. Outside
// of a coroutine, or with C code in between, it blocks; then no event loop runs but for futures of objects of this process.
// When the coroutine is deleted meanwhile, the futures are cancelled, unless they are kept, and finish() is not called.
int waitThen(Interpreter& interpreter, std::vector<Future> futures, bool all, Deadline deadline, std::function<int()> finish, bool kept = false);

// The name of the coroutine in which we are; empty when we are in none. Resets the interpreter's result.
Obj coroutineName(Interpreter& interpreter);

}  // namespace sorma
