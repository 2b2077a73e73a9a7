// interpreter.h -- what one Tcl interpreter has of SORMA: its SORM, the values that replies share, settings, commands.
//
// Threads: belongs to its interpreter's thread, like everything below it. Several interpreters of a process or a thread
// have nothing in common but code.
//
// End: Tcl deletes the commands and TclOO objects of an interpreter first, then this. When that happens in the middle of
// a call, the call finishes on what it holds, finds closing() true, and the last one out frees the rest (Entered).
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

// A word of sorma::configure. Other parts of the package add theirs: interpreter.add(...).
struct Setting {
    std::string name;                               // with the dash: "-timeout"
    std::string unit, help;
    std::function<std::string()> get;
    std::function<void(const std::string&)> set;    // throws when the value is refused
};

class Interpreter final : public Host {
public:
    Interpreter(Tcl_Interp* interp, bool safe);
    ~Interpreter() override;
    // Null when the interpreter has no `package require sorma` behind it.
    static Interpreter* of(Tcl_Interp* interp);

    Tcl_Interp* const interp;
    const bool safe;
    const Constants constants;
    Sorm sorm;

    // Create a command and make it a sub-command of the ensemble `sorma`. Its client data is this object.
    void define(const char* name, Tcl_ObjCmdProc* proc);

    void add(Setting setting);
    // A whole number within low .. high; a refusal names the setting, the value and the range (OPTION VALUE, RANGE).
    void addInteger(std::string name, std::string unit, std::string help, std::int64_t low, std::int64_t high,
                    std::function<std::int64_t()> get, std::function<void(std::int64_t)> set);
    const std::vector<Setting>& settings() const { return settings_; }

    // Runs when the interpreter ends, before the SORM and its objects go; the last one added runs first.
    void atEnd(std::function<void()> action) { endings_.push_back(std::move(action)); }
    // The interpreter is going or gone: touch it no more.
    bool closing() const { return closed_ || Tcl_InterpDeleted(interp); }
    bool ended() const { return closed_; }      // gone: not even its memory can be relied on

    // Do it when no call is in progress: now, or at the end of the outermost one.
    void whenIdle(std::function<void()> action);

    // Put a failure into the interpreter: message, -errorcode, -errorinfo, the trail of the last request.
    // request: entered where an entry of the trail has none. Returns TCL_ERROR.
    int raise(Trail trail, const std::string& request) noexcept;

    // ---- Host ----
    bool loadClass(const std::string& name) override;
    void removed(const std::string& name) override;
    void providePackage(const char* package, const char* version) override;
    void report(const std::string& message) override;
    bool turn(std::int64_t until) override;

    // ---- what soCommand.cpp and tclService.cpp keep here ----
    std::unordered_map<std::string, SoBinding*> bindings;           // by the SO's name
    std::unordered_map<std::string, TclService*> tclServices;       // those with a live TclOO object, by name
    Obj previousUnknown;                                            // handler that was there before; null: ::unknown
    // The TclOO service that is being executed, innermost, and what it has said so far. Null outside.
    struct Running {
        TclService* service;
        Message* message;
    };
    Running running{nullptr, nullptr};
    std::unordered_map<std::string, std::shared_ptr<TclRun>> runs;  // EXECs of Tcl services, by their coroutine
    std::uint64_t lastRun = 0;
    int constructing = 0;                                           // TclOO objects whose service object is being made

    // Marks a call in progress.
    class Entered {
    public:
        explicit Entered(Interpreter& i) : i_(i) { ++i_.depth_; }
        ~Entered() {
            if (--i_.depth_ == 0 && i_.due_) [[unlikely]] i_.idle();
        }
        Entered(const Entered&) = delete;
        Entered& operator=(const Entered&) = delete;

    private:
        Interpreter& i_;
    };

    // The same for what comes from the event loop or from another thread's answer. Tcl's own commands keep the interpreter
    // that they evaluate in; here nobody below has done so, and a script that deletes its interpreter would end the process
    // ("DeleteInterpProc called with active evals"). Not for each call: it takes a lock of the whole process.
    class Kept {
    public:
        explicit Kept(Interpreter& i) : interp_(i.interp), entered_(i) { Tcl_Preserve(interp_); }
        ~Kept() { Tcl_Release(interp_); }       // here it may end; then the Interpreter goes with entered_
        Kept(const Kept&) = delete;
        Kept& operator=(const Kept&) = delete;

    private:
        Tcl_Interp* interp_;
        Entered entered_;
    };

private:
    static void deleted(ClientData, Tcl_Interp*);
    void idle();

    MissingPackages missing_;
    std::vector<Setting> settings_;
    std::vector<std::function<void()>> endings_;
    int depth_ = 0;
    bool closed_ = false;
    bool due_ = false;                              // something waits for the end of the outermost call
    std::vector<std::function<void()>> waiting_;
};

// The words of a command as request text, for the trail.
std::string commandText(int objc, Tcl_Obj* const objv[]);

// The one wall for C++ exceptions: each command procedure runs its body inside.
template <class Body> int guarded(Interpreter& interpreter, int objc, Tcl_Obj* const objv[], Body&& body) noexcept {
    Interpreter::Entered entered(interpreter);
    try {
        return body();
    } catch (...) {
        return interpreter.raise(trailOfCurrentException({}), commandText(objc, objv));
    }
}

// Keeps result and error state of an interpreter as they were.
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
