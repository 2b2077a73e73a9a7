#include "path.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace robot {

Profile::Profile(double length, double speed, double acceleration) : length_(length), acceleration_(acceleration) {
    top_ = std::min(speed, std::sqrt(length * acceleration));       // a short one never gets as fast
    ramp_ = top_ / acceleration;
    total_ = top_ > 0 ? 2 * ramp_ + (length - top_ * ramp_) / top_ : 0;
}

double Profile::at(double t) const {
    if (braking_ && t > brakeAt_) {
        const double d = std::min(t - brakeAt_, brakeSpeed_ / acceleration_);
        return brakeFrom_ + d * (brakeSpeed_ - 0.5 * acceleration_ * d);
    }
    if (t <= 0) return 0;
    if (t >= total_) return length_;
    if (t < ramp_) return 0.5 * acceleration_ * t * t;
    const double left = total_ - t;
    if (left < ramp_) return length_ - 0.5 * acceleration_ * left * left;
    return top_ * (t - 0.5 * ramp_);
}

double Profile::speedAt(double t) const {
    if (braking_ && t > brakeAt_) return std::max(0.0, brakeSpeed_ - acceleration_ * (t - brakeAt_));
    return std::max(0.0, std::min({acceleration_ * t, top_, acceleration_ * (total_ - t)}));
}

void Profile::brake(double t) {
    if (braking_) return;
    const double from = at(t), speed = speedAt(t);
    braking_ = true, brakeAt_ = t, brakeFrom_ = from, brakeSpeed_ = speed;
}

Path::Path(Kind kind, const Knot& start, double metresPerRadian) : kind_(kind), start_(start),
    metresPerRadian_(metresPerRadian) {}

double Path::distance(const Knot& a, const Knot& b) const {
    if (kind_ == Kind::joints) return (b.q - a.q).cwiseAbs().maxCoeff();
    return std::max((b.tool.p - a.tool.p).norm(), metresPerRadian_ * turnBetween(a.tool.r, b.tool.r));
}

Knot Path::mix(const Knot& a, const Knot& b, double part) const {
    if (kind_ == Kind::joints) return {a.q + part * (b.q - a.q), {}};
    return {{}, {a.tool.p + part * (b.tool.p - a.tool.p), a.tool.r.slerp(part, b.tool.r)}};
}

void Path::append(Piece piece) {
    piece.from = length();
    pieces_.push_back(piece);
}

void Path::add(const Knot& next, double rounding) {
    const Knot corner = pieces_.empty() ? start_ : pieces_.back().b;
    const double after = distance(corner, next);
    if (after == 0) return;
    Knot from = corner;
    if (rounding > 0 && !pieces_.empty()) {
        // The line before it becomes shorter; the quadratic Bezier curve through the corner's two sides follows.
        Piece& last = pieces_.back();
        const double r = std::min({rounding, 0.5 * last.length, 0.5 * after}), before = last.length;
        const Knot a = mix(last.a, corner, 1 - r / before), b = mix(corner, next, r / after);
        last.b = a, last.length = before - r;
        Knot onward = mix(corner, next, r / after), back = mix(last.a, corner, 1 - r / before);
        const double bend = kind_ == Kind::joints ? ((onward.q - corner.q) - (corner.q - back.q)).cwiseAbs().maxCoeff() / r
                            : std::max(((onward.tool.p - corner.tool.p) - (corner.tool.p - back.tool.p)).norm() / r,
                                       metresPerRadian_ * std::min(2.0, turnBetween(back.tool.r, corner.tool.r) +
                                                                            turnBetween(corner.tool.r, onward.tool.r)) / r);
        append({a, corner, b, true, 0, 2 * r, bend});
        from = b;
    }
    append({from, from, next, false, 0, distance(from, next), 0});
}

double Path::fastest(double acceleration) const {
    double speed = std::numeric_limits<double>::infinity();
    for (auto& piece : pieces_)
        if (piece.round && piece.bend > 0) speed = std::min(speed, std::sqrt(acceleration * piece.length / piece.bend));
    return speed;
}

Knot Path::at(double s) const {
    if (pieces_.empty()) return start_;
    std::size_t i = 0;
    while (i + 1 < pieces_.size() && s >= pieces_[i + 1].from) ++i;
    const Piece& p = pieces_[i];
    const double part = p.length > 0 ? std::clamp((s - p.from) / p.length, 0.0, 1.0) : 1;
    if (!p.round) return mix(p.a, p.b, part);
    return mix(mix(p.a, p.corner, part), mix(p.corner, p.b, part), part);
}

}  // namespace robot
