#include "pace.h"

#include <cmath>

namespace simlab {

namespace {
constexpr std::int64_t kMostBehind = 50'000'000;    // [ns] that are caught up
constexpr std::int64_t kMeasure = 200'000'000;      // [ns]
}

std::int64_t Pace::stepped(double step, std::int64_t wall) {
    if (!begun_) {
        begun_ = true;
        due_ = since_ = wall;
        fraction_ = passed_ = 0;
    }
    passed_ += step;
    if (wall - since_ >= kMeasure) {
        speed_ = passed_ * 1e9 / double(wall - since_);
        since_ = wall;
        passed_ = 0;
    }
    if (factor_ <= 0) return 0;
    fraction_ += step * 1e9 / factor_;
    const auto whole = std::int64_t(std::floor(fraction_));
    due_ += whole;
    fraction_ -= double(whole);
    if (wall - due_ > kMostBehind) {
        skipped_ += double(wall - due_) / 1e9 * factor_;
        due_ = wall;
    }
    return due_;
}

}  // namespace simlab
