// signals.h -- handles the signals of a terminal for a Tcl program.
//
// Interrupt (Ctrl-C): the script that runs, or the event loop that it runs, ends with the error "interrupted", -errorcode
// TCL CANCEL. There is one exception: code of this package that waits in an event loop (Waiting). It gets the interrupt itself,
// since a script in that loop might catch the error. If such a script has not returned after kPatience,
// it is ended all the same.
//
// Window size, and continuation after a stop: kept until resized() and continued() are called.
//
// Termination and hang-up: the terminal's settings are restored, then the program ends by the signal.
//
// Threads: the interpreter's. A signal handler may not call Tcl_AsyncMark, which takes locks that the interrupted code may
//          hold. So the handlers only write to an eventfd, and a thread of this class calls Tcl_AsyncMark.
#pragma once

#include <vector>

#include "tcl/tclShim.h"

namespace sorma::edit {

class Signals {
public:
    // Handles SIGINT, SIGWINCH, SIGCONT, SIGTERM and SIGHUP until it is deleted. There may be one at a time in a process. A
    // signal that is ignored stays so.
    explicit Signals(Tcl_Interp* interp);
    ~Signals();
    Signals(const Signals&) = delete;
    Signals& operator=(const Signals&) = delete;

    static constexpr int kPatience = 250;       // [ms]

    // While this exists its maker gets the interrupts, and calls interrupted() after each event.
    class Waiting {
    public:
        explicit Waiting(Signals& s) : s_(s) { ++s_.waiting_; }
        ~Waiting() { --s_.waiting_; }
        Waiting(const Waiting&) = delete;
        Waiting& operator=(const Waiting&) = delete;

    private:
        Signals& s_;
    };
    bool waiting() const { return waiting_ > 0; }
    // Was there an interrupt that has not ended a script? Each is returned once.
    bool interrupted();
    // Has the window's size changed, or was the program continued, since the last call?
    bool resized();
    bool continued();

    // From now on the present settings of the terminal (file 0) are restored when a signal ends the program.
    static void keepTerminal();

private:
    static int onMark(ClientData data, Tcl_Interp* running, int code);
    void cancelLoop();
    void watch();

    Tcl_Interp* const interp_;
    Tcl_AsyncHandler token_;
    int waiting_ = 0;
    std::vector<Tcl_Interp*> spared_;   // child interpreters that must not be cancelled with their parent
    struct Watcher;                     // the thread
    Watcher* watcher_;
};

}  // namespace sorma::edit
