// tclServiceParts.h -- shared by the files that implement service classes in Tcl. No other file includes it.
//
//     tclClasses.cpp       finds a class's declarations, superclasses and places in files; makes trails of Tcl errors
//     tclDeclarations.cpp  sorma::option and the other declarations, and the service class that is made of them
//     tclService.cpp       the service object
//     tclRuns.cpp          EXECs and actions, each in a coroutine of its own
//     tclPieces.cpp        EXECs whose reply is read in pieces
//     tclMethods.cpp       commands for methods, and requests to objects and classes that are TclOO commands
//     tclService.tcl       all that needs no C++; the build puts it into tclServiceScript.h
#pragma once

#include <utility>

#include "tcl/tclService.h"

namespace sorma {

struct OptionDeclaration {
    Option option;
    bool measured = false;              // it has no set, see bus/measured.h
    Value initial;
};

// The declarations of one TclOO class. The class's metadata has a reference, and so has each SORM class that was made of it.
struct TclClass {
    Interpreter* interpreter = nullptr;
    Tcl_Class tcl = nullptr;            // null when the TclOO class has been deleted
    std::string service;                // name of the service class
    std::string purpose, words, example, version, concurrency, flavors;
    double testedAtBirth = 0;               // [s]; 0: it is not
    std::vector<Class::Word> wordKinds;     // of words
    std::vector<OptionDeclaration> options;
    std::vector<Action> actions, inspections;
    std::vector<Part> reads, writes;
    std::vector<std::pair<Danger, std::vector<std::string>>> dangers;   // of EXEC, see Class::execDanger
    std::vector<std::vector<std::string>> repeatables;      // see Class::repeatable
    std::string file;                   // of its first declaration
    int line = 0;
    std::string path;                   // of that file, with its folders
};

namespace tcloo {

inline const Prototype kTcl{Severity::error, "SERVICE FAILED", 1, "{}: {}"};
inline const Prototype kForeignCode{Severity::error, "SERVICE CODE", 1, "{}: {}"};     // Entry::kForeign
inline const Prototype kStep{Severity::error, "SERVICE FAILED", 0, "{} failed: {}"};
inline const Prototype kObjectGone{Severity::error, "SERVICE GONE", 1, "{}: its TclOO object has been destroyed"};
inline const Prototype kInterpGone{Severity::error, "SERVICE GONE", 1, "{}: its interpreter was deleted while it was executing"};

using ClassHandle = std::shared_ptr<TclClass>;
// Metadata: of a TclOO class its ClassHandle, of an object its TclService.
extern const Tcl_ObjectMetadataType kClassData, kObjectData;

// ---- tclClasses.cpp ----
std::string serviceName(std::string_view tclClass);                 // "::my::Carry" becomes "carry"
std::string objectName(Tcl_Interp* interp, Tcl_Object object);      // its command, fully qualified
// The declarations of a class; made when it has none yet. From then on the class's command answers requests.
TclClass& declarationsOf(Interpreter& i, Tcl_Class type);
// The class and its superclasses, the class itself last, without ::sorma::Service. Throws Error when Tcl cannot tell.
std::vector<TclClass*> lineage(Interpreter& i, const std::string& tclClass);
// The commands of all service classes.
std::vector<std::string> tclClasses(Interpreter& i);
// Evaluate a command. False: it failed; the result is in the interpreter in either case. Frees words that are new values.
bool eval(Interpreter& i, std::initializer_list<Tcl_Obj*> words, int flags = TCL_EVAL_GLOBAL);
inline Tcl_Obj* str(std::string_view text) { return newText(text); }
// Sets file and line of the command that is being evaluated, as far as Tcl knows them. Returns the file with its folders.
// resumed: it is in a coroutine that has waited.
std::string whereAmI(Interpreter& i, std::string& file, int& line, bool resumed = false);
// The error of a method as a trail, from the interpreter's result and error options.
Trail trailOfTclError(Interpreter& i, int code, const std::string& so, const Class& type);

// While this exists the code of a service object is evaluated: sets Interpreter::running, and keeps the interpreter alive.
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
std::shared_ptr<TclRun> currentRun(Interpreter& i);     // the run whose coroutine we are in; null: none
void initRuns(Interpreter& i);

// ---- tclPieces.cpp ----
void initPieces(Interpreter& i);

// ---- tclDeclarations.cpp ----
void initDeclarations(Interpreter& i);

// ---- tclMethods.cpp ----
TclService& serviceOf(Interpreter& i, Tcl_Object object);       // its service object; made when it has none yet
void answerRequests(Interpreter& i, Tcl_Object serviceClass);   // from now on the class's command answers EXEC, CTRL and DBX
bool initMethods(Interpreter& i);

inline int wrongArgs(Tcl_Interp* interp, Tcl_Obj* const objv[], const char* usage) {
    Tcl_WrongNumArgs(interp, 1, objv, usage);
    return TCL_ERROR;
}

}  // namespace tcloo

}  // namespace sorma
