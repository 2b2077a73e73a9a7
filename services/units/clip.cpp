// clip -- each element between two bounds.
#include <algorithm>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kBounds{sorma::Severity::error, "OPTION RANGE", 2, "{}: {} {} is above -high {}"};

class Clip : public Unit {
public:
    void born() override { check(); }
    void changed(std::span<const sorma::Option* const>) override { check(); }

    void exec(sorma::Message& m) override {
        for (double& x : m.floats) x = std::clamp(x, low_, high_);
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(0, width, unit_, unit_); }

private:
    void check() {
        if (!(low_ <= high_)) fail(kBounds, name(), "-low", low_, high_);
    }

    double low_ = -sorma::kInfinity, high_ = sorma::kInfinity;
    friend sorma::Class units::describeClip();
};

}  // namespace

sorma::Class describeClip() {
    return sorma::Class::of<Clip>("clip", "keeps each element between two bounds")
        .real("-low", &Clip::low_, {.help = "smaller elements become this"})
        .real("-high", &Clip::high_, {.help = "larger elements become this"})
        .text("-unit", &Clip::unit_, kUnit)
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "values within the bounds; nan stays")
        .realtime()
        .repeatable()
        .example("clip EXEC FMSG 2 -7 7");
}

}  // namespace units
