// host.h -- figures of this machine, in SI units. Each call reads them from the kernel.
//
// Source:  proc(5), statvfs(3), clock_gettime(2); temperatures from /sys/class/hwmon and /sys/class/thermal.
// Threads: any.
// Errors:  HOST UNREADABLE, with the name of the file. A machine without thermometers has no temperatures; that is no error.
#pragma once

#include <string>
#include <vector>

namespace host {

struct Load {
    double oneMinute, fiveMinutes, fifteenMinutes;      // load averages: processes that run or wait for a processor
    int running, processes, processors;
};
Load load();

struct Memory {                                         // [bytes]
    double total, available, swapTotal, swapFree;
};
Memory memory();

struct Disk {
    std::string path, device, type;
    double size, available;                             // [bytes]; available: to ordinary users
};
std::vector<Disk> disks();                              // file systems that hold files, each device once
Disk disk(const std::string& path);                     // the file system that holds path

struct Temperature {
    std::string name;
    double kelvin;
};
std::vector<Temperature> temperatures();

struct Clock {                                          // [s]
    double wall;                                        // since 1970
    double monotonic;                                   // since an arbitrary time, never set back
    double uptime;                                      // since the machine was started, sleep included
    double resolution;                                  // of the monotonic clock
};
Clock clock();

}  // namespace host
