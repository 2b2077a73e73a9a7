// lateTrace.h -- asks for the spans that no reply brings (bus/lateSpans.h), and puts them into a trace.
//
// It asks the daemons that this process knows: those with which it has a connection, and this user's daemons on this host. A place
// that only a reply names is not asked, since anybody might have named it.
//
// Threads: the SORM's. Blocks.
#pragma once

#include <string>
#include <vector>

#include "comm/comm.h"

namespace sorma {

// Until all of them are there, or the deadline has passed. Then those that are under way are taken, too.   also: more daemons to ask.
void gatherLate(Comm& comm, Sorm& sorm, Span& root, Deadline until, const std::vector<std::string>& also);

}  // namespace sorma
