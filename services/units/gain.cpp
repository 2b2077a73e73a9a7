// gain -- each element times a factor.
#include "unit.h"

namespace units {

namespace {

class Gain : public Unit {
public:
    void exec(sorma::Message& m) override {
        if (gain_.size() == 1) {
            for (double& x : m.floats) x *= gain_[0];
            return;
        }
        needWidth(gain_.size(), m.floats.size());
        for (std::size_t i = 0; i < gain_.size(); ++i) m.floats[i] *= gain_[i];
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(widthOf(gain_), width, unit_, outUnit_); }

private:
    std::vector<double> gain_ = {1};
    friend sorma::Class units::describeGain();
};

}  // namespace

sorma::Class describeGain() {
    return sorma::Class::of<Gain>("gain", "multiplies each element by a factor")
        .vector("-gain", &Gain::gain_, {.help = "factors; one number stands for every width", .minLength = 1})
        .text("-unit", &Gain::unit_, kInUnit)
        .text("-outUnit", &Gain::outUnit_, kOutUnit)
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "values times factors")
        .realtime()
        .repeatable()
        .example("gain EXEC FMSG 2 1.5 3");
}

}  // namespace units
