// peerCommands.h -- the commands sorma::resolve and sorma::peer, for observers such as the browser.
//
// A peer is a connection to one daemon that never waits: each answer comes to a script, from the event loop.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

class Comm;

// Call it once for each interpreter. The commands end with the interpreter, before comm.
void initPeerCommands(Interpreter& interpreter, Comm& comm);

}  // namespace sorma
