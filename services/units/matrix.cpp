// matrix -- out = matrix * in.
#include <algorithm>
#include <numeric>

#include "unit.h"

namespace units {

namespace {

const sorma::Prototype kShape{sorma::Severity::error, "OPTION VALUE", 2, "{}: {} has {} numbers, which do not make {} rows of one length"};

class Matrix : public Unit {
public:
    void born() override { check(); }
    void changed(std::span<const sorma::Option* const>) override { check(); }

    void exec(sorma::Message& m) override {
        needWidth(columns(), m.floats.size());
        std::swap(m.floats, in_);
        m.floats.resize(rows_);
        auto row = matrix_.cbegin();
        for (double& y : m.floats) {
            y = std::inner_product(in_.begin(), in_.end(), row, 0.0);
            row += std::ptrdiff_t(in_.size());
        }
    }

    Pins pins(std::string_view, std::size_t) const override {
        return {{"in", true, 0, columns(), unit_, {}}, {"out", false, 0, rows_, outUnit_, {}}};
    }

private:
    std::size_t columns() const { return matrix_.size() / rows_; }
    void check() {
        if (matrix_.size() % rows_) fail(kShape, name(), "-matrix", matrix_.size(), rows_);
        in_.reserve(std::max(rows_, columns()));
    }

    std::size_t rows_ = 1;
    std::vector<double> matrix_ = {1}, in_;
    friend sorma::Class units::describeMatrix();
};

}  // namespace

sorma::Class describeMatrix() {
    return sorma::Class::of<Matrix>("matrix", "multiplies by a matrix")
        .integer("-rows", &Matrix::rows_, {.low = 1, .high = 10'000, .help = "rows of the matrix: elements that come out"})
        .vector("-matrix", &Matrix::matrix_, {.help = "row after row", .minLength = 1})
        .text("-unit", &Matrix::unit_, kInUnit)
        .text("-outUnit", &Matrix::outUnit_, kOutUnit)
        .reads(sorma::Field::floats, {}, "", "as many as the matrix has columns")
        .writes(sorma::Field::floats, {}, "", "matrix * values")
        .realtime()
        .repeatable()
        .example("matrix EXEC FMSG 1 2");
}

}  // namespace units
