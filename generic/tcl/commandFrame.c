/* commandFrame.c -- `info frame` in a method that waits in several coroutines at once.
 *
 * Tcl notes in the method, which all its invocations share, where the facts about the present one are (procPtr->cmdPtr, set by
 * PushMethodCallFrame of tclOOMethod.c). When one of them has ended while another one waited, `info frame` in that one reads
 * what has been freed, and the process ends. Seen with Tcl 8.6.13; that of 9.0 reads alike. File and line do not need these
 * facts: without its call frame a command frame tells them, and nothing else.
 *
 * This needs Tcl's private header, and is done only with the very Tcl release for which it was compiled.
 */
#include "tcl/commandFrame.h"

#ifdef SORMA_TCL_PRIVATE
#include <tclInt.h>

static int isCompiledFor(void)
{
    int major, minor, patch, type;
    Tcl_GetVersion(&major, &minor, &patch, &type);
    return major == TCL_MAJOR_VERSION && minor == TCL_MINOR_VERSION && patch == TCL_RELEASE_SERIAL && type == TCL_RELEASE_LEVEL;
}

int sormaDetachFrame(Tcl_Interp *interp, struct SormaFrame *saved)
{
    CmdFrame *frame = ((Interp *) interp)->cmdFramePtr;
    saved->command = saved->call = NULL;
    if (!isCompiledFor()) return 0;
    if (!frame) return 1;
    saved->command = frame;
    saved->call = frame->framePtr;
    frame->framePtr = NULL;
    return 1;
}

void sormaAttachFrame(const struct SormaFrame *saved)
{
    if (saved->command) ((CmdFrame *) saved->command)->framePtr = saved->call;
}

#else

int sormaDetachFrame(Tcl_Interp *interp, struct SormaFrame *saved)
{
    (void) interp, (void) saved;
    return 0;
}

void sormaAttachFrame(const struct SormaFrame *saved) { (void) saved; }

#endif
