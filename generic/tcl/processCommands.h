// processCommands.h -- what sormad and sorma-launch need, mostly of the operating system. Not for others.
//
//     sorma::AtSignal script ?NAME ...?   run it from the event loop whenever SIGTERM, SIGINT or one of these comes.
//                                         Once a process. What is ignored stays so, unless it is one of the two (nohup)
//     sorma::AtEnd pid script             run it from the event loop when this child has ended; it is not reaped
//     sorma::Signal pid NAME              to a process, or with -pid to its group. Returns 0 when there is none
//     sorma::UntilEof ms                  SIGTERM to this process when its standard input ends, seen by a thread that no
//                                         request can keep from it; if that has not helped in ms, the end, with 1
//     sorma::Notify text                  to whom NOTIFY_SOCKET names, as sd_notify(3) does. Returns whether it was sent
//     sorma::CloseAtExec fd               keep an inherited descriptor from programs that this one starts
//     sorma::SplitWords text              the words of a text, quoted as in requests; # begins a comment
//     sorma::TakeSocket                   the socket that is standard input: list of descriptor, and whether it listens.
//                                         Standard channels that are this socket become /dev/null: nothing else may
//                                         write there
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initProcessCommands(Interpreter& interpreter);

}  // namespace sorma
