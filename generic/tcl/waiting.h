// waiting.h -- a Tcl command that waits for answers: in a coroutine only that coroutine waits.
#pragma once

#include <functional>
#include <vector>

#include "bus/reply.h"
#include "tcl/interpreter.h"

namespace sorma {

// For the procedures of NRE commands: returns what they return. When all futures are done (or any of them, or the
// deadline has passed), finish() sets the interpreter's result; it must not throw. In a coroutine the command yields
// meanwhile; where that cannot be (outside of any, or with C code in between) it blocks. When the coroutine is deleted
// meanwhile, the calls are cancelled and finish() is not called.
int waitThen(Interpreter& interpreter, std::vector<Future> futures, bool all, Deadline deadline, std::function<int()> finish);

// The name of the coroutine that is being executed; empty outside of any. Changes the interpreter's result.
Obj coroutineName(Interpreter& interpreter);

}  // namespace sorma
