#include "tcl/processCommands.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "bus/descriptor.h"
#include "bus/detached.h"
#include "bus/requestText.h"
#include "comm/transport.h"

namespace sorma {

namespace {

const Prototype kSignalName{Severity::error, "REQUEST SYNTAX", 0,
    "unknown signal \"{}\": must be CONT, HUP, INT, KILL, QUIT, STOP, or TERM"};
const Prototype kNumber{Severity::error, "REQUEST SYNTAX", 0, "{} expects a whole number, got \"{}\""};
const Prototype kNoProcess{Severity::error, "SERVICE GONE", 1, "process {} cannot be watched: {}"};
const Prototype kNoSocket{Severity::error, "COMM REFUSED", 0,
    "standard input is not a socket; inetd, or systemd with Accept=yes and StandardInput=socket, provides one"};
const Prototype kNoThread{Severity::error, "COMM LIMIT", 1, "cannot start the thread that watches standard input: {}"};

struct SignalName {
    const char* name;
    int number;
};
constexpr SignalName kSignals[] = {{"CONT", SIGCONT}, {"HUP", SIGHUP}, {"INT", SIGINT}, {"KILL", SIGKILL},
                                   {"QUIT", SIGQUIT}, {"STOP", SIGSTOP}, {"TERM", SIGTERM}};

int signalNumber(const std::string& name) {
    for (auto& s : kSignals)
        if (name == s.name) return s.number;
    fail(kSignalName, name);
}

int number(const char* what, Tcl_Obj* given) {
    std::int64_t value = 0;
    std::string text = toUtf8(given);
    if (!parseNumber(text, value) || value < INT32_MIN || value > INT32_MAX) fail(kNumber, what, text);
    return int(value);
}

// ---- signals ----

int signalBell = -1;

void onSignal(int) {
    std::uint64_t one = 1;
    int saved = errno;
    ssize_t ignored = write(signalBell, &one, sizeof one);
    (void)ignored;
    errno = saved;
}

struct SignalScript {
    Interpreter& interpreter;
    Obj script;
    std::vector<int> signals;
    ~SignalScript() {
        for (int number : signals) signal(number, SIG_DFL);
        Tcl_DeleteFileHandler(signalBell);
        close(std::exchange(signalBell, -1));
    }
};

void signalReadable(ClientData data, int) {
    auto& s = *static_cast<SignalScript*>(data);
    std::uint64_t count;
    if (read(signalBell, &count, sizeof count) < 0) return;
    runScript(s.interpreter, s.script);      // which may end the interpreter, and s with it
}

int AtSignalObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc < 2 || signalBell >= 0) {
            Tcl_WrongNumArgs(interp, 1, objv, "script ?signal ...? (once a process)");
            return TCL_ERROR;
        }
        std::vector<int> signals{SIGTERM, SIGINT};
        for (int at = 2; at < objc; ++at) {
            int number = signalNumber(toUtf8(objv[at]));
            struct sigaction now{};
            sigaction(number, nullptr, &now);
            if (now.sa_handler != SIG_IGN) signals.push_back(number);
        }
        signalBell = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
        std::shared_ptr<SignalScript> own(new SignalScript{i, Obj(objv[1]), signals});
        Tcl_CreateFileHandler(signalBell, TCL_READABLE, signalReadable, own.get());
        struct sigaction action{};
        action.sa_handler = onSignal;
        for (int number : signals) sigaction(number, &action, nullptr);
        i.atEnd([own]() mutable { own.reset(); });
        return TCL_OK;
    });
}

int SignalObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 3) {
            Tcl_WrongNumArgs(interp, 1, objv, "pid signal");
            return TCL_ERROR;
        }
        int sent = kill(number("pid", objv[1]), signalNumber(toUtf8(objv[2])));
        Tcl_SetObjResult(interp, Tcl_NewIntObj(sent == 0));
        return TCL_OK;
    });
}

// ---- the end of a child ----

struct EndScript;
using EndScripts = std::vector<std::unique_ptr<EndScript>>;     // of one interpreter, with which they end

struct EndScript {
    Interpreter& interpreter;
    EndScripts& all;
    Obj script;
    Descriptor fd;
    ~EndScript() { Tcl_DeleteFileHandler(fd.get()); }
};

EndScripts& endScriptsOf(Interpreter& i) {
    constexpr const char* kKey = "sorma::atEnd";
    if (auto* known = static_cast<EndScripts*>(Tcl_GetAssocData(i.interp, kKey, nullptr))) return *known;
    auto made = std::make_shared<EndScripts>();
    Tcl_SetAssocData(i.interp, kKey, nullptr, made.get());
    i.atEnd([made]() mutable { made.reset(); });
    return *made;
}

void childEnded(ClientData data, int) {
    auto* ended = static_cast<EndScript*>(data);
    Interpreter& i = ended->interpreter;
    Obj script = ended->script;
    std::erase_if(ended->all, [&](auto& s) { return s.get() == ended; });
    runScript(i, script);
}

int AtEndObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 3) {
            Tcl_WrongNumArgs(interp, 1, objv, "pid script");
            return TCL_ERROR;
        }
        int pid = number("pid", objv[1]);
        Descriptor fd(int(syscall(SYS_pidfd_open, pid, 0)));    // close-on-exec
        if (!fd) fail(kNoProcess, pid, std::strerror(errno));
        auto& all = endScriptsOf(i);
        auto& mine = all.emplace_back(new EndScript{i, all, Obj(objv[2]), std::move(fd)});
        Tcl_CreateFileHandler(mine->fd.get(), TCL_READABLE, childEnded, mine.get());
        return TCL_OK;
    });
}

// ---- the end of standard input ----

// It is a thread of its own: this process must end with the process at the other end, even when a service computes for ever.
void watchInput(int milliseconds) {
    char buffer[4096];
    for (;;) {
        ssize_t n = read(STDIN_FILENO, buffer, sizeof buffer);
        if (n > 0 || (n < 0 && errno == EINTR)) continue;
        if (n == 0 || errno != EAGAIN) break;
        pollfd p{STDIN_FILENO, POLLIN, 0};                      // other code has made it non-blocking
        poll(&p, 1, -1);
    }
    kill(getpid(), SIGTERM);
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    static const char text[] = "standard input has ended, but this daemon did not end in time\n";
    ssize_t ignored = write(STDERR_FILENO, text, sizeof text - 1);
    (void)ignored;
    _exit(1);
}

int UntilEofObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) {
            Tcl_WrongNumArgs(interp, 1, objv, "ms");
            return TCL_ERROR;
        }
        int milliseconds = number("ms", objv[1]);
        try {
            startDetached([milliseconds] { watchInput(milliseconds); });
        } catch (const std::system_error& error) {
            fail(kNoThread, error.what());
        }
        return TCL_OK;
    });
}

// ---- who has started us ----

bool notify(const std::string& text) {
    const char* where = std::getenv("NOTIFY_SOCKET");
    if (!where || (*where != '/' && *where != '@')) return false;
    sockaddr_un a{};
    a.sun_family = AF_UNIX;
    std::size_t length = std::strlen(where);
    if (length < 2 || length >= sizeof a.sun_path) return false;
    std::memcpy(a.sun_path, where, length);
    if (*where == '@') a.sun_path[0] = 0;                       // of the abstract namespace
    const Descriptor out(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!out) return false;
    ssize_t sent = sendto(out.get(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&a),
                          socklen_t(offsetof(sockaddr_un, sun_path) + length));
    return sent == ssize_t(text.size());
}

int NotifyObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) {
            Tcl_WrongNumArgs(interp, 1, objv, "text");
            return TCL_ERROR;
        }
        Tcl_SetObjResult(interp, Tcl_NewIntObj(notify(toUtf8(objv[1]))));
        return TCL_OK;
    });
}

int CloseAtExecObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) {
            Tcl_WrongNumArgs(interp, 1, objv, "fd");
            return TCL_ERROR;
        }
        fcntl(number("fd", objv[1]), F_SETFD, FD_CLOEXEC);      // one that is not open is told when it is to be used
        return TCL_OK;
    });
}

int TakeSocketObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 1) {
            Tcl_WrongNumArgs(interp, 1, objv, nullptr);
            return TCL_ERROR;
        }
        struct stat input, other;
        if (fstat(STDIN_FILENO, &input) < 0 || !S_ISSOCK(input.st_mode)) fail(kNoSocket);
        int listens = 0;
        socklen_t size = sizeof listens;
        getsockopt(STDIN_FILENO, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size);
        int taken = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
        int null = open("/dev/null", O_RDWR | O_CLOEXEC);
        for (int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
            if (fstat(fd, &other) == 0 && other.st_dev == input.st_dev && other.st_ino == input.st_ino) dup2(null, fd);
        if (null >= 0) close(null);
        Tcl_Obj* words[] = {Tcl_NewIntObj(taken), Tcl_NewIntObj(listens)};
        Tcl_SetObjResult(interp, Tcl_NewListObj(2, words));
        return TCL_OK;
    });
}

// sorma::WhoIs channel: who is at the other end of a TCP connection, as sorma::async -as takes it. Nobody is the owner by TCP.
int WhoIsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) return Tcl_WrongNumArgs(interp, 1, objv, "channel"), TCL_ERROR;
        Tcl_Channel channel = Tcl_GetChannel(interp, Tcl_GetString(objv[1]), nullptr);
        if (!channel) return TCL_ERROR;
        ClientData handle = nullptr;
        PrincipalPointer who;
        if (Tcl_GetChannelHandle(channel, TCL_READABLE, &handle) == TCL_OK) {
            Descriptor copy(fcntl(int(reinterpret_cast<std::intptr_t>(handle)), F_DUPFD_CLOEXEC, 0));
            if (copy) who = tcpTransport.identify(Line(std::move(copy), tcpTransport)).principal;
        }
        if (!who) who = Principal::nobody();
        return Tcl_SetObjResult(interp, newText(who->toText())), TCL_OK;
    });
}

int SplitWordsObjCmd(ClientData data, Tcl_Interp* interp, int objc, Tcl_Obj* const objv[]) {
    auto& i = *static_cast<Interpreter*>(data);
    return guarded(i, objc, objv, [&] {
        if (objc != 2) {
            Tcl_WrongNumArgs(interp, 1, objv, "text");
            return TCL_ERROR;
        }
        std::string text = toUtf8(objv[1]);
        WordReader reader(text);
        Obj list(Tcl_NewListObj(0, nullptr));
        std::string_view word;
        while (reader.next(word) && (reader.quoted() || !word.starts_with('#')))
            Tcl_ListObjAppendElement(nullptr, list, newText(word));
        Tcl_SetObjResult(interp, list);
        return TCL_OK;
    });
}

}  // namespace

void initProcessCommands(Interpreter& i) {
    if (i.safe) return;
    struct { const char* name; Tcl_ObjCmdProc* proc; } commands[] = {
        {"atSignal", AtSignalObjCmd}, {"AtEnd", AtEndObjCmd}, {"Signal", SignalObjCmd}, {"UntilEof", UntilEofObjCmd},
        {"Notify", NotifyObjCmd}, {"CloseAtExec", CloseAtExecObjCmd}, {"SplitWords", SplitWordsObjCmd},
        {"TakeSocket", TakeSocketObjCmd}, {"WhoIs", WhoIsObjCmd}};
    for (auto& c : commands)
        Tcl_CreateObjCommand(i.interp, (std::string("::sorma::") + c.name).c_str(), c.proc, &i, nullptr);
    Tcl_Export(i.interp, Tcl_FindNamespace(i.interp, "::sorma", nullptr, 0), "atSignal", 0);
}

}  // namespace sorma
