// lowpass -- first-order low-pass filter, exact at every time step.
//
// The equation is y' = w (u - y), w = 2 pi cutoff, solved over a step T. In the step u has the value of its end:
//     y[k] = y[k-1] + (1 - exp(-w T)) (u[k] - y[k-1])
//
// Source: the solution of a first-order system by its step response, Åström and Wittenmark, Computer-Controlled Systems,
// 3rd edition, section 2.3. Here u comes from the end of the step instead of its begin, so the filter does not lag one more tick.
#include <cmath>
#include <numbers>

#include "unit.h"

namespace units {

namespace {

class Lowpass : public Unit {
public:
    void exec(sorma::Message& m) override {
        double step = timeStep(period_);
        if (step != step_ || cutoff_ != stepCutoff_) {
            step_ = step, stepCutoff_ = cutoff_;
            share_ = -std::expm1(-2 * std::numbers::pi * cutoff_ * step);
        }
        if (state_.size() != m.floats.size()) [[unlikely]] begin(m.floats);
        for (std::size_t i = 0; i < state_.size(); ++i) {
            // Values that are not finite pass, but do not stay.
            const double next = state_[i] + share_ * (m.floats[i] - state_[i]);
            m.floats[i] = next;
            if (std::isfinite(next)) [[likely]] state_[i] = next;
        }
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(widthOf(initial_), width, unit_, unit_); }

    void dumpState(std::string& out) const override {
        if (!state_.empty()) out += "# value " + sorma::toText(sorma::Value(state_)) + "\n";
    }

private:
    void begin(const std::vector<double>& first) {
        if (widthOf(initial_)) needWidth(initial_.size(), first.size());
        state_ = first;
        if (!initial_.empty())
            for (std::size_t i = 0; i < state_.size(); ++i) state_[i] = at(initial_, i);
    }
    void reserve(std::size_t width) override { state_.reserve(width); }
    void reset(sorma::Args, sorma::Message&) { state_.clear(); }

    double cutoff_ = 1, period_ = 0;
    std::vector<double> initial_, state_;
    double step_ = 0, stepCutoff_ = 0, share_ = 0;      // share_ holds for the two others
    friend sorma::Class units::describeLowpass();
};

}  // namespace

sorma::Class describeLowpass() {
    return sorma::Class::of<Lowpass>("lowpass", "first-order low-pass filter, exact at every time step")
        .real("-cutoff", &Lowpass::cutoff_, {.unit = "Hz", .low = 1e-9, .high = 1e9, .help = "frequency at which half of the power is left"})
        .vector("-initial", &Lowpass::initial_,
                {.help = "value before the first request; empty: what that one brings; one number stands for every width"})
        .real("-period", &Lowpass::period_, kPeriod)
        .text("-unit", &Lowpass::unit_, kUnit)
        .action("-reset", &Lowpass::reset, "", "begin again")
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "values, smoothed")
        .realtime()
        .example("lowpass CTRL -cutoff 2.5 -period 0.001");
}

}  // namespace units
