#include "interpreter.h"

#include <stdexcept>

namespace bench {

Interpreter::Interpreter() : interp_(Tcl_CreateInterp()) {
    try {
        if (Tcl_Init(interp_) != TCL_OK) throw std::runtime_error(Tcl_GetStringResult(interp_));
        eval("package require sorma");
        sorm_ = sorma::Sorm::of(interp_);
        if (!sorm_) throw std::runtime_error("the package and this program do not share one libsorma");
    } catch (...) {
        Tcl_DeleteInterp(interp_);
        throw;
    }
}

Interpreter::~Interpreter() { Tcl_DeleteInterp(interp_); }

std::string Interpreter::eval(const std::string& script) {
    if (Tcl_EvalEx(interp_, script.c_str(), -1, TCL_EVAL_GLOBAL) != TCL_OK)
        throw std::runtime_error(Tcl_GetStringResult(interp_));
    return Tcl_GetStringResult(interp_);
}

std::string Interpreter::loop(const std::string& call) {
    std::string name = "::benchLoop" + std::to_string(++loops_), body;
    for (int i = 0; i < kUnrolled; ++i) body += call + "\n";
    eval("proc " + name + " n {for {set i 0} {$i < $n} {incr i} {\n" + body + "}}");
    return name;
}

void Interpreter::run(const std::string& loop, std::int64_t count) {
    sorma::Obj name(Tcl_NewStringObj(loop.c_str(), -1)), n(Tcl_NewWideIntObj(count));
    Tcl_Obj* words[] = {name, n};
    if (Tcl_EvalObjv(interp_, 2, words, TCL_EVAL_GLOBAL) != TCL_OK) throw std::runtime_error(Tcl_GetStringResult(interp_));
}

}  // namespace bench
