// process.h -- a program that runs as a child of this process, in a process group of its own.
//
// There is no shell: the program gets the words of the command unchanged. Its three standard channels are pipes. It does not
// inherit other descriptors, the signal mask or the signal dispositions of this process.
//
// Nothing stays running. Signals go to the whole group, and when the program has ended, the other processes of its group are
// killed. Only a process that makes a session or group of its own (setsid) stays. When this process exits, it kills its
// groups before. When it is killed (SIGKILL), the kernel kills the programs, but not the processes that they have started.
//
// Source:    pidfd_open(2), PR_SET_PDEATHSIG in prctl(2), setpgid(2), signal-safety(7).
// Threads:   a Process belongs to the thread of its SORM; that thread is also the parent, and must outlive the program.
// Blocking:  never, but for abandon(). Children of others are never waited for.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <sorma.h>

#include "bus/descriptor.h"

namespace child {

using sorma::Descriptor;

struct Command {
    std::vector<std::string> words;     // the program and its arguments: at least one, none with a zero character
    std::string directory;              // its working directory; empty: that of this process
    std::string input;                  // bytes for its standard input, which is closed after them
};

// How it ended.
struct End {
    enum class Kind {
        exited,         // number: its exit status
        killed,         // number: the signal
        notStarted,     // number: errno; `what` says what failed
        unknown,        // other code has fetched its status, or SIGCHLD is ignored: the kernel does not say
    } kind;
    int number = 0;
    std::string what = {};
    int status() const;                 // one number, as in shells: 128 + signal, 127 when it was not started
};

class Process : public std::enable_shared_from_this<Process> {
public:
    // Called from the event loop, one after another; `ended` is the last one, and comes once. None is called after
    // abandon(). They may delete the Process.
    struct Listener {
        std::function<void()> started;                          // exec(2) has succeeded
        std::function<void(std::string_view bytes)> output;     // of its standard output, as they come
        std::function<void(std::string_view bytes)> error;
        std::function<void(const End&)> ended;                  // it has been reaped, its output has been read
    };

    Process(sorma::Sorm& sorm, Listener listener) : sorm_(sorm), listener_(std::move(listener)) {}
    ~Process() { abandon(); }
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;

    // Start it; once. Throws std::system_error when the system has no process or descriptor. `started` or `ended` says
    // whether the program itself could be run.   permit: of those who have chosen the program, to run it.
    void start(const Command& command, const sorma::Permit& permit);
    pid_t pid() const { return pid_; }          // 0 before start(); stays when it has ended
    bool running() const { return running_; }

    // SIGTERM now, SIGKILL when it still runs after `grace` [ns]. Only the first call counts.
    void terminate(std::int64_t grace);
    // SIGKILL now.
    void kill();
    // SIGKILL now, and fetch its status. Blocks until the kernel has ended it: milliseconds. When it
    // hangs in a driver, this takes two seconds, and it stays as a zombie until this process ends.
    void abandon();

    // The file that is run for the first word of a command, by PATH; empty: there is none.
    static std::string find(const std::string& program, const std::string& directory);

private:
    struct Fork;
    void watch(int fd, void (Process::*callback)());
    void drop(Descriptor& fd);                  // unwatch and close
    void later(sorma::Timer& timer, std::int64_t nanoseconds, void (Process::*callback)());
    void release();                             // of all descriptors and timers
    void writeInput();
    void readReport();
    void readOutput();
    void readErrors();
    void read(Descriptor& fd, const std::function<void(std::string_view)>& sink);
    void drain(Descriptor& fd, const std::function<void(std::string_view)>& sink);
    void exited();
    void signal(int number) const;

    sorma::Sorm& sorm_;
    Listener listener_;
    pid_t pid_ = 0;
    // Invariant: while running_, pid_ is a child of ours, and its status was not fetched. So neither its number nor that of its
    // group can belong to another process.
    bool running_ = false;
    bool terminating_ = false;
    Descriptor exit_, report_;                  // pidfd; says why the program could not be run
    Descriptor input_, output_, errors_;
    std::string toWrite_;
    std::size_t written_ = 0;
    sorma::Timer inputTimer_, killTimer_;
    End failure_{End::Kind::exited};            // notStarted once the report has come
};

}  // namespace child
