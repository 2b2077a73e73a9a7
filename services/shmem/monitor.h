// monitor.h -- snapshot buffers in clear text: for -dump, DBX -timing, CTRL -list.
#pragma once

#include <string>

#include "ring.h"

namespace shmem {

// What the segment is and who writes it, then the last records, the newest first; lines that begin with "# ".
void appendDump(std::string& out, const Reader& reader);

// How regularly records come: count, age, rate, period and jitter of the last thousand, as far as they are still there.
// Lines, no newline at the end.
std::string timingText(const Reader& reader);

// One line for each segment of this machine.
std::string listText();

}  // namespace shmem
