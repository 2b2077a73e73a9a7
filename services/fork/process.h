// process.h -- a program that runs as a child of this process, in a process group of its own.
//
// No shell stands between: the words of the command are the words that the program gets. Its three standard channels
// are pipes; other descriptors, the signal mask and signal dispositions of this process are not passed on.
//
// Nothing is left behind. Whatever is done is done to the whole group, and when the program has ended, what it left in
// its group is killed as well; only one that makes itself a session or group of its own (setsid) stays. When this
// process exits, its groups are killed on the way out; when it dies without a word (SIGKILL), the kernel kills the
// programs, but not what they have started.
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

namespace child {

struct Command {
    std::vector<std::string> words;     // the program and its arguments: at least one, none with a zero character
    std::string directory;              // where it runs; empty: where this process is
    std::string input;                  // bytes for its standard input, which is closed behind them
};

// How it ended.
struct End {
    enum class Kind {
        exited,         // number: its exit status
        killed,         // number: the signal
        notStarted,     // number: errno; what could not be done stands in `what`
        unknown,        // somebody else has waited for it, or SIGCHLD is ignored: the kernel does not tell any more
    } kind;
    int number = 0;
    std::string what = {};
    int status() const;                 // in one number, as shells do: 128 + signal, 127 when it was not started
};

class Process : public std::enable_shared_from_this<Process> {
public:
    // Called from the event loop, one after another, ended last and once. None is called after abandon().
    struct Listener {
        std::function<void()> started;                          // the program runs, not only a copy of this process
        std::function<void(std::string_view bytes)> output;     // of its standard output, as they come
        std::function<void(std::string_view bytes)> error;
        std::function<void(const End&)> ended;                  // it has been reaped, its output has been read
    };

    Process(sorma::Sorm& sorm, Listener listener) : sorm_(sorm), listener_(std::move(listener)) {}
    ~Process() { abandon(); }
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;

    // Start it, once. Throws std::system_error when there is no process or descriptor to be had; whether the program
    // itself could be run is told by started or ended.
    void start(const Command& command);
    pid_t pid() const { return pid_; }          // 0 before; stays when it has ended
    bool running() const { return running_; }

    // SIGTERM now, SIGKILL when it still runs after `grace` [ns]. Again: nothing, the first one counts.
    void terminate(std::int64_t grace);
    // SIGKILL now.
    void kill();
    // SIGKILL now, reap it, and forget it. Blocks until the kernel has taken it down: milliseconds; two seconds at most
    // when it hangs in a driver, and then it is left as a zombie until this process ends.
    void abandon();

    // The file that would be run for a command's first word, along PATH; empty: there is none.
    static std::string find(const std::string& program, const std::string& directory);

private:
    struct Fork;
    void watch(int fd, void (Process::*callback)());
    void drop(int& fd);                         // unwatch and close
    void later(sorma::Timer& timer, std::int64_t nanoseconds, void (Process::*callback)());
    void release();                             // of all descriptors and timers
    void writeInput();
    void readReport();
    void readOutput();
    void readErrors();
    void read(int& fd, const std::function<void(std::string_view)>& sink);
    void drain(int& fd, const std::function<void(std::string_view)>& sink);
    void exited();
    void signal(int number) const;

    sorma::Sorm& sorm_;
    Listener listener_;
    pid_t pid_ = 0;
    // Invariant: while running_, pid_ is a child of ours that nobody has reaped, so that neither its number nor that of
    // its group can belong to somebody else.
    bool running_ = false;
    bool terminating_ = false;
    int exit_ = -1, report_ = -1;               // pidfd; says why the program could not be run
    int input_ = -1, output_ = -1, errors_ = -1;
    std::string toWrite_;
    std::size_t written_ = 0;
    sorma::Timer inputTimer_, killTimer_;
    End failure_{End::Kind::exited};            // notStarted once the report has come
};

}  // namespace child
