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
// The declarations become a sorma::Class; everything after that is the same as for C++. The service class's name is
// the last part of the TclOO class's name, in lower case, with _ for what is neither letter nor digit. A class derived from another service class has its table too.
// A declaration for a class that has objects already concerns those made afterwards.
#pragma once

#include <memory>

#include "bus/call.h"

#include "tcl/interpreter.h"

namespace sorma {

struct TclClass;        // declarations of one TclOO class

class TclService final : public Service {
public:
    // type: the class of the object, still without SO. Fails with SERVICE FAILED when the Tcl constructor does.
    TclService(Interpreter& interpreter, Tcl_Class type, std::vector<Value> initial);
    // For a TclOO object that somebody has made himself (carry create x): it is his, and no name leads to it.
    TclService(Interpreter& interpreter, Tcl_Object object, std::vector<Value> initial);
    ~TclService() override;

    void exec(Message& m) override;
    void born() override;
    void changed(std::span<const Option* const> options) override;
    void answerSelftest(Message& m) override;
    void dumpState(std::string& out) const override;

    // Call a method of the TclOO object, private ones too. Throws what it throws, behind what message has in its
    // trail already (message may be null: then warnings of the method go nowhere).
    Obj call(std::string_view method, std::span<Tcl_Obj* const> args, Message* message) const;

    // An action, or what else answers CTRL and DBX: as an EXEC it may wait, and is answered later then. What the method
    // returns becomes a line of m.text.
    void act(const std::string& method, Args args, Message& m);

    void removed();             // the SO has left the repository: so does the TclOO object
    void objectDeleted();       // and the other way round

    void leaving() override;
    void tell(std::string_view event, const Message& m) { publishState(event, m); }
    void answer(TclRun& run, Message& m) const;     // of one that is done: the result into m, or a throw
    Value value(std::size_t option) const { return values_[option]; }
    void setValue(std::size_t option, const Value& value);
    void setService(std::size_t option, Reference service);
    Interpreter& interpreter() const { return interpreter_; }

private:
    void begin(const std::shared_ptr<TclRun>& run, std::span<const Obj> command, Message& m);

    Interpreter& interpreter_;
    Tcl_Object object_ = nullptr;       // null when it has been destroyed
    bool anonymous_ = false;
    Obj my_;                            // command that also calls its private methods
    std::vector<Value> values_;         // one for each option
    std::vector<Reference> services_;   // of the options of type service; as long as values_, or empty
};

// An EXEC or an action of a service in Tcl. It runs in a coroutine of its own, so that it may wait: for time, for events, for other
// services, which then suspend only it. What it still owes when it first waits is answered later.
struct TclRun {
    TclService* service;                // null when its interpreter is gone
    Reference keep;
    bool isExec = true;
    Message said;                       // its warnings so far
    KeptCallPointer context;                    // of the request; null: it came from no request
    Reply reply;                        // set when it has waited
    Obj atCancel;                       // script
    bool done = false, cancelled = false;
    int code = 0;                       // when it is done: what Tcl has to say
    Obj result, options;
};

// What is being executed: by the coroutine that we are in, else by whoever called us.
Interpreter::Running runningNow(Interpreter& interpreter);

// While Tcl code of a coroutine makes a request: deadline and caller of the EXEC that runs in it, if it is one.
class InCoroutine {
public:
    InCoroutine(Interpreter& interpreter, Tcl_Obj* coroutine);
    ~InCoroutine();

private:
    std::shared_ptr<TclRun> run_;
    alignas(CallContext) unsigned char context_[sizeof(CallContext)];
};

// Creates ::sorma::Service, the declaration commands and sorma::fail, sorma::warn. False: see the interpreter's result.
bool initTclServices(Interpreter& interpreter);

// Look for a TclOO class of that service class name and add it to the SORM.
bool registerTclClass(Interpreter& interpreter, const std::string& name);
std::vector<std::string> tclClassNames(Interpreter& interpreter);

// The label by which callByName and its like know a TclOO object of a service class that somebody has made himself; from now on it
// has a service object. Empty: the command is no such object.
std::string labelOfObject(Interpreter& interpreter, std::string_view command);

void tclServiceRemoved(Interpreter& interpreter, const std::string& name);

}  // namespace sorma
