// soCommand.h -- a service object as a Tcl command.
//
// The command ::sorma::so::NAME comes to be when the name is first mentioned, and ::NAME beside it unless some other
// command has that name. First mention is noticed by the global namespace's unknown handler, which passes on to the
// handler that was there before whatever is no request: `NAME METHOD ...` where METHOD is one of EXEC CTRL DBX exec
// configure cget info destroy and the class of NAME can be found, or a NAME with @, or the prefix sorma::so::.
#pragma once

#include "tcl/interpreter.h"

namespace sorma {

void initSoCommands(Interpreter& interpreter);

// Makes the object and its commands when need be. Returns the word by which it is called: NAME, or ::sorma::so::NAME
// where NAME is some other command. Throws Error.
std::string commandOf(Interpreter& interpreter, std::string_view name);

// A request to the object of that name, as its command makes it: objv[1] is the method. Throws Error.
int callByName(Interpreter& interpreter, std::string_view name, int objc, Tcl_Obj* const objv[]);

// Is the word one of the methods of a service object's command?
bool isSoMethod(Tcl_Obj* word);

// An object that no name leads to: from now on `label`, which is no name, means it for callByName, until it is released.
void bindAnonymous(Interpreter& interpreter, const std::string& label, Reference so);
void releaseAnonymous(Interpreter& interpreter, const std::string& label);
bool isBound(Interpreter& interpreter, const std::string& label);

void deleteCommands(Interpreter& interpreter, const std::string& name);
void releaseBindings(Interpreter& interpreter);     // the interpreter ends: let go of the objects

}  // namespace sorma
