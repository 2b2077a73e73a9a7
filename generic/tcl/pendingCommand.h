// pendingCommand.h -- a request that a Tcl command has made, and whose result is not there yet.
#pragma once

#include <memory>
#include <string>

#include "bus/reply.h"
#include "tcl/interpreter.h"

namespace sorma {

// What a request is, and how its answer becomes a result.
struct Request {
    enum class Answer { flat, dict, text, oneOption, nothing };
    Method method = Method::exec;
    Answer answer = Answer::flat;
};

class PendingCommand {
public:
    PendingCommand(Interpreter& i, std::string name, Request request, Future future, int objc, Tcl_Obj* const objv[]);
    const Future& future() const { return future_; }
    const std::string& name() const { return name_; }
    // The future is done: set the interpreter's result, or raise its error. Any number of times.
    int finish() const;

private:
    Interpreter& interpreter_;
    std::string name_;
    Request request_;
    Future future_;
    Obj words_;                         // NAME METHOD word ..., for messages
};

// NAME METHOD word ..., begun and not waited for. Null: wrong # args, the interpreter's result says so. Throws Error.
std::shared_ptr<PendingCommand> beginCommand(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[], Deadline deadline);
// The same without an answer. False: wrong # args.
bool sendOneway(Interpreter& i, std::string_view name, int objc, Tcl_Obj* const objv[]);

}  // namespace sorma
