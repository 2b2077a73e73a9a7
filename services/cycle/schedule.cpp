#include "schedule.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>

#ifndef MCL_ONFAULT
#define MCL_ONFAULT 4
#endif

namespace cycle {

namespace {

std::mutex mutex;
int holders = 0;

}  // namespace

std::vector<std::string> apply(const Schedule& schedule, const char* threadName) {
    std::vector<std::string> refused;
    pthread_setname_np(pthread_self(), threadName);
    sched_param parameters{};
    parameters.sched_priority = schedule.priority;
    int policy = schedule.priority > 0 ? SCHED_FIFO : SCHED_OTHER;
    if (int error = pthread_setschedparam(pthread_self(), policy, &parameters))
        refused.push_back("priority " + std::to_string(schedule.priority) + " of SCHED_FIFO was refused: " + strerror(error) +
                          "; it needs CAP_SYS_NICE, or a limit on rtprio (ulimit -r) of at least that");
    if (schedule.cpu < 0) return refused;
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(std::size_t(schedule.cpu), &set);
    if (int error = pthread_setaffinity_np(pthread_self(), sizeof set, &set))
        refused.push_back("processor " + std::to_string(schedule.cpu) + " was refused: " + strerror(error));
    return refused;
}

// With a limit, memory that is asked for later would be refused, and the program would fail in unexpected places.
std::string MemoryLock::acquire() {
    if (held_) return {};
    std::lock_guard lock(mutex);
    rlimit limit{};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    if (geteuid() != 0 && limit.rlim_cur != RLIM_INFINITY)
        return "memory is not locked: the limit is " + std::to_string(limit.rlim_cur) +
               " bytes; it needs CAP_IPC_LOCK, or ulimit -l unlimited";
    if (holders == 0 && mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0)
        return std::string("memory is not locked: ") + strerror(errno);
    ++holders;
    held_ = true;
    return {};
}

void MemoryLock::release() {
    if (!held_) return;
    held_ = false;
    std::lock_guard lock(mutex);
    if (--holders == 0) munlockall();
}

}  // namespace cycle
