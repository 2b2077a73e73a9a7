#include "finger.h"

#include <algorithm>
#include <cmath>

namespace hand {

namespace {

constexpr double kNear = 1e-8;          // [m]
constexpr double kSlack = 1e-6;         // [rad] of a limit

double azimuth(std::size_t finger) { return M_PI / 3 + double(finger) * 2 * M_PI / 3; }

// In the plane in which the finger bends: towards the axis, and away from the palm.
struct Bent {
    double in, out;
};
Bent bend(const Geometry& g, double pf, double mf) {
    const double a = pf, b = pf + mf, c = pf + 2 * mf;
    return {g.proximal * std::sin(a) + g.middle * std::sin(b) + g.distal * std::sin(c),
            g.proximal * std::cos(a) + g.middle * std::cos(b) + g.distal * std::cos(c)};
}

// Newton's method from one place.
bool solve(const Geometry& g, const Bent& wanted, double& pf, double& mf) {
    for (int i = 0; i < 40; ++i) {
        const Bent at = bend(g, pf, mf);
        const double in = wanted.in - at.in, out = wanted.out - at.out;
        if (std::hypot(in, out) < kNear) return true;
        // d(in, out)/d(pf, mf)
        const double b = pf + mf, c = pf + 2 * mf;
        const double inMf = g.middle * std::cos(b) + 2 * g.distal * std::cos(c), outMf = -g.middle * std::sin(b) - 2 * g.distal * std::sin(c);
        const double det = at.out * outMf + at.in * inMf;
        if (std::fabs(det) < 1e-9) return false;
        const double dPf = (outMf * in - inMf * out) / det, dMf = (at.out * out + at.in * in) / det;
        const double step = std::min(1.0, 0.3 / std::max(std::fabs(dPf), std::fabs(dMf)));
        pf += step * dPf;
        mf += step * dMf;
    }
    return false;
}

}  // namespace

Point tipOf(const Geometry& g, std::size_t finger, const Angles& angles) {
    const Bent b = bend(g, angles[1], angles[2]);
    const double in = g.radius - b.in, aside = b.out * std::sin(angles[0]);     // from the axis; along the edge of the palm
    const double c = std::cos(azimuth(finger)), s = std::sin(azimuth(finger));
    return {c * in - s * aside, s * in + c * aside, g.height + b.out * std::cos(angles[0])};
}

Targets tipsOf(const Geometry& g, const Targets& angles) {
    Targets tips;
    for (std::size_t f = 0; f < kFingers; ++f) put(tips, f, tipOf(g, f, anglesOf(angles, f)));
    return tips;
}

double radiusOf(const Point& tip) { return std::hypot(tip[0], tip[1]); }

Targets ring(double radius, double height) {
    Targets tips;
    for (std::size_t f = 0; f < kFingers; ++f)
        put(tips, f, {radius * std::cos(azimuth(f)), radius * std::sin(azimuth(f)), height});
    return tips;
}

bool reach(const Geometry& g, std::size_t finger, const Point& tip, Angles& angles) noexcept {
    const double c = std::cos(azimuth(finger)), s = std::sin(azimuth(finger));
    const double in = c * tip[0] + s * tip[1], aside = c * tip[1] - s * tip[0], up = tip[2] - g.height;
    const Bent wanted{g.radius - in, std::hypot(aside, up)};
    double pf = angles[1], mf = std::max(angles[2], 0.05);      // straight, Newton's method does not know where to bend
    if (!solve(g, wanted, pf, mf) || mf < -kSlack) {
        pf = 0.1, mf = 0.2;
        if (!solve(g, wanted, pf, mf)) return false;
    }
    const Angles found{std::atan2(aside, up), pf, mf};
    for (std::size_t i = 0; i < 3; ++i)
        if (!(found[i] >= g.lower[i] - kSlack && found[i] <= g.upper[i] + kSlack)) return false;
    angles = found;
    return true;
}

}  // namespace hand
