// tclService.h -- service classes written in Tcl: TclOO classes whose superclass is sorma::Service.
//
//     oo::class create carry {
//         superclass sorma::Service
//         sorma::purpose "carries a thing from one place to another"
//         sorma::option -transferSpeed double -unit m/s -range {0.01 1.5} -default 0.2 -help "speed while loaded"
//         sorma::option -arm service -help "arm that moves"
//         sorma::action -stop {} "stop at once" {[my cget -arm] CTRL -stop}
//         sorma::reads floats 6 m "from (3), to (3)"
//         sorma::example "carry EXEC FMSG 6 3 4 0 4 5 0"
//         method exec {message} {
//             [my cget -arm] exec -floats [dict get $message floats]
//         }
//     }
//
// The declarations become a sorma::Class, which is used like one of C++. The name of the service class is the last part of
// the TclOO class's name, in lower case, with _ for all that is neither letter nor digit. A derived class also has the
// options, actions and inspections of its superclass. A declaration for a class that has objects already is for objects made
// later.
//
// Threads:  the interpreter's.
// Owner:    the repository owns the service object. The service object and its TclOO object delete each other: whichever is
//           removed first. The exception is a TclOO object that a script has made itself; it lives as long as its command.
// Re-entry: each function that runs Tcl code may be entered again, and the interpreter may be deleted meanwhile.
#pragma once

#include <memory>

#include "bus/call.h"

#include "tcl/interpreter.h"

namespace sorma {

class TclPieces;
struct TclClass;        // declarations of one TclOO class

class TclService final : public Service {
public:
    // Makes a TclOO object of the class. Fails with SERVICE FAILED when its constructor does.   initial: values of the
    // options.
    TclService(Interpreter& interpreter, Tcl_Class type, std::vector<Value> initial);
    // For a TclOO object that a script has made (carry create x). It is not in the repository; the script calls it by its
    // command.
    TclService(Interpreter& interpreter, Tcl_Object object, std::vector<Value> initial);
    ~TclService() override;

    void exec(Message& m) override;
    std::unique_ptr<Pieces> inPieces(Message& m) override;
    void born() override;
    void changed(std::span<const Option* const> options) override;
    void settle(std::span<const Option* const> options, Message& m) override;
    void answerSelftest(Message& m) override;
    void dumpState(std::string& out) const override;

    // Call a method of the TclOO object, also a private one, and return its result. message receives the warnings of the
    // method; null drops them. An error of the method is thrown as Error, after the entries that the trail has already.
    Obj call(std::string_view method, std::span<Tcl_Obj* const> args, Message* message) const;

    // Run an action or an inspection. As EXEC it may wait, and is then answered later. The method's result becomes a line of
    // m.text.
    void act(const std::string& method, Args args, Message& m);

    void removed();             // the service object was removed from the repository: delete the TclOO object
    void objectDeleted();       // the TclOO object was deleted: remove the service object

    void removing() override;    // it is being removed: requests that wait fail with SERVICE GONE
    // The object itself has found these values out: it is their origin. Watchers are told of those that are new. settling: in settle(), see
    // bus/bookkeeping.h.
    void store(std::span<const std::pair<std::size_t, Value>> values, bool settling);
    void tell(std::string_view event, const Message& m) { publishState(event, m); }
    void answer(TclRun& run, Message& m) const;     // put the result of a run that is done into m, or throw its error
    // Options. option: its index in the class's table. setService fails with COMM DENIED for an object elsewhere that the
    // owner of this process has not chosen.
    Value value(std::size_t option) const { return values_[option]; }
    void setValue(std::size_t option, const Value& value);
    void setService(std::size_t option, Reference service);
    Interpreter& interpreter() const { return interpreter_; }
    std::string command() const;            // of its TclOO object, with all its namespaces; empty: it was deleted

private:
    bool settles();                     // has its class a method settle?
    // Evaluate the command in a coroutine. When it waits there, m is answered later.
    void begin(const std::shared_ptr<TclRun>& run, std::span<const Obj> command, Message& m);
    friend class TclPieces;
    // Evaluate it until it waits or is done. Returns the coroutine's name.
    std::string run(const std::shared_ptr<TclRun>& run, std::span<const Obj> command);

    Interpreter& interpreter_;
    Tcl_Object object_ = nullptr;       // null when it has been deleted
    std::optional<bool> settles_;       // empty: not known yet
    bool anonymous_ = false;            // a script has made object_
    Obj my_;                            // the object's `my` command, which also calls private methods
    std::vector<Value> values_;         // one for each option
    std::vector<Reference> services_;   // of the options of type service; as long as values_, or empty
};

// One EXEC or action of a service in Tcl. It runs in a coroutine of its own, so that it may wait for time, events or other
// services; only the coroutine is suspended then. When it waits for the first time, its caller's thread goes on, and it is
// answered later.
struct TclRun {
    TclService* service;                // null when its interpreter was deleted
    Reference keep;                     // keeps the service alive
    bool isExec = true;                 // else an action or an inspection
    bool settles = false;               // it is settle
    Message said;                       // its warnings so far
    KeptCallPointer context;                    // caller and deadline of the request; null: it came from no request
    Reply reply;                        // empty until it waits
    Obj atCancel;                       // script to run when the caller cancels
    TclPieces* pieces = nullptr;        // its reply is read as a stream, see tclPieces.h
    bool done = false, cancelled = false;
    int code = 0;                       // when it is done: Tcl's code
    Obj result, options;                // and result and return options
};

// The service whose code is being evaluated: in the coroutine in which we are, else Interpreter::running.
Interpreter::Running runningNow(Interpreter& interpreter);

// While this exists, requests have the deadline and the caller of the EXEC that runs in the coroutine. If there is none, it
// does nothing. The Tcl code of a coroutine needs it for its requests.
class InCoroutine {
public:
    InCoroutine(Interpreter& interpreter, Tcl_Obj* coroutine);
    ~InCoroutine();

private:
    std::shared_ptr<TclRun> run_;
    alignas(CallContext) unsigned char context_[sizeof(CallContext)];
};

// Create ::sorma::Service, the declaration commands, sorma::fail and sorma::warn. False: the interpreter's result says why.
bool initTclServices(Interpreter& interpreter);

// Look for a TclOO class of that service class name and add it to the SORM. False: there is none.
bool registerTclClass(Interpreter& interpreter, const std::string& name);
std::string tclClassOf(Interpreter& interpreter, const std::string& name);      // the command of that class; empty: there is none
std::vector<std::string> tclClassNames(Interpreter& interpreter);      // service class names of all such TclOO classes

// For a TclOO object of a service class that a script has made: the label by which callByName knows it. It gets a service
// object if it has none. Empty: the command is no such object.
std::string labelOfObject(Interpreter& interpreter, std::string_view command);

// That service object, if it has one already; null.
Service* anonymousTclObject(Interpreter& interpreter, const std::string& command);

// The service object of that name was removed: delete its TclOO object, if it has one.
void tclServiceRemoved(Interpreter& interpreter, const std::string& name);

}  // namespace sorma
