// soCommand.h -- a service object as a Tcl command.
//
// The command ::sorma::so::NAME is made when the name is used for the first time, and ::NAME beside it unless another
// command has that name. The handler of unknown words notices the first use: see unknown.h.
//
// Threads: the interpreter's.
// Re-entry: a call runs the object, which may call anything: its object may be removed, its command deleted and its
//           interpreter deleted before it returns. Each call keeps the object alive until it has returned.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

inline constexpr std::string_view kSoNamespace = "::sorma::so::";

void initSoCommands(Interpreter& interpreter);

// Make the object and its commands when need be. Returns the word by which you call it: NAME, or ::sorma::so::NAME where
// NAME is another command. Throws Error.
std::string commandOf(Interpreter& interpreter, std::string_view name);

// Send a request to the object of that name, as its command does: objv[1] is the method. Sets the interpreter's result and
// returns Tcl's code. Throws Error.
int callByName(Interpreter& interpreter, std::string_view name, int objc, Tcl_Obj* const objv[], Probe probe = Probe::now);

// The object of that name, or of the command of a TclOO object that a script has made. Made when need be; no daemon is asked.
Reference objectOf(Interpreter& interpreter, std::string_view name);

// Is the word one of the methods of a service object's command?
bool isSoMethod(Tcl_Obj* word);
[[noreturn]] void badMethod(Tcl_Obj* word);
// The request as text, from the words of the command: what `sorma::trail` shows to reproduce it.
std::string requestAsTyped(const std::string& name, int objc, Tcl_Obj* const objv[]);

// An object that is not in the repository: callByName finds it by its label, which is no name, until releaseAnonymous.
// command: make this command for it. When the command is deleted, the object ends. Empty: it has a command already.
void bindAnonymous(Interpreter& interpreter, const std::string& label, Reference so, const std::string& command = {});
void releaseAnonymous(Interpreter& interpreter, const std::string& label);
bool isBound(Interpreter& interpreter, const std::string& label);
// All such objects that have had a request, each with its command; or the one that a word calls from the present namespace. Null:
// none.
std::vector<std::pair<std::string, Reference>> anonymousObjects(Interpreter& interpreter);
Service* anonymousObject(Interpreter& interpreter, const std::string& command);

// The object of that name was removed: delete its commands.
void deleteCommands(Interpreter& interpreter, const std::string& name);
// The interpreter ends: release all objects.
void releaseBindings(Interpreter& interpreter);

}  // namespace sorma
