// guard.h -- conditions for a motion of the arm: where the tool may be, how fast it may move, which forces it may feel.
//
// Threads:   a value; check() is called in ticks.
// Allocates: never in check().
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "place.h"

namespace robot {

// The state that a guard checks.
struct GuardInput {
    ToolPose tool;                             // where the set-point brings it
    Vector3d ahead = {0, 0, 0};             // [m] where it comes to rest when it begins to brake now
    double speed = 0;                       // [m/s]
    bool sensed = false;                    // the force and moment below are there
    Wrench felt = Wrench::Zero();           // from outside on the hand, tool axes
    puma::Distances singular{1, 1, 1};
};

struct Trip {
    const char* what = nullptr;             // the quantity, "x of the tool", "speed"; a literal
    double value = 0, low = 0, high = 0;    // its value, and the range that is allowed
};

struct Box {
    Vector3d low, high;                     // [m] in the world
};

struct Guard {
    static constexpr double kAny = std::numeric_limits<double>::infinity();

    std::string name;                       // of the service object
    std::vector<Box> inside;                // empty, or the tool must be in one of them
    std::vector<Box> outside;               // it must not be in any of these
    double speed = kAny;                    // [m/s]
    double force = kAny, moment = kAny;     // [N], [N m] at most, in whatever direction
    bool worldForces = false;               // the pattern's axes are the world's, not the tool's
    Wrench low = Wrench::Constant(-kAny), high = Wrench::Constant(kAny);        // pattern of forces and moments
    puma::Distances singular{0, 0, 0};      // at least

    bool feels() const {
        return force < kAny || moment < kAny || (low.array() > -kAny).any() || (high.array() < kAny).any();
    }
    // False: the condition is violated; trip says how.
    bool check(const GuardInput& view, Trip& trip) const;
};

}  // namespace robot
