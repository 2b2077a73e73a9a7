// table -- a function of one variable, given by points with straight lines between them.
#include <algorithm>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kOrder{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} {} does not come after {}: the numbers must rise"};
const sorma::Prototype kPairs{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} has {} numbers, and -x {}: they must be pairs"};

class Table : public Unit {
public:
    void born() override { check(); }
    void changed(std::span<const sorma::Option* const>) override { check(); }

    void exec(sorma::Message& m) override {
        for (double& v : m.floats) v = valueAt(v);
    }

    Pins pins(std::string_view, std::size_t width) const override { return through(0, width, unit_, outUnit_); }

private:
    double valueAt(double v) const {
        auto after = std::upper_bound(x_.begin(), x_.end(), v);
        if (v != v || (after == x_.end() && v > x_.back())) return v != v ? v : y_.back();
        if (after == x_.begin()) return y_.front();
        std::size_t i = std::size_t(after - x_.begin()) - 1;
        if (v == x_[i]) return y_[i];
        return y_[i] + (y_[i + 1] - y_[i]) * ((v - x_[i]) / (x_[i + 1] - x_[i]));
    }
    void check() {
        if (y_.size() != x_.size()) fail(kPairs, name(), "-y", y_.size(), x_.size());
        for (std::size_t i = 1; i < x_.size(); ++i)
            if (!(x_[i] > x_[i - 1])) fail(kOrder, name(), "-x", x_[i], x_[i - 1]);
    }

    std::vector<double> x_ = {0, 1}, y_ = {0, 1};
    friend sorma::Class units::describeTable();
};

}  // namespace

sorma::Class describeTable() {
    return sorma::Class::of<Table>("table", "a function given by points, with straight lines between them")
        .vector("-x", &Table::x_, {.low = -1e300, .high = 1e300, .help = "where the points are, rising", .minLength = 1})
        .vector("-y", &Table::y_, {.help = "values there; beyond the ends the value of the end", .minLength = 1})
        .text("-unit", &Table::unit_, kInUnit)
        .text("-outUnit", &Table::outUnit_, kOutUnit)
        .reads(sorma::Field::floats, {}, "", "values")
        .writes(sorma::Field::floats, {}, "", "the function of each")
        .realtime()
        .repeatable()
        .example("table EXEC FMSG 3 -1 0.25 2");
}

}  // namespace units
