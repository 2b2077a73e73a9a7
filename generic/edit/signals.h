// signals.h -- what the terminal tells a program by signals, brought to where Tcl can act on it.
//
// Interrupt (Ctrl-C): the script that is being executed, or the event loop that it runs, ends with the error
// "interrupted", -errorcode TCL CANCEL. But not while somebody waits in an event loop of this package (Waiting): who is
// meant then is who waits, not a callback that happens to run, which would perhaps catch the error, and the interrupt
// were lost. Only a callback that does not come back for kPatience is ended nevertheless: it may be the very loop that
// is to be interrupted.
// Window size, and being continued after a stop: noted until somebody asks. Termination and hang-up: the terminal's
// settings are put back, then the program ends by the signal as it would have.
//
// Tcl_AsyncMark takes locks, so that it may not be called by a signal handler: the interrupted code may hold them. The
// handlers only ring an eventfd, and a thread of ours does the marking.
#pragma once

#include <vector>

#include "tcl/tclShim.h"

namespace sorma::edit {

class Signals {
public:
    // Catches SIGINT, SIGWINCH, SIGCONT, SIGTERM and SIGHUP until it ends; one at a time in a process. A signal that
    // is ignored stays so.
    explicit Signals(Tcl_Interp* interp);
    ~Signals();
    Signals(const Signals&) = delete;
    Signals& operator=(const Signals&) = delete;

    static constexpr int kPatience = 250;       // [ms]

    // As long as it lives interrupts are for whoever made it, who looks at interrupted() after each event.
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
    // Was there an interrupt that no script has ended by? Takes it.
    bool interrupted();
    // Has the window's size changed, was the program continued, since it was asked last?
    bool resized();
    bool continued();

    // These settings of the terminal (file 0) are put back when the program is ended by a signal from now on.
    static void keepTerminal();

private:
    static int onMark(ClientData data, Tcl_Interp* running, int code);
    void cancelLoop();
    void watch();

    Tcl_Interp* const interp_;
    Tcl_AsyncHandler token_;
    int waiting_ = 0;
    std::vector<Tcl_Interp*> spared_;   // not to be cancelled with their parent
    struct Watcher;                     // the thread
    Watcher* watcher_;
};

}  // namespace sorma::edit
