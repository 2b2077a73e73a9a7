// tclServiceParts.h -- what the parts of service classes in Tcl share:
//
//     tclClasses.cpp       what Tcl knows of a class: our data at it, its ancestors, places in files, errors as trails
//     tclDeclarations.cpp  sorma::option and the like, and the service class that is made of them
//     tclService.cpp       the service object
//     tclRuns.cpp          EXECs and actions, each in a coroutine of its own
//     tclMethods.cpp       what methods may call, and what objects and classes answer beside them
//     tclService.tcl       what does not need C++; the build puts it into tclServiceScript.h
#pragma once

#include <utility>

#include "tcl/tclService.h"

namespace sorma {

struct OptionDeclaration {
    Option option;
    Value initial;
};

// What the body of a TclOO class has declared. Held by the class itself, and goes with it.
struct TclClass {
    Interpreter* interpreter = nullptr;
    Tcl_Class tcl = nullptr;            // null when the TclOO class has been destroyed
    std::string service;                // name of the service class
    std::string purpose, words, example, version, conduct;
    std::vector<OptionDeclaration> options;
    std::vector<Action> actions, inspections;
    std::vector<Part> reads, writes;
    std::string file;                   // of its first declaration
    int line = 0;
    std::string path;                   // of that file, with its folders
};

namespace tcloo {

inline const Prototype kTcl{Severity::error, "SERVICE FAILED", 1, "{}: {}"};
inline const Prototype kStep{Severity::error, "SERVICE FAILED", 0, "{} failed: {}"};
inline const Prototype kObjectGone{Severity::error, "SERVICE GONE", 1, "{}: its TclOO object has been destroyed"};
inline const Prototype kInterpGone{Severity::error, "SERVICE GONE", 1, "{}: its interpreter was deleted while it was executing"};

using ClassHandle = std::shared_ptr<TclClass>;      // also held by what the SORM makes of it
extern const Tcl_ObjectMetadataType kClassData, kObjectData;    // at a class its ClassHandle, at an object its TclService

// ---- tclClasses.cpp ----
std::string serviceName(std::string_view tclClass);
std::string objectName(Tcl_Interp* interp, Tcl_Object object);
// Of a class; made when it has none yet. From then on its command answers requests.
TclClass& declarationsOf(Interpreter& i, Tcl_Class type);
// Classes from the root of the services down to this one, without the root.
std::vector<TclClass*> lineage(Interpreter& i, const std::string& tclClass);
// All service classes, as commands.
std::vector<std::string> tclClasses(Interpreter& i);
bool eval(Interpreter& i, std::initializer_list<Tcl_Obj*> words, int flags = TCL_EVAL_GLOBAL);
inline Tcl_Obj* str(std::string_view text) { return newText(text); }
// File and line of the command that is being evaluated, as far as Tcl knows. resumed: of a coroutine that has waited.
// Returns the file with its folders.
std::string whereAmI(Interpreter& i, std::string& file, int& line, bool resumed = false);
// What went wrong in a method, from the interpreter's result and error options, as a trail.
Trail trailOfTclError(Interpreter& i, int code, const std::string& so, const Class& type);

// While the code of a service object is evaluated: what runs, and an interpreter that stays.
class Executing {
public:
    Executing(Interpreter& interpreter, Interpreter::Running running)
        : interpreter_(interpreter), outer_(std::exchange(interpreter.running, running)), kept_(interpreter) {}
    ~Executing() { interpreter_.running = outer_; }
    Executing(const Executing&) = delete;
    Executing& operator=(const Executing&) = delete;
private:
    Interpreter& interpreter_;
    Interpreter::Running outer_;
    Interpreter::Kept kept_;
};

// ---- tclRuns.cpp ----
std::shared_ptr<TclRun> currentRun(Interpreter& i);     // of the coroutine that we are in; null: of none
void initRuns(Interpreter& i);

// ---- tclDeclarations.cpp ----
void initDeclarations(Interpreter& i);

// ---- tclMethods.cpp ----
TclService& serviceOf(Interpreter& i, Tcl_Object object);       // made when it has none yet
void answerRequests(Interpreter& i, Tcl_Object serviceClass);   // of other classes nothing is changed
bool initMethods(Interpreter& i);

inline int wrongArgs(Tcl_Interp* interp, Tcl_Obj* const objv[], const char* usage) {
    Tcl_WrongNumArgs(interp, 1, objv, usage);
    return TCL_ERROR;
}

}  // namespace tcloo

}  // namespace sorma
