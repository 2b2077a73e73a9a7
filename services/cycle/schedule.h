// schedule.h -- what a thread asks of the system to run on time: priority, a processor of its own, memory that stays.
#pragma once

#include <string>
#include <vector>

namespace cycle {

struct Schedule {
    int priority = 50;          // of SCHED_FIFO; 0: like any other thread
    int cpu = -1;               // -1: those that the process may use
    bool operator==(const Schedule&) const = default;
};

// Apply it to this thread, and to the process's memory; returns what the system has refused, a sentence each.
std::vector<std::string> apply(const Schedule& schedule, const char* threadName);

// Memory is locked while anybody holds this.
class MemoryLock {
public:
    MemoryLock() = default;
    ~MemoryLock() { release(); }
    MemoryLock(const MemoryLock&) = delete;
    MemoryLock& operator=(const MemoryLock&) = delete;
    std::string acquire();      // what was refused, or nothing
    void release();
private:
    bool held_ = false;
};

}  // namespace cycle
