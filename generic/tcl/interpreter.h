// interpreter.h -- what SORMA keeps for one Tcl interpreter: its SORM, shared values, settings, commands.
//
// Threads: belongs to the thread of its interpreter, like everything in it. Interpreters share nothing but code.
//
// End: Tcl first deletes the commands and TclOO objects of the interpreter, then this object. That may happen in the middle
// of a call, when a script deletes its interpreter. Then closing() becomes true, the call returns as soon as it can, and the
// outermost Entered deletes this object. So code that has run a script checks closing() before it uses the interpreter
// again.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "bus/sorm.h"
#include "tcl/convert.h"
#include "tcl/missingPackages.h"
#include "tcl/tclShim.h"

namespace sorma {

class SoBinding;
class TclService;
struct TclRun;

// An option of sorma::configure. Each part of the package adds its own by Interpreter::add.
struct Setting {
    std::string name;                               // with the dash: "-timeout"
    std::string unit, help;                         // help: a line for people
    std::function<std::string()> get;
    std::function<void(const std::string&)> set;    // throws Error for a bad value, and then changes nothing
};

class Interpreter final : public Host {
public:
    // Made by the package's init procedure; Tcl deletes it with the interpreter. safe: the interpreter is a safe one, and
    // has only the rights that sorma::grant gives.
    Interpreter(Tcl_Interp* interp, bool safe);
    ~Interpreter() override;
    // Null when the interpreter has not said `package require sorma`.
    static Interpreter* of(Tcl_Interp* interp);

    Tcl_Interp* const interp;
    const bool safe;
    const Constants constants;
    Sorm sorm;

    // Create the command ::sorma::NAME and export it. proc gets this object as its client data.
    void define(const char* name, Tcl_ObjCmdProc* proc);

    void add(Setting setting);
    // A setting that is a whole number within low .. high. For other values set is not called; the message names the
    // setting, the value and the range (OPTION VALUE, OPTION RANGE).
    void addInteger(std::string name, std::string unit, std::string help, std::int64_t low, std::int64_t high,
                    std::function<std::int64_t()> get, std::function<void(std::int64_t)> set);
    const std::vector<Setting>& settings() const { return settings_; }      // by name

    // action runs when the interpreter ends, before the SORM and its objects are deleted; the last one that was added runs
    // first. It must not evaluate scripts. Its exceptions are ignored.
    void atEnd(std::function<void()> action) { endings_.push_back(std::move(action)); }
    // The interpreter is being deleted, or was: do not use it any more.
    bool closing() const { return closed_ || Tcl_InterpDeleted(interp); }
    bool ended() const { return closed_; }      // it was deleted: even its memory may be freed

    // action runs when no call is in progress: now, or when the outermost one returns. It may make calls.
    void whenIdle(std::function<void()> action);

    // Put an error into the interpreter: message, -errorcode, -errorinfo, and the trail of the last request.
    // request: for entries of the trail that have no request. Returns TCL_ERROR.
    int raise(Trail trail, const std::string& request) noexcept;

    // ---- Host: called by the SORM, see bus/sorm.h ----
    bool loadClass(const std::string& name) override;
    std::vector<std::string> classNames() override;
    std::string classPlaces() override;
    void removed(const std::string& name) override;
    void providePackage(const char* package, const char* version) override;
    void report(const std::string& message) override;
    bool turn(std::int64_t until) override;

    // ---- data of soCommand.cpp and tclService.cpp ----
    std::unordered_map<std::string, SoBinding*> bindings;           // by the object's name
    std::unordered_map<std::string, TclService*> tclServices;       // those with a live TclOO object, by name
    Obj previousUnknown;                                            // the unknown handler before ours; null: ::unknown
    // The innermost TclOO service whose code is being evaluated, and the message for its warnings. Null: none.
    struct Running {
        TclService* service;
        Message* message;
    };
    Running running{nullptr, nullptr};
    std::unordered_map<std::string, std::shared_ptr<TclRun>> runs;  // requests that Tcl services execute, by their coroutine
    std::uint64_t lastRun = 0;                                      // for the name of the next coroutine
    std::uint64_t lastObject = 0;                                   // for the command of the next object without a name
    int constructing = 0;                                           // TclOO objects whose service object is being made
    unsigned entries = 0;                                           // how often it was Entered: has a script run meanwhile?

    // Marks a call in progress. The last one to be deleted runs the actions of whenIdle, and deletes the Interpreter when it
    // has ended meanwhile.
    class Entered {
    public:
        explicit Entered(Interpreter& i) : i_(i) { ++i_.depth_, ++i_.entries; }
        ~Entered() {
            if (--i_.depth_ == 0 && i_.due_) [[unlikely]] i_.idle();
        }
        Entered(const Entered&) = delete;
        Entered& operator=(const Entered&) = delete;

    private:
        Interpreter& i_;
    };

    // The same, for code that the event loop calls and that evaluates a script. It also preserves the Tcl interpreter. A
    // command need not do that, since Tcl preserves the interpreter for it. Without it, a script that deletes its
    // interpreter would end the process ("DeleteInterpProc called with active evals"). Do not use it in each call: it takes
    // a lock of the whole process.
    class Kept {
    public:
        explicit Kept(Interpreter& i) : interp_(i.interp), entered_(i) { Tcl_Preserve(interp_); }
        ~Kept() { Tcl_Release(interp_); }       // may delete the interpreter; then entered_ deletes the Interpreter
        Kept(const Kept&) = delete;
        Kept& operator=(const Kept&) = delete;

    private:
        Tcl_Interp* interp_;
        Entered entered_;
    };

private:
    static void deleted(ClientData, Tcl_Interp*);   // Tcl deletes the interpreter
    void idle();                                    // the outermost call returns, and there is something to do

    MissingPackages missing_;
    std::vector<Setting> settings_;
    std::vector<std::function<void()>> endings_;    // of atEnd
    int depth_ = 0;                                 // calls in progress
    bool closed_ = false;
    bool due_ = false;                              // idle() has something to do
    std::vector<std::function<void()>> waiting_;    // of whenIdle
};

// Evaluate a script at global level, as an event does: an error goes to the background error handler. Nothing happens when the
// interpreter is closing. callBack: a command prefix with further words; empty: none.
void runScript(Interpreter& i, Tcl_Obj* script);
void callBack(Interpreter& i, Tcl_Obj* prefix, std::initializer_list<Tcl_Obj*> words);

// The words of a command as request text, for the trail; 4096 bytes at most.
std::string commandText(int objc, Tcl_Obj* const objv[]);

// Runs the body of a command procedure. No C++ exception may leave a command procedure: each becomes a Tcl error here.
// Returns what body returns, or TCL_ERROR.
template <class Body> int guarded(Interpreter& interpreter, int objc, Tcl_Obj* const objv[], Body&& body) noexcept {
    Interpreter::Entered entered(interpreter);
    try {
        return body();
    } catch (...) {
        return interpreter.raise(trailOfCurrentException({}), commandText(objc, objv));
    }
}

// Restores the result and the error state of an interpreter when it is deleted.
class KeepState {
public:
    explicit KeepState(Tcl_Interp* interp) : interp_(interp), state_(Tcl_SaveInterpState(interp, TCL_OK)) {}
    ~KeepState() { Tcl_RestoreInterpState(interp_, state_); }
    KeepState(const KeepState&) = delete;
    KeepState& operator=(const KeepState&) = delete;

private:
    Tcl_Interp* interp_;
    Tcl_InterpState state_;
};

}  // namespace sorma
