// place.h -- poses of the tool in the world, and the posture of the arm for each.
//
// World: z = 0 is the table top, x points from the robot across the table. Tool: the flange's axes, moved along them.
// Threads:   values.
// Allocates: never.
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include <puma/puma.h>

namespace robot {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using puma::Joints;
using Wrench = Eigen::Matrix<double, 6, 1>;         // force [N], moment [N m]

struct ToolPose {                                      // of the tool, in the world
    Vector3d p = {0, 0, 0};                         // [m]
    Quaterniond r = Quaterniond::Identity();        // tool -> world
};

struct Frames {
    Vector3d base = {0, 0, -0.25};                  // [m] of the robot's base, in the world
    Vector3d tool = {0, 0, 0.2};                    // [m] of the tool, in the flange's frame

    ToolPose toolOf(const Joints& q) const;
    puma::Pose flangeOf(const ToolPose& tool) const;   // in the base frame, as puma::inverse takes it
};

// Position and quaternion, as messages have them.
inline void append(std::vector<double>& floats, const ToolPose& place) {
    floats.insert(floats.end(), {place.p.x(), place.p.y(), place.p.z(), place.r.w(), place.r.x(), place.r.y(), place.r.z()});
}

// A place that is given in the frame of another one.
inline ToolPose operator*(const ToolPose& frame, const ToolPose& local) { return {frame.p + frame.r * local.p,
    (frame.r * local.r).normalized()}; }

// The angle between two orientations [rad], 0 .. pi.
inline double turnBetween(const Quaterniond& a, const Quaterniond& b) { return a.angularDistance(b); }

// A small rotation given as axis times angle.
inline Quaterniond turnBy(const Vector3d& v) {
    const double angle = v.norm();
    return angle > 0 ? Quaterniond(Eigen::AngleAxisd(angle, v / angle)) : Quaterniond::Identity();
}

}  // namespace robot
