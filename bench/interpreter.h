// interpreter.h -- a Tcl interpreter inside the benchmark, with the package loaded as any tclsh would load it.
#pragma once

#include <string>

#include "sorma.h"
#include "tcl/tclShim.h"

namespace bench {

class Interpreter {
public:
    Interpreter();          // throws when `package require sorma` fails
    ~Interpreter();
    Interpreter(const Interpreter&) = delete;
    Interpreter& operator=(const Interpreter&) = delete;

    // Its SORM: what C++ calls here is what the scripts call.
    sorma::Sorm& sorm() const { return *sorm_; }
    Tcl_Interp* tcl() const { return interp_; }

    std::string eval(const std::string& script);        // throws the error message

    // Operations of a body that runs calls from a compiled loop; kUnrolled calls are one operation.
    static constexpr int kUnrolled = 20;
    // Defines a procedure that makes so many operations of the call; returns its name.
    std::string loop(const std::string& call);
    void run(const std::string& loop, std::int64_t count);

private:
    Tcl_Interp* interp_;
    sorma::Sorm* sorm_;
    int loops_ = 0;
};

}  // namespace bench
