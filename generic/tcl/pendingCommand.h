// pendingCommand.h -- a request that a Tcl command has begun, and that becomes the command's result later.
#pragma once

#include <memory>
#include <string>

#include "bus/reply.h"
#include "tcl/interpreter.h"

namespace sorma {

// The method of a request, and the form of its result.
struct RequestForm {
    // flat: RET ...; dict: as of exec; text: the text alone; oneOption: the value of `cget`; nothing: empty
    enum class Answer { flat, dict, text, oneOption, nothing };
    Method method = Method::exec;
    Answer answer = Answer::flat;
};

class PendingCommand {
public:
    PendingCommand(Interpreter& i, std::string name, RequestForm request, Future future, int objc, Tcl_Obj* const objv[]);
    const Future& future() const { return future_; }
    const std::string& name() const { return name_; }
    // When the future is done: set the interpreter's result and return TCL_OK, or raise the error. May be called again.
    int finish() const;

private:
    Interpreter& interpreter_;
    std::string name_;
    RequestForm request_;
    Future future_;
    Obj words_;                         // NAME METHOD word ..., for messages
};

// Begin NAME METHOD word ... and return without waiting. objv: the words, beginning with NAME. Null: wrong # args, with the
// message in the interpreter's result. author: whose rights it needs; null: the owner's. Throws Error when the request is malformed or the object cannot be made.
std::shared_ptr<PendingCommand> beginCommand(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[], Deadline deadline,
                                             const PrincipalPointer& author = nullptr);
// Send the same as a one-way request, which has no answer. False: wrong # args. Blocks and throws as Connection::oneway.
bool sendOneway(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[]);

}  // namespace sorma
