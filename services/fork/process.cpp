#include "process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

namespace child {

namespace {

constexpr int kFirstFree = 1024;                    // above what select() can watch, and above the standard channels
constexpr std::int64_t kWriteAgain = 10'000'000;    // [ns] until a full pipe is tried again
constexpr int kReapTime = 2000;                     // [ms]
constexpr int kPipeSize = 1 << 20;
constexpr unsigned kCloseRangeCloexec = 4;          // CLOSE_RANGE_CLOEXEC, Linux 5.11
constexpr std::size_t kSignalSetSize = 8;           // [bytes] the kernel's, not that of sigset_t

// Groups of this process that still run. exit() may come without any of our objects being taken down: tclsh does so.
class Groups {
public:
    ~Groups() {
        if (owner_ != getpid()) return;             // a fork of ours that calls exit: they are not its own
        for (pid_t group : groups_) ::kill(-group, SIGKILL);
    }
    void add(pid_t group) {
        std::lock_guard lock(mutex_);
        owner_ = getpid();
        groups_.insert(group);
    }
    void remove(pid_t group) {
        std::lock_guard lock(mutex_);
        groups_.erase(group);
    }

private:
    std::mutex mutex_;
    std::set<pid_t> groups_;
    pid_t owner_ = 0;
};
Groups groups;

[[noreturn]] void failWith(const char* what) { throw std::system_error(errno, std::generic_category(), what); }

// Out of the way of the standard channels, and where possible of those who can only watch small numbers.
Descriptor raised(Descriptor fd) {
    if (fd.get() >= kFirstFree) return fd;
    Descriptor high(fcntl(fd.get(), F_DUPFD_CLOEXEC, kFirstFree));
    if (!high) high = Descriptor(fcntl(fd.get(), F_DUPFD_CLOEXEC, 3));
    if (!high) failWith("cannot make a pipe");
    return high;
}

struct Pipe {
    Descriptor reader, writer;
    Pipe() {
        int fds[2];
        if (pipe2(fds, O_CLOEXEC) < 0) failWith("cannot make a pipe");
        reader = Descriptor(fds[0]);
        writer = Descriptor(fds[1]);
        reader = raised(std::move(reader));
        writer = raised(std::move(writer));
    }
};

void makeNonBlocking(int fd) { fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK); }

// Files that exec may try for a program, in this order.
std::vector<std::string> candidates(const std::string& program) {
    if (program.empty() || program.find('/') != std::string::npos) return {program};
    const char* set = std::getenv("PATH");
    std::string_view path = set ? set : "/usr/local/bin:/bin:/usr/bin";
    std::vector<std::string> out;
    for (std::size_t at = 0;;) {
        std::size_t end = std::min(path.find(':', at), path.size());
        std::string folder(path.substr(at, end - at));
        out.push_back(folder.empty() ? "./" + program : folder + "/" + program);
        if (end == path.size()) return out;
        at = end + 1;
    }
}

// The report of a child that could not run the program.
struct Report {
    enum Stage : int { directory, program } stage;
    int error;
};

// fork() without the handlers of pthread_atfork: those of Tcl make a notifier for the child, which needs none.
pid_t forkPlain() {
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 34)
    return _Fork();
#else
    return fork();
#endif
}

}  // namespace

int End::status() const {
    switch (kind) {
        case Kind::exited: return number;
        case Kind::killed: return 128 + number;
        case Kind::notStarted: return 127;
        case Kind::unknown: break;
    }
    return -1;
}

// Everything that the child needs, made before there is one: it may not allocate.
struct Process::Fork {
    std::vector<std::string> files;
    std::vector<const char*> filePointers;
    std::vector<char*> arguments;
    const char* directory;
    pid_t parent = getpid();
    Pipe input, output, errors, report;

    explicit Fork(const Command& command)
        : files(candidates(command.words[0])),
          directory(command.directory.empty() ? nullptr : command.directory.c_str()) {
        for (auto& file : files) filePointers.push_back(file.c_str());
        for (auto& word : command.words) arguments.push_back(const_cast<char*>(word.c_str()));
        arguments.push_back(nullptr);
    }

    // In the child: a copy of a process with many threads, of which only this one goes on. From here to exec only calls
    // of signal-safety(7) are allowed, for another thread may have held any lock.
    [[noreturn]] void run() const {
        setpgid(0, 0);
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent) _exit(127);        // it died before we could ask to be told
        usualSignals();

        dup2(input.reader.get(), STDIN_FILENO);
        dup2(output.writer.get(), STDOUT_FILENO);
        dup2(errors.writer.get(), STDERR_FILENO);
        closeOthersAtExec();
        if (directory && chdir(directory) < 0) fail(Report::directory, errno);
        int error = ENOENT;
        for (const char* file : filePointers) {
            execve(file, arguments.data(), environ);
            if (errno == EACCES) error = EACCES;    // goes on, as execvp does, but is what is told
            else if (errno != ENOENT && errno != ENOTDIR && errno != ESTALE && errno != ENODEV && errno != ETIMEDOUT)
                fail(Report::program, errno);
        }
        fail(Report::program, error);
    }

    // All signals are blocked until no handler of the parent is left that could run here. The system's own calls are
    // taken: the library's leave out the two signals that it uses itself, which a caller may have been started without.
    static void usualSignals() {
        const std::uint64_t usual[4] = {};           // of the kernel's sigaction, on all machines: no handler, flags, mask
        const std::uint64_t none = 0;
        for (int s = 1; s < NSIG; ++s) syscall(SYS_rt_sigaction, s, usual, nullptr, kSignalSetSize);
        syscall(SYS_rt_sigprocmask, SIG_SETMASK, &none, nullptr, kSignalSetSize);
    }

    // Libraries open some without O_CLOEXEC, and our own parent may have left us others.
    static void closeOthersAtExec() {
        if (syscall(SYS_close_range, 3u, ~0u, kCloseRangeCloexec) == 0) return;
        int folder = ::open("/proc/self/fd", O_RDONLY | O_DIRECTORY | O_CLOEXEC);   // an older kernel, or a filter of calls
        alignas(8) char entries[4096];
        for (long n; (n = syscall(SYS_getdents64, folder, entries, sizeof entries)) > 0;)
            for (long at = 0; at < n;) {
                constexpr int kLength = 16, kName = 19;         // of struct linux_dirent64, see getdents64(2)
                int fd = 0;
                for (const char* c = entries + at + kName; *c >= '0' && *c <= '9'; ++c) fd = 10 * fd + *c - '0';
                if (fd > STDERR_FILENO) fcntl(fd, F_SETFD, FD_CLOEXEC);
                unsigned short length;
                std::memcpy(&length, entries + at + kLength, sizeof length);
                at += length;
            }
    }

    [[noreturn]] void fail(Report::Stage stage, int error) const {
        Report r{stage, error};
        ssize_t ignored = write(report.writer.get(), &r, sizeof r);
        (void)ignored;
        _exit(127);
    }
};

void Process::start(const Command& command, const sorma::Permit& permit) {
    permit.check(sorma::Right::program);
    Fork fork(command);
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    pid_t pid = forkPlain();
    if (pid == 0) fork.run();
    int error = errno;
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (pid < 0) {
        errno = error;
        failWith("cannot make a process");
    }
    setpgid(pid, pid);                              // parent and child both call it, since each may need the group first
    pid_ = pid;
    running_ = true;
    groups.add(pid);

    report_ = std::move(fork.report.reader);
    input_ = std::move(fork.input.writer);
    output_ = std::move(fork.output.reader);
    errors_ = std::move(fork.errors.reader);
    for (auto* fd : {&report_, &input_, &output_, &errors_}) makeNonBlocking(fd->get());
    toWrite_ = command.input;
    if (toWrite_.size() > 65536) fcntl(input_.get(), F_SETPIPE_SZ, int(std::min<std::size_t>(toWrite_.size(), kPipeSize)));
    try {
        exit_ = Descriptor(int(syscall(SYS_pidfd_open, pid, 0)));
        if (!exit_) failWith("cannot watch a process");
        exit_ = raised(std::move(exit_));
        watch(exit_.get(), &Process::exited);
        watch(report_.get(), &Process::readReport);
        watch(output_.get(), &Process::readOutput);
        watch(errors_.get(), &Process::readErrors);
        writeInput();
    } catch (...) {
        abandon();
        throw;
    }
}

// ---- events ----

void Process::watch(int fd, void (Process::*callback)()) {
    sorm_.loop().watch(fd, [weak = weak_from_this(), callback] {
        if (auto self = weak.lock()) (self.get()->*callback)();
    });
}

void Process::drop(Descriptor& fd) {
    if (!fd) return;
    try {
        sorm_.loop().unwatch(fd.get());
    } catch (const sorma::Error&) {                 // the loop has ended before us
    }
    fd.close();
}

void Process::later(sorma::Timer& timer, std::int64_t nanoseconds, void (Process::*callback)()) {
    timer = sorm_.loop().after(sorma::monotonicNow() + nanoseconds, [weak = weak_from_this(), callback] {
        if (auto self = weak.lock()) (self.get()->*callback)();
    });
}

void Process::release() {
    inputTimer_.cancel();
    killTimer_.cancel();
    for (auto* fd : {&exit_, &report_, &input_, &output_, &errors_}) drop(*fd);
}

// As much as the pipe takes. The loop does not tell when a pipe can be written, so a full one is tried again.
void Process::writeInput() {
    inputTimer_.cancel();
    // A program that does not read to the end would end us with SIGPIPE, which embedding programs do not ignore.
    sigset_t pipe, before, waiting;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    sigpending(&waiting);
    pthread_sigmask(SIG_BLOCK, &pipe, &before);
    bool full = false;
    while (!full && written_ < toWrite_.size()) {
        ssize_t n = ::write(input_.get(), toWrite_.data() + written_, toWrite_.size() - written_);
        if (n >= 0) written_ += std::size_t(n);
        else if (errno == EAGAIN) full = true;
        else if (errno != EINTR) written_ = toWrite_.size();        // it reads no more: that is its own affair
    }
    timespec now{};
    if (!sigismember(&waiting, SIGPIPE)) sigtimedwait(&pipe, nullptr, &now);
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (full) return later(inputTimer_, kWriteAgain, &Process::writeInput);
    drop(input_);
    toWrite_ = {};
}

// The pipe is closed by exec, or brings what went wrong.
void Process::readReport() {
    if (!report_) return;
    Report r{};
    ssize_t n = ::read(report_.get(), &r, sizeof r);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    drop(report_);
    if (n == sizeof r)
        failure_ = {End::Kind::notStarted, r.error,
                    r.stage == Report::directory ? "its directory cannot be entered" : ""};
    else
        listener_.started();
}

void Process::readOutput() { read(output_, listener_.output); }
void Process::readErrors() { read(errors_, listener_.error); }

// One portion, so that others get their turn.
void Process::read(Descriptor& fd, const std::function<void(std::string_view)>& sink) {
    char buffer[65536];
    ssize_t n = ::read(fd.get(), buffer, sizeof buffer);
    if (n > 0) return sink({buffer, std::size_t(n)});
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    drop(fd);
}

// Read only what is there now: a process that has left the group may have the other end, and continue to write.
void Process::drain(Descriptor& fd, const std::function<void(std::string_view)>& sink) {
    int there = 0;
    if (!fd || ioctl(fd.get(), FIONREAD, &there) < 0) return;
    std::vector<char> buffer(std::size_t(std::max(there, 0)));
    for (std::size_t got = 0; got < buffer.size();) {
        ssize_t n = ::read(fd.get(), buffer.data() + got, buffer.size() - got);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) break;
        sink({buffer.data() + got, std::size_t(n)});
        got += std::size_t(n);
    }
}

void Process::exited() {
    // Until it is reaped, its number is still that of its group: now is the last moment to end what it left there.
    signal(SIGKILL);
    int status = 0;
    pid_t reaped = waitpid(pid_, &status, WNOHANG);
    if (reaped == 0 || (reaped < 0 && errno == EINTR)) return;
    running_ = false;
    groups.remove(pid_);
    readReport();
    drain(output_, listener_.output);
    drain(errors_, listener_.error);
    release();
    End end{End::Kind::unknown};
    if (failure_.kind == End::Kind::notStarted) end = failure_;
    else if (reaped == pid_ && WIFEXITED(status)) end = {End::Kind::exited, WEXITSTATUS(status)};
    else if (reaped == pid_) end = {End::Kind::killed, WTERMSIG(status)};
    listener_.ended(end);
}

// ---- ending it ----

void Process::signal(int number) const {
    if (running_) ::kill(-pid_, number);
}

void Process::terminate(std::int64_t grace) {
    if (!running_ || terminating_) return;
    terminating_ = true;
    if (grace <= 0) return kill();
    signal(SIGTERM);
    signal(SIGCONT);                                // one that has been stopped would not hear it
    later(killTimer_, grace, &Process::kill);
}

void Process::kill() { signal(SIGKILL); }

void Process::abandon() {
    if (!running_) return;
    kill();
    if (exit_) {
        pollfd p{exit_.get(), POLLIN, 0};
        int left = kReapTime;
        std::int64_t end = sorma::monotonicNow() + std::int64_t(kReapTime) * 1'000'000;
        while (poll(&p, 1, left) < 0 && errno == EINTR)
            left = std::max<int>(0, int((end - sorma::monotonicNow()) / 1'000'000));
        kill();                                     // processes that were started in the group meanwhile, before the group's number is free
        while (waitpid(pid_, nullptr, WNOHANG) < 0 && errno == EINTR) {}
    } else {
        while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {}
    }
    running_ = false;
    groups.remove(pid_);
    release();
}

std::string Process::find(const std::string& program, const std::string& directory) {
    for (auto& file : candidates(program)) {
        std::string full = file.starts_with('/') || directory.empty() ? file : directory + "/" + file;
        struct stat s;
        if (stat(full.c_str(), &s) == 0 && S_ISREG(s.st_mode) && access(full.c_str(), X_OK) == 0) return full;
    }
    return {};
}

}  // namespace child
