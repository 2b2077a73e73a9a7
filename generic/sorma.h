// sorma.h -- include this to write a service class, or to embed the bus in a C++ program.
//
// Reading order:
//     bus/message.h       requests and replies
//     bus/option.h        the description of a class
//     bus/service.h       the functions of a service class
//     bus/sorm.h          makes and finds service objects
//     bus/catalogue.h     raises errors
//
// A service package is one shared library that links libsorma alone, for Tcl 8.6 and Tcl 9 alike:
//
//     #include <sorma.h>
//
//     class Gain : public sorma::Service {
//     public:
//         static sorma::Class describe() {
//             return sorma::Class::of<Gain>("gain", "multiplies each float by a factor")
//                 .real("-factor", &Gain::factor_, {.unit = "1", .low = -100, .high = 100, .help = "multiplier"})
//                 .reads(sorma::Field::floats, sorma::atLeast(1), "1", "values")
//                 .writes(sorma::Field::floats, sorma::atLeast(1), "1", "values times factor")
//                 .example("gain EXEC FMSG 2 1.5 3");
//         }
//         void exec(sorma::Message& m) override { for (double& x : m.floats) x *= factor_; }
//     private:
//         double factor_ = 1;
//     };
//
//     extern "C" SORMA_EXPORT int Gain_Init(Tcl_Interp* interp) {
//         return sorma::provide(interp, "sorma::service::gain", "1.0", {Gain::describe()});
//     }
#pragma once

#include "bus/access.h"
#include "bus/budget.h"
#include "bus/call.h"
#include "bus/catalogue.h"
#include "bus/deadline.h"
#include "bus/dictionary.h"
#include "bus/message.h"
#include "bus/name.h"
#include "bus/option.h"
#include "bus/pieces.h"
#include "bus/requestText.h"
#include "bus/service.h"
#include "bus/sorm.h"
#include "bus/trail.h"

#define SORMA_EXPORT __attribute__((visibility("default")))

struct Tcl_Interp;

namespace sorma {

// Add service classes to the SORM of an interpreter, and tell Tcl that the package is loaded. Call it in the package's init
// procedure, in the interpreter's thread. Returns Tcl's code: 0; or 1 with a message in the interpreter's result when
// `package require sorma` is missing, or a class name is taken or malformed.
int provide(Tcl_Interp* interp, const char* package, const char* version, std::vector<Class> classes) noexcept;

}  // namespace sorma
