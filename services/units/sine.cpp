// sine -- offset + amplitude sin(2 pi frequency t + phase), t from the times at which ticks were due.
#include <cmath>
#include <numbers>

#include "unit.h"

namespace units {

namespace {

class Sine : public Unit {
public:
    void exec(sorma::Message& m) override {
        double now = clock_.seconds(sorma::Tick::current() ? 0 : timeStep(period_));
        if (frequency_ != turnsFrequency_) {        // go on from where it is: a new frequency makes no jump
            turns_ += turnsFrequency_ * (now - since_);
            turns_ -= std::floor(turns_);
            since_ = now;
            turnsFrequency_ = frequency_;
        }
        double turns = turns_ + frequency_ * (now - since_);
        turns -= std::floor(turns);
        m.floats.resize(1);
        m.floats[0] = offset_ + amplitude_ * std::sin(2 * std::numbers::pi * turns + phase_);
    }

    Pins pins(std::string_view, std::size_t) const override { return {{"out", false, 0, 1, unit_, {}}}; }

private:
    void reset(sorma::Args, sorma::Message&) {
        clock_.reset();
        turns_ = since_ = 0;
        turnsFrequency_ = frequency_;
    }

    double frequency_ = 1, amplitude_ = 1, phase_ = 0, offset_ = 0, period_ = 0;
    Clock clock_;
    double turns_ = 0, since_ = 0, turnsFrequency_ = 0;     // turns_ since the begin of time at since_; then the frequency counts
    friend sorma::Class units::describeSine();
};

}  // namespace

sorma::Class describeSine() {
    return sorma::Class::of<Sine>("sine", "offset + amplitude sin(2 pi frequency t + phase)")
        .real("-frequency", &Sine::frequency_, {.unit = "Hz", .low = 0, .high = 1e9, .help = "a new one goes on without a jump"})
        .real("-amplitude", &Sine::amplitude_, {.help = "half of what lies between top and bottom"})
        .real("-phase", &Sine::phase_, {.unit = "rad", .help = "at time 0"})
        .real("-offset", &Sine::offset_, {.help = "mean"})
        .real("-period", &Sine::period_, kPeriod)
        .text("-unit", &Sine::unit_, {.help = "unit of measurement of what comes out"})
        .action("-reset", &Sine::reset, "", "time is 0 again")
        .writes(sorma::Field::floats, sorma::exactly(1), "", "the value at the time of this tick")
        .realtime()
        .example("sine CTRL -frequency 50 -period 0.001");
}

}  // namespace units
