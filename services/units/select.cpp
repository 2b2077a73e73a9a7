// select -- some elements, in any order, as often as one likes.
#include <algorithm>
#include <cmath>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kWhole{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} {} is not a whole number"};
const sorma::Prototype kBeyond{sorma::Severity::error, "SELECT INDEX", 1, "{}: there is no element {} among {} floats; they count from 0"};

class Select : public Unit {
public:
    void born() override { read(); }
    void changed(std::span<const sorma::Option* const>) override { read(); }

    void exec(sorma::Message& m) override {
        if (m.floats.size() <= highest_) [[unlikely]] fail(kBeyond, name(), highest_, m.floats.size());
        std::swap(m.floats, in_);
        m.floats.resize(at_.size());
        for (std::size_t i = 0; i < at_.size(); ++i) m.floats[i] = in_[at_[i]];
    }

    Pins pins(std::string_view pin, std::size_t length) const override {
        std::size_t width = pin == "in" ? length : sorma::Pin::kOpen;
        if (width <= highest_) fail(kBeyond, name(), highest_, width);
        if (width != sorma::Pin::kOpen) expect(width);
        return {{"in", true, 0, width, unit_, {}}, {"out", false, 0, at_.size(), unit_, {}}};
    }

private:
    void reserve(std::size_t width) override { in_.reserve(std::max(width, at_.size())); }
    void read() {
        for (double x : indices_)
            if (x != std::floor(x)) fail(kWhole, name(), "-indices", x);
        at_.assign(indices_.begin(), indices_.end());
        highest_ = 0;
        for (auto i : at_) highest_ = std::max(highest_, i);
        reserve(in_.capacity());
    }

    std::vector<double> indices_ = {0}, in_;
    std::vector<std::size_t> at_ = {0};
    std::size_t highest_ = 0;
    friend sorma::Class units::describeSelect();
};

}  // namespace

sorma::Class describeSelect() {
    return sorma::Class::of<Select>("select", "some elements, in any order")
        .vector("-indices", &Select::indices_, {.low = 0, .high = 999'999, .help = "which, counted from 0", .minLength = 1})
        .text("-unit", &Select::unit_, kUnit)
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "those that were chosen")
        .realtime()
        .repeatable()
        .example("select EXEC FMSG 3 7 8 9");
}

}  // namespace units
