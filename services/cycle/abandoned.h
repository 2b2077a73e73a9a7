// abandoned.h -- runners that were abandoned: their threads may need them for ever. The list keeps them reachable.
//
// Threads: any, with the mutex.
#pragma once

#include <mutex>
#include <set>

namespace cycle {

class Runner;

struct Abandoned {
    std::mutex mutex;
    std::set<Runner*> runners;
};
inline Abandoned& abandonedOnes() {
    static auto* a = new Abandoned;     // threads may outlive all static objects
    return *a;
}

}  // namespace cycle
