// processCommands.h -- commands about processes; but for atSignal, for sormad and sorma-launch alone.
//
//     sorma::atSignal script ?NAME ...?   see the manual
//     sorma::AtEnd pid script             run the script from the event loop when this child has ended; its exit status is still
//                                         to be fetched
//     sorma::Signal pid NAME              send a signal to a process, or with -pid to its group. Returns 0 when there is none
//     sorma::UntilEof ms                  send SIGTERM to this process when its standard input ends; exit with 1 if it still runs
//                                         ms later. A thread does it, so it works while a request computes
//     sorma::Notify text                  send the text to NOTIFY_SOCKET, as sd_notify(3) does. Returns whether it was sent
//     sorma::CloseAtExec fd               programs that this one starts do not inherit the descriptor
//     sorma::SplitWords text              the words of a text, quoted as in requests; # begins a comment
//     sorma::TakeSocket                   the socket that is standard input: a list of its descriptor, and whether it listens.
//                                         Standard channels that are this socket become /dev/null, so that nothing else writes
//                                         there
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initProcessCommands(Interpreter& interpreter);

}  // namespace sorma
