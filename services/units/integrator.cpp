// integrator -- the integral of what comes, by forward Euler: y[k+1] = y[k] + T u[k], kept within bounds.
//
// It writes y[k] before it has seen u[k]: so it may close a loop. The integral stops at a bound, so it comes back at once when
// the sign of u changes.
#include <algorithm>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kBounds{sorma::Severity::error, "OPTION RANGE", 2, "{}: {} {} is above -high {}"};

class Integrator : public Unit {
public:
    void born() override { check(); }
    void changed(std::span<const sorma::Option* const>) override { check(); }

    void exec(sorma::Message& m) override {
        if (m.floats.empty()) return peek(m.floats);
        double step = timeStep(period_);
        if (value_.size() != m.floats.size()) [[unlikely]] begin(m.floats.size());
        for (std::size_t i = 0; i < value_.size(); ++i) {
            double now = value_[i];
            value_[i] = std::clamp(now + step * m.floats[i], low_, high_);
            m.floats[i] = now;
        }
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(widthOf(initial_), width, unit_, outUnit_); }

    void dumpState(std::string& out) const override {
        if (!value_.empty()) out += "# value " + sorma::toText(sorma::Value(value_)) + "\n";
    }

private:
    void peek(std::vector<double>& out) const {
        auto& next = value_.empty() ? initial_ : value_;
        out.assign(next.begin(), next.end());
    }
    void begin(std::size_t width) {
        if (widthOf(initial_)) needWidth(initial_.size(), width);
        value_.resize(width);
        for (std::size_t i = 0; i < width; ++i) value_[i] = at(initial_, i);
    }
    void check() {
        if (!(low_ <= high_)) fail(kBounds, name(), "-low", low_, high_);
    }
    void reserve(std::size_t width) override { value_.reserve(width); }
    void reset(sorma::Args, sorma::Message&) { value_.clear(); }

    double low_ = -sorma::kInfinity, high_ = sorma::kInfinity, period_ = 0;
    std::vector<double> initial_ = {0}, value_;     // value_: empty before the first request
    friend sorma::Class units::describeIntegrator();
};

}  // namespace

sorma::Class describeIntegrator() {
    return sorma::Class::of<Integrator>("integrator", "integrates each element over time; may close a loop")
        .vector("-initial", &Integrator::initial_, kInitial)
        .real("-low", &Integrator::low_, {.help = "the integral stops here"})
        .real("-high", &Integrator::high_, {.help = "and here"})
        .real("-period", &Integrator::period_, kPeriod)
        .text("-unit", &Integrator::unit_, kInUnit)
        .text("-outUnit", &Integrator::outUnit_, kOutUnit)
        .action("-reset", &Integrator::reset, "", "begin again")
        .reads(sorma::Field::floats, {}, "", "values; none: change nothing")
        .writes(sorma::Field::floats, {}, "", "the integral up to the request before this one")
        .realtime()
        .withoutFeedthrough()
        .example("integrator CTRL -period 0.001");
}

}  // namespace units
