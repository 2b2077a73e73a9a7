// asyncCommands.h -- the commands sorma::async, all, any, subscribe, unsubscribe, subscriptions and health.
//
// Scripts given to -command run from the event loop, at global level; their errors go to the background error handler.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

// Call it once for each interpreter. The commands end with the interpreter; unanswered futures are cancelled then.
void initAsyncCommands(Interpreter& interpreter);

}  // namespace sorma
