// finger.h -- kinematics of a finger: the place of its tip, and the joint angles for a place.
//
// A finger spreads (ab), bends at its base (pf), and bends in the middle (mf); its last joint follows the middle one. Three of them
// stand around the tool's axis, 60, 180 and 300 degrees from its x, and bend towards it.
//
// Source: as the simulated hand of service simlab has it.
// Frames: the tool's, z out of the palm; a tip is the centre of the sphere at its end.
#pragma once

#include <array>

namespace hand {

inline constexpr std::size_t kFingers = 3, kJoints = 9;     // that are driven: ab pf mf of each finger
using Point = std::array<double, 3>;                        // [m]
using Angles = std::array<double, 3>;                       // ab pf mf [rad]
using Targets = std::array<double, kJoints>;                // of all fingers: angles, or tips

struct Geometry {
    double radius = 0.040, height = -0.110;                 // of the bases: from the axis, along it [m]
    double proximal = 0.055, middle = 0.035, distal = 0.030;
    Angles lower{-0.262, -0.6, 0}, upper{0.262, 1.4, 1.4};
};

inline Angles anglesOf(const Targets& t, std::size_t finger) { return {t[3 * finger], t[3 * finger + 1], t[3 * finger + 2]}; }
inline void put(Targets& t, std::size_t finger, const std::array<double, 3>& v) {
    for (std::size_t i = 0; i < 3; ++i) t[3 * finger + i] = v[i];
}

Point tipOf(const Geometry& g, std::size_t finger, const Angles& angles);
Targets tipsOf(const Geometry& g, const Targets& angles);
double radiusOf(const Point& tip);                          // from the tool's axis
// Tips at one distance from the axis and one height, each straight in front of its finger's base.
Targets ring(double radius, double height);

// angles: in: search near these; out: angles for the tip. False: there are none within the limits, or the nearest
// ones are far from the given ones. Never allocates.
bool reach(const Geometry& g, std::size_t finger, const Point& tip, Angles& angles) noexcept;

}  // namespace hand
