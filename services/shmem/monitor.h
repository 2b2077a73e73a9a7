// monitor.h -- snapshot buffers as text: for -dump, DBX -timing, CTRL -list.
#pragma once

#include <string>

#include "ring.h"

namespace shmem {

// Append lines that begin with "# ": the segment and its writer, then the last records, the newest first.
void appendDump(std::string& out, const Reader& reader);

// Count, age, rate, period and jitter of the last thousand records, as far as they are still there. Lines, without a newline
// at the end.
std::string timingText(const Reader& reader);

// One line for each segment of this machine.
std::string listText();

}  // namespace shmem
