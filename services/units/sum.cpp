// sum -- inputs of one width, added or subtracted, element by element.
#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kSigns{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} {} is not a row of 1 to {} characters + and -"};
const sorma::Prototype kEqual{sorma::Severity::error, "UNIT WIDTH", 1, "{}: EXEC expects floats for {} inputs of one width, got {}"};

class Sum : public Unit {
public:
    static constexpr std::size_t kMost = 1000;

    void born() override { read(); }
    void changed(std::span<const sorma::Option* const>) override { read(); }

    void exec(sorma::Message& m) override {
        std::size_t n = factors_.size(), width = m.floats.size() / n;
        if (width * n != m.floats.size()) [[unlikely]] fail(kEqual, name(), n, m.floats.size());
        double* x = m.floats.data();
        for (std::size_t i = 0; i < width; ++i) {
            double sum = factors_[0] * x[i];
            for (std::size_t k = 1; k < n; ++k) sum += factors_[k] * x[k * width + i];
            x[i] = sum;
        }
        m.floats.resize(width);
    }

    Pins pins(std::string_view, std::size_t width) const override {
        Pins out;
        bool open = width == sorma::Pin::kOpen;
        for (std::size_t i = 0; i < factors_.size(); ++i)
            out.push_back({"in" + std::to_string(i + 1), true, open ? 0 : i * width, width, unit_,
                           factors_[i] > 0 ? "added" : "subtracted"});
        out.push_back({"out", false, 0, width, unit_, {}});
        return out;
    }

private:
    void read() {
        if (signs_.empty() || signs_.size() > kMost || signs_.find_first_not_of("+-") != signs_.npos)
            fail(kSigns, name(), "-signs", sorma::shown(signs_), kMost);
        factors_.clear();
        for (char c : signs_) factors_.push_back(c == '+' ? 1 : -1);
    }

    std::string signs_ = "++";
    std::vector<double> factors_ = {1, 1};      // 1 or -1 for each input
    friend sorma::Class units::describeSum();
};

}  // namespace

sorma::Class describeSum() {
    return sorma::Class::of<Sum>("sum", "adds and subtracts inputs of one width: pins in1, in2, ... and out")
        .text("-signs", &Sum::signs_, {.help = "+ or - for each input"})
        .text("-unit", &Sum::unit_, kUnit)
        .reads(sorma::Field::floats, {}, "", "the inputs, one after another")
        .writes(sorma::Field::floats, {}, "", "their sum")
        .realtime()
        .repeatable()
        .example("sum EXEC FMSG 4 1 2 30 40");
}

}  // namespace units
