// nop -- does nothing, well: the smallest service class there is, and the measure of what a call costs.
#include <sorma.h>

namespace {

class Nop : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Nop>("nop", "does nothing, and says that it is done").realtime().repeatable().example("nop EXEC");
    }
    void exec(sorma::Message&) override {}
};

}  // namespace

extern "C" SORMA_EXPORT int Nop_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::nop", "1.0", {Nop::describe()});
}
