// noise -- gaussian random numbers, the same for the same seed.
#include "random.h"
#include "unit.h"

namespace units {

namespace {

class Noise : public Unit {
public:
    void born() override { begin(); }
    void changed(std::span<const sorma::Option* const>) override {
        if (seed_ != begunWith_) begin();
    }

    void exec(sorma::Message& m) override {
        m.floats.resize(width_);
        for (double& x : m.floats) x = mean_ + deviation_ * random_.gaussian();
    }

    Pins pins(std::string_view, std::size_t) const override { return {{"out", false, 0, width_, unit_, {}}}; }

private:
    void begin() {
        random_ = Random(std::uint64_t(seed_));
        begunWith_ = seed_;
    }
    void reset(sorma::Args, sorma::Message&) { begin(); }

    double deviation_ = 1, mean_ = 0;
    std::size_t width_ = 1;
    std::int64_t seed_ = 1, begunWith_ = 1;
    Random random_{1};
    friend sorma::Class units::describeNoise();
};

}  // namespace

sorma::Class describeNoise() {
    return sorma::Class::of<Noise>("noise", "gaussian random numbers, the same for the same seed")
        .real("-deviation", &Noise::deviation_, {.low = 0, .high = 1e300, .help = "standard deviation"})
        .real("-mean", &Noise::mean_, {.help = "mean"})
        .integer("-width", &Noise::width_, {.low = 1, .high = 100'000, .help = "numbers for each request"})
        .integer("-seed", &Noise::seed_, {.help = "a new value begins again"})
        .text("-unit", &Noise::unit_, {.help = "unit of measurement of what comes out"})
        .action("-reset", &Noise::reset, "", "begin again")
        .writes(sorma::Field::floats, {}, "", "-width numbers")
        .realtime()
        .example("noise EXEC");
}

}  // namespace units
