// schedule.h -- settings of the system that let a thread run on time: priority, processor, locked memory.
#pragma once

#include <string>
#include <vector>

namespace cycle {

struct Schedule {
    int priority = 50;          // of SCHED_FIFO; 0: an ordinary thread
    int cpu = -1;               // number of a processor; -1: any that the process may use
    bool operator==(const Schedule&) const = default;
};

// Apply it to the calling thread, and name the thread. Returns what the system has refused, a sentence each; never throws
// Error.
std::vector<std::string> apply(const Schedule& schedule, const char* threadName);

// The memory of the process is locked (mlockall) while at least one of these is acquired.
class MemoryLock {
public:
    MemoryLock() = default;
    ~MemoryLock() { release(); }
    MemoryLock(const MemoryLock&) = delete;
    MemoryLock& operator=(const MemoryLock&) = delete;
    std::string acquire();      // empty; or the reason why the system refused
    void release();
private:
    bool held_ = false;
};

}  // namespace cycle
