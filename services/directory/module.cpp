// The module has no class: COMM loads it as if it had one, and finds its rows.
#include <sorma.h>

#include "rows.h"

extern "C" SORMA_EXPORT int Directory_Init(Tcl_Interp* interp) {
    directory::addRows();
    return sorma::provide(interp, "sorma::service::directory", "1.0", {});
}
