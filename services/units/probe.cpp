// probe -- lets everything pass, and remembers it: the last records, least, greatest and mean of each element.
#include <algorithm>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kMemory{sorma::Severity::error, "PROBE MEMORY", 1, "{}: {} records of {} floats are more than {} floats"};
const sorma::Prototype kCount{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} {} is not a number of records"};

class Probe : public Unit {
public:
    static constexpr std::size_t kMost = 10'000'000;    // floats

    void changed(std::span<const sorma::Option* const>) override {
        reserve(expected_);
        if (records_.size() != last_ * width_) begin(0);
    }

    void exec(sorma::Message& m) override {
        if (m.floats.size() != width_) [[unlikely]] begin(m.floats.size());
        if (width_ == 0) return;
        ++count_;
        double* record = records_.data() + next_ * width_;
        for (std::size_t i = 0; i < width_; ++i) {
            double x = record[i] = m.floats[i];
            low_[i] = std::min(low_[i], x);
            high_[i] = std::max(high_[i], x);
            mean_[i] += (x - mean_[i]) / double(count_);
        }
        auto* tick = sorma::Tick::current();
        times_[next_] = tick ? tick->time : sorma::monotonicNow();
        next_ = next_ + 1 == last_ ? 0 : next_ + 1;
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(0, width, unit_, unit_); }

    void dumpState(std::string& out) const override {
        out += "# count " + std::to_string(count_) + "\n";
        if (count_ == 0) return;
        auto line = [&](const char* what, const std::vector<double>& v) {
            out += std::string("# ") + what + " " + sorma::toText(sorma::Value(v)) + "\n";
        };
        line("low", low_);
        line("high", high_);
        line("mean", mean_);
        for (std::size_t k = std::min<std::size_t>(kShown, kept()); k > 0; --k) out += "# last " + recordText(k) + "\n";
    }

private:
    static constexpr std::size_t kShown = 5;

    std::size_t kept() const { return std::size_t(std::min<std::uint64_t>(count_, last_)); }

    void reserve(std::size_t width) override {
        checkMemory(width);
        records_.reserve(width * last_);
        times_.reserve(last_);
        for (auto* v : {&low_, &high_, &mean_}) v->reserve(width);
        expected_ = width;
    }
    void checkMemory(std::size_t width) const {
        if (width > kMost / last_) fail(kMemory, name(), last_, width, kMost);
    }
    void begin(std::size_t width) {
        checkMemory(width);
        width_ = width;
        count_ = next_ = 0;
        records_.assign(width * last_, 0);
        times_.assign(width ? last_ : 0, 0);
        low_.assign(width, sorma::kInfinity);
        high_.assign(width, -sorma::kInfinity);
        mean_.assign(width, 0);
    }

    // The k-th from the end: number time values.
    std::string recordText(std::size_t k) const {
        std::size_t at = (next_ + last_ - k) % last_;
        std::string out = std::to_string(count_ - k + 1) + " ";
        sorma::appendNumber(out, double(times_[at]) * 1e-9);
        for (std::size_t i = 0; i < width_; ++i) {
            out += ' ';
            sorma::appendNumber(out, records_[at * width_ + i]);
        }
        return out;
    }

    void list(sorma::Args args, sorma::Message& reply) {
        std::size_t n = kept();
        if (!args.empty()) {
            std::int64_t asked = 0;
            if (!sorma::parseNumber(args[0], asked) || asked < 0) fail(kCount, name(), "-list", sorma::shown(args[0]));
            n = std::min(n, std::size_t(asked));
        }
        for (std::size_t k = n; k > 0; --k) {
            if (!reply.text.empty()) reply.text += '\n';
            reply.text += recordText(k);
        }
    }
    void reset(sorma::Args, sorma::Message&) { begin(0); }

    std::size_t last_ = 100;
    std::size_t width_ = 0, next_ = 0;      // of a record; where the next one goes
    std::size_t expected_ = 0;              // width that has been wired
    std::uint64_t count_ = 0;
    std::vector<double> records_, low_, high_, mean_;
    std::vector<std::int64_t> times_;       // [ns] when their ticks were due
    friend sorma::Class units::describeProbe();
};

}  // namespace

sorma::Class describeProbe() {
    return sorma::Class::of<Probe>("probe", "lets everything pass, and remembers it")
        .integer("-last", &Probe::last_, {.unit = "records", .low = 1, .high = 1e6, .help = "that it remembers; a new number begins again"})
        .text("-unit", &Probe::unit_, kUnit)
        .action("-list", &Probe::list, "?n?", "the last records, the oldest first: number, time [s], values", 0, 1)
        .action("-reset", &Probe::reset, "", "forget everything")
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "the same")
        .realtime()
        .example("probe EXEC FMSG 2 1 2");
}

}  // namespace units
