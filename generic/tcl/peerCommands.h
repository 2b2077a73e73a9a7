// peerCommands.h -- sorma::resolve, and sorma::peer: a line to one daemon for those who look on.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

class Comm;

void initPeerCommands(Interpreter& interpreter, Comm& comm);

}  // namespace sorma
