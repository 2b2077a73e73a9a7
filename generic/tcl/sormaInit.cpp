// sormaInit.cpp -- what Tcl's `load` calls.
#include <string>

#include "tcl/anonymous.h"
#include "tcl/commands.h"
#include "tcl/eventLoops.h"
#include "tcl/interpreter.h"
#include "tcl/processCommands.h"
#include "tcl/soCommand.h"
#include "tcl/streamCommand.h"
#include "tcl/tclService.h"
#include "tcl/traceCommand.h"

#if __has_include("tcl/commCommands.h")
#include "tcl/asyncCommands.h"
#include "tcl/commCommands.h"
#define SORMA_COMM 1
#endif

#ifndef SORMA_VERSION
#define SORMA_VERSION "1.0"
#endif

namespace {

using namespace sorma;

int init(Tcl_Interp* interp, bool safe) {
    if (!Tcl_InitStubs(interp, "8.6-", 0) || !Tcl_OOInitStubs(interp)) return TCL_ERROR;      // before any other call
    safe = safe || Tcl_IsSafe(interp);
    if (Interpreter::of(interp)) return Tcl_PkgProvideEx(interp, "sorma", SORMA_VERSION, nullptr);
    if (!Tcl_FindNamespace(interp, "::sorma", nullptr, 0)) Tcl_CreateNamespace(interp, "::sorma", nullptr, nullptr);
    try {
        auto* interpreter = new Interpreter(interp, safe);
        return guarded(*interpreter, 0, nullptr, [&] {
            initSoCommands(*interpreter);
            if (!initTclServices(*interpreter)) return TCL_ERROR;
            initCommands(*interpreter);
            initAnonymous(*interpreter);
            initProcessCommands(*interpreter);
            initTraceCommand(*interpreter);
            initStreamCommand(*interpreter);
            wrapEventLoops(*interpreter);
#ifdef SORMA_COMM
            initCommCommands(*interpreter);
            initAsyncCommands(*interpreter);
#endif
            if (Tcl_EvalEx(interp, "::namespace eval ::sorma {::namespace ensemble create -command ::sorma}", -1,
                           TCL_EVAL_GLOBAL) != TCL_OK)
                return TCL_ERROR;
            if (!safe) interpreter->sorm.dictionary().loadEnvironment();
            Tcl_ResetResult(interp);
            return Tcl_PkgProvideEx(interp, "sorma", SORMA_VERSION, nullptr);
        });
    } catch (const std::exception& e) {
        Tcl_SetObjResult(interp, Tcl_NewStringObj(e.what(), -1));
        return TCL_ERROR;
    }
}

}  // namespace

extern "C" DLLEXPORT int Sorma_Init(Tcl_Interp* interp) { return init(interp, false); }

// A safe interpreter cannot load the package itself; its parent does, `load {} Sorma CHILD` once it has it, and may
// grant it more: `sorma::grant CHILD allow reach on robot`.
extern "C" DLLEXPORT int Sorma_SafeInit(Tcl_Interp* interp) { return init(interp, true); }
