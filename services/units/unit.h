// unit.h -- the base of the units of circuits: sum, gain, matrix, clip, squash, lowpass, integrator, delay, table, select,
// sine, noise, probe.
//
// All of them may be steps of a cycle: EXEC does not allocate, not even at its first call in a circuit.
// Widths follow from the wires. Units with a state reset it when their width changes.
#pragma once

#include <string>
#include <vector>

#include <sorma.h>

namespace units {

sorma::Class describeSum(), describeGain(), describeMatrix(), describeClip(), describeSquash(), describeLowpass(), describeIntegrator(),
    describeDelay(), describeTable(), describeSelect(), describeSine(), describeNoise(), describeProbe();

class Unit : public sorma::Service {
protected:
    using Pins = std::vector<sorma::Pin>;

    static constexpr std::size_t kMostWidth = 1'000'000;

    // in and out of one width: `fixed` when the options say it, else what was asked for, else open.
    Pins through(std::size_t fixed, std::size_t asked, const std::string& inUnit, const std::string& outUnit) const;
    // A circuit that wires a unit asks for its pins at a width: allocate the memory for it now, so that no tick has to.
    void expect(std::size_t width) const {
        if (width <= kMostWidth) const_cast<Unit*>(this)->reserve(width);
    }
    virtual void reserve(std::size_t width) { (void)width; }
    // A list of one number stands for every width; so its width is 0.
    static std::size_t widthOf(const std::vector<double>& list) { return list.size() == 1 ? 0 : list.size(); }
    static double at(const std::vector<double>& list, std::size_t i) { return list[list.size() == 1 ? 0 : i]; }

    // [s] time step of the cycle or circuit that executes it, else its own. Fails with UNIT PERIOD when there is neither.
    double timeStep(double own) const {
        if (auto* tick = sorma::Tick::current()) [[likely]] return tick->period;
        if (own == 0) [[unlikely]] failPeriod();
        return own;
    }
    // Fails with UNIT WIDTH unless a request has as many floats.
    void needWidth(std::size_t width, std::size_t got) const {
        if (width != got) [[unlikely]] failWidth(width, got);
    }
    [[noreturn]] void failPeriod() const;
    [[noreturn]] void failWidth(std::size_t width, std::size_t got) const;

    std::string unit_, outUnit_;
};

// Options that several classes have.
inline const sorma::Spec kUnit{.help = "unit of measurement of input and output; empty fits all"};
inline const sorma::Spec kInUnit{.help = "unit of measurement of the input; empty fits all"};
inline const sorma::Spec kOutUnit{.help = "unit of measurement of the output; empty fits all"};
inline const sorma::Spec kPeriod{.unit = "s", .low = 0, .high = 3600, .help = "time step when neither cycle nor circuit gives one"};
inline const sorma::Spec kInitial{.help = "initial value; one number stands for every width", .minLength = 1};

// Seconds since the first request, by the times at which ticks were due: nothing adds up.
class Clock {
public:
    double seconds(double step) {
        auto* tick = sorma::Tick::current();
        if (!tick) return double(count_++) * step;
        if (count_++ == 0) start_ = tick->time;
        return double(tick->time - start_) * 1e-9;
    }
    void reset() { count_ = 0; }

private:
    std::uint64_t count_ = 0;
    std::int64_t start_ = 0;
};

}  // namespace units
