/* commandFrame.h -- makes `info frame` safe for a command that needs its caller's file and line.
 *
 * Without it `info frame` may read freed memory in a method that waits in several coroutines. commandFrame.c says why. */
#pragma once

#include <tcl.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What was changed, to be restored. */
struct SormaFrame {
    void *command, *call;
};

/* Call these two before and after `info frame`, in the same C function. Detach returns 0 where it can do nothing: it was compiled
 * without Tcl's private header, or for another release of Tcl. Then `info frame` is not safe in a coroutine that has waited. */
int sormaDetachFrame(Tcl_Interp *interp, struct SormaFrame *saved);
void sormaAttachFrame(const struct SormaFrame *saved);

#ifdef __cplusplus
}
#endif
