// delay -- what came some requests ago. It may close a loop.
#include <algorithm>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kMemory{sorma::Severity::error, "DELAY MEMORY", 1, "{}: {} steps of {} floats are more than {} floats"};

class Delay : public Unit {
public:
    static constexpr std::size_t kMost = 10'000'000;    // floats

    void changed(std::span<const sorma::Option* const>) override {
        reserve(expected_);
        if (line_.size() != steps_ * width_) restart();
    }

    void exec(sorma::Message& m) override {
        if (m.floats.empty()) return peek(m.floats);
        if (width_ != m.floats.size()) [[unlikely]] begin(m.floats.size());
        std::swap_ranges(m.floats.begin(), m.floats.end(), line_.begin() + std::ptrdiff_t(next_));
        next_ += width_;
        if (next_ == line_.size()) next_ = 0;
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(widthOf(initial_), width, unit_, unit_); }

    void dumpState(std::string& out) const override {
        if (width_ == 0) return;
        std::vector<double> next;
        peek(next);
        out += "# next " + sorma::toText(sorma::Value(next)) + "\n";
    }

private:
    void peek(std::vector<double>& out) const {
        if (width_ == 0) return out.assign(initial_.begin(), initial_.end());
        auto from = line_.begin() + std::ptrdiff_t(next_);
        out.assign(from, from + std::ptrdiff_t(width_));
    }
    void begin(std::size_t width) {
        if (widthOf(initial_)) needWidth(initial_.size(), width);
        checkMemory(width);
        line_.resize(steps_ * width);
        for (std::size_t i = 0; i < line_.size(); ++i) line_[i] = at(initial_, i % width);
        width_ = width;
        next_ = 0;
    }
    void reserve(std::size_t width) override {
        checkMemory(width);
        line_.reserve(steps_ * width);
        expected_ = width;
    }
    void checkMemory(std::size_t width) const {
        if (width > kMost / steps_) fail(kMemory, name(), steps_, width, kMost);
    }
    void reset(sorma::Args, sorma::Message&) { restart(); }
    void restart() {
        width_ = next_ = 0;
        line_.clear();
    }

    std::size_t steps_ = 1;
    std::vector<double> initial_ = {0};
    std::vector<double> line_;              // a ring of records; the oldest begins at next_
    std::size_t width_ = 0, next_ = 0;      // of a record; 0: no request yet
    std::size_t expected_ = 0;              // width that has been wired
    friend sorma::Class units::describeDelay();
};

}  // namespace

sorma::Class describeDelay() {
    return sorma::Class::of<Delay>("delay", "gives back what came some requests ago; may close a loop")
        .integer("-steps", &Delay::steps_, {.low = 1, .high = 1e6, .help = "requests; a new number begins again"})
        .vector("-initial", &Delay::initial_, kInitial)
        .text("-unit", &Delay::unit_, kUnit)
        .action("-reset", &Delay::reset, "", "begin again")
        .reads(sorma::Field::floats, {}, "", "values; none: change nothing")
        .writes(sorma::Field::floats, {}, "", "values of an earlier request")
        .realtime()
        .withoutFeedthrough()
        .example("delay EXEC FMSG 2 1 2");
}

}  // namespace units
