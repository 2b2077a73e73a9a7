// squash -- a vector made shorter: nothing below a null radius, then a gain, up to a limit; its direction is kept.
//
// out = 0 for r <= null, else (in / r) min(gain (r - null), limit), with r = |in|: continuous, and the same in all directions.
// For a force or a hand controller that shall move something: noise is held back, and no input is too large.
#include <algorithm>
#include <cmath>

#include "unit.h"

namespace units {

namespace {

class Squash : public Unit {
public:
    void exec(sorma::Message& m) override {
        double sum = 0;
        for (double x : m.floats) sum += x * x;
        const double r = std::sqrt(sum);
        // Written so that NaN is nothing, too: it must not move anything.
        const double factor = r > null_ && std::isfinite(r) ? std::min(gain_ * (r - null_), limit_) / r : 0;
        for (double& x : m.floats) x = factor == 0 ? 0 : x * factor;
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(0, width, unit_, outUnit_); }

private:
    double null_ = 0, gain_ = 1, limit_ = sorma::kInfinity;
    friend sorma::Class units::describeSquash();
};

}  // namespace

sorma::Class describeSquash() {
    return sorma::Class::of<Squash>("squash", "shortens a vector: nothing below a null radius, then a gain up to a limit; keeps its direction")
        .real("-null", &Squash::null_, {.low = 0, .help = "a vector that is not longer than this becomes 0"})
        .real("-gain", &Squash::gain_, {.help = "for what is beyond -null"})
        .real("-limit", &Squash::limit_, {.low = 0, .help = "the result is not longer than this"})
        .text("-unit", &Squash::unit_, kInUnit)
        .text("-outUnit", &Squash::outUnit_, kOutUnit)
        .reads(sorma::Field::floats, {}, "", "components of the vector")
        .writes(sorma::Field::floats, {}, "", "the shorter vector; 0 when one that came is nan or infinite")
        .realtime()
        .repeatable()
        .example("squash CTRL -null 2 -gain 0.01 -limit 0.15");
}

}  // namespace units
