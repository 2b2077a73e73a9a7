// legs.h -- a leg of a motion, planned before it begins: how long it takes, or why it cannot be done.
#pragma once

#include <string>

#include "control.h"

namespace hand {

inline constexpr const char* kJointNames[] = {"spread", "base", "middle"};

// In SI units, to a ten-thousandth.
std::string number(double x);
template <std::size_t n> std::string text(const std::array<double, n>& values) {
    std::string out;
    for (double v : values) out += (out.empty() ? "" : " ") + number(v);
    return out;
}

struct Planner {
    std::string hand;                       // for messages
    Geometry geometry;
    double jointSpeed;                      // [rad/s] of the fastest joint, at most

    void checkLimits(const Targets& angles) const;          // fails with HAND LIMITS

    // A leg from some angles; these become those of its end.   tips: `to` are tips;   speed: of the fastest tip [m/s];   pause: [s].
    // Fails with HAND LIMITS, and with HAND REACH when a tip does not get there on a straight line.
    Leg leg(Targets& angles, const Targets& to, bool tips, double speed, double pause = 0) const;
};

}  // namespace hand
