#include "unit.h"

namespace units {

namespace {

using sorma::Prototype;
using sorma::Severity;

const Prototype kNoPeriod{Severity::error, "UNIT PERIOD", 1,
                          "{}: it has no time step: run it in a cycle, in a circuit with -period, or give it a -period"};
const Prototype kWidth{Severity::error, "UNIT WIDTH", 1, "{}: EXEC expects {} floats, got {}"};

}  // namespace

Unit::Pins Unit::through(std::size_t fixed, std::size_t asked, const std::string& inUnit, const std::string& outUnit) const {
    std::size_t width = fixed ? fixed : asked;
    expect(width);
    return {{"in", true, 0, width, inUnit, {}}, {"out", false, 0, width, outUnit, {}}};
}

void Unit::failPeriod() const { fail(kNoPeriod, name()); }
void Unit::failWidth(std::size_t width, std::size_t got) const { fail(kWidth, name(), width, got); }

}  // namespace units

extern "C" SORMA_EXPORT int Units_Init(Tcl_Interp* interp) {
    using namespace units;
    return sorma::provide(interp, "sorma::service::units", "1.0",
                          {describeSum(), describeGain(), describeMatrix(), describeClip(), describeSquash(), describeLowpass(), describeIntegrator(),
                           describeDelay(), describeTable(), describeSelect(), describeSine(), describeNoise(), describeProbe()});
}
