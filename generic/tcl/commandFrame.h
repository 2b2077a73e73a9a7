/* commandFrame.h -- makes `info frame` safe for a command that only wants its caller's file and line. See commandFrame.c. */
#pragma once

#include <tcl.h>

#ifdef __cplusplus
extern "C" {
#endif

struct SormaFrame {
    void *command, *call;
};

/* Before and after the look. Returns 0 where it can do nothing: Tcl's private header was not there, or this is another Tcl. */
int sormaDetachFrame(Tcl_Interp *interp, struct SormaFrame *saved);
void sormaAttachFrame(const struct SormaFrame *saved);

#ifdef __cplusplus
}
#endif
