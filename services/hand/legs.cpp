#include "legs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sorma.h>

namespace hand {

namespace {

const sorma::Prototype kLimits{sorma::Severity::error, "HAND LIMITS", 1,
                               "{}: joint {} (finger {}, {}) was to have the angle {} rad, allowed is {} .. {}; nothing has moved"};
const sorma::Prototype kReach{sorma::Severity::error, "HAND REACH", 1,
                              "{}: finger {} does not reach {} m in the tool's frame, {} % of the way; nothing has moved"};

constexpr double kSmooth = 1.875;                   // fastest over mean speed of a motion from rest to rest
constexpr int kSamples = 24;                        // of a way of the tips, before it begins

double farthest(const Targets& a, const Targets& b) {
    double most = 0;
    for (std::size_t i = 0; i < kJoints; ++i) most = std::max(most, std::fabs(a[i] - b[i]));
    return most;
}

}  // namespace

std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", std::round(x * 1e4) / 1e4 + 0.0);
    return text;
}

void Planner::checkLimits(const Targets& t) const {
    for (std::size_t i = 0; i < kJoints; ++i)
        if (!(t[i] >= geometry.lower[i % 3] && t[i] <= geometry.upper[i % 3]))
            sorma::fail(kLimits, hand, i + 1, i / 3 + 1, kJointNames[i % 3], number(t[i]), number(geometry.lower[i % 3]), number(geometry.upper[i % 3]));
}

Leg Planner::leg(Targets& angles, const Targets& to, bool tips, double speed, double pause) const {
    Leg leg{to, tips, 0, pause};
    double turn = 0;
    if (!tips) {
        checkLimits(to);
        turn = farthest(angles, to);
        angles = to;
    } else {
        const Targets from = tipsOf(geometry, angles), begin = angles;
        double way = 0;
        for (std::size_t f = 0; f < kFingers; ++f) {
            const Point a = anglesOf(from, f), b = anglesOf(to, f);
            way = std::max(way, std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]));
            Angles at = anglesOf(angles, f);
            for (int k = 1; k <= kSamples; ++k) {
                Point p;
                for (std::size_t i = 0; i < 3; ++i) p[i] = a[i] + (b[i] - a[i]) * k / kSamples;
                if (!reach(geometry, f, p, at)) sorma::fail(kReach, hand, f + 1, text(p), 100 * k / kSamples);
            }
            put(angles, f, at);
        }
        turn = farthest(begin, angles);
        leg.seconds = kSmooth * way / speed;
    }
    leg.seconds = std::max(leg.seconds, kSmooth * turn / jointSpeed);
    return leg;
}

}  // namespace hand
