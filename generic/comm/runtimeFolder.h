// runtimeFolder.h -- the folder where the daemons of this user listen.
//
// Each daemon has a socket there, NAME.sock. Threads: any thread may call these functions.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sorma {

inline constexpr std::string_view kSocketEnding = ".sock";

// $SORMA_RUNTIME_DIR, else $XDG_RUNTIME_DIR/sorma, else /tmp/sorma-UID. It is made with mode 0700 when missing. Fails with COMM
// DENIED when it belongs to somebody else, or when others may read or write it. They could see who serves what, or put a socket of
// their own in a daemon's place. Others may pass through it (0711), since each socket has a mode of its own.
std::string runtimeFolder();
std::string runtimeSocket(const std::string& name);     // NAME.sock in it

// The names of the files with this ending in a folder, without the ending, sorted; none when it cannot be read.
std::vector<std::string> namesIn(const std::string& folder, std::string_view ending);

// Remove the socket file of a daemon that died, with the lock that listening takes. False: a daemon listens there, or nobody
// can tell.
bool sweepSocket(const std::string& path);

}  // namespace sorma
