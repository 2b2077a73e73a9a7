// robot -- the classes of the arm: pino, mvpos, wspc, push, calibrate, follow; and units beside it: sighting, fresh.
#include "calibrate.h"
#include "follow.h"
#include "fresh.h"
#include "mvpos.h"
#include "pino.h"
#include "push.h"
#include "sighting.h"
#include "wspc.h"

extern "C" SORMA_EXPORT int Robot_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::robot", "1.0",
                          {robot::Pino::describe(), robot::Mvpos::describe(), robot::Wspc::describe(),
                           robot::Push::describe(),
                           robot::Calibrate::describe(), robot::Follow::describe(),
                           robot::Sighting::describe(), robot::Fresh::describe()});
}
