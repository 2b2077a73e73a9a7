// puma.h -- kinematics of a Puma 560: pose of the flange, joint angles for a pose, torques of gravity.
//
// Frames: base frame on the mounting surface, frame 6 on the flange, whose z axis is the approach. Standard (distal)
// Denavit-Hartenberg, i-1_T_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i), with Corke's lengths and the signs of Paul. With all
// angles 0 the upper arm lies along x, the forearm points straight up, and the flange is turned like the base.
// Units:     m, rad, kg, N m.
// Threads:   functions of their arguments.
// Allocates: never.
// Source:    P. Corke, B. Armstrong-Helouvry, ICRA 1994, 1608-1613; masses: B. Armstrong, O. Khatib, J. Burdick, ICRA 1986,
//            510-518; inverse: R. Paul, Robot Manipulators, 1981.
#pragma once

#include <array>

#include <Eigen/Core>

namespace puma {

using Joints = Eigen::Matrix<double, 6, 1>;
using Pose = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;      // rotation | position: three rows of the 4x4 matrix
using Jacobian = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;  // rows vx vy vz wx wy wz

struct Limits {
    Joints lower = degrees(-160, -45, -225, -110, -100, -266);
    Joints upper = degrees(160, 225, 45, 170, 100, 266);

    static Joints degrees(double q1, double q2, double q3, double q4, double q5, double q6);
};

Pose forward(const Joints& q);

// Geometric Jacobian of the flange in the base frame.
Jacobian jacobian(const Joints& q);

// Torques that hold the arm still against gravity, and a load whose centre is at `centre` in the flange frame.
Joints gravity(const Joints& q, double acceleration = 9.81, double load = 0, const Eigen::Vector3d& centre = {0, 0, 0});

// Distances from the singularities, where the arm loses a direction of motion; 0: at one.
struct Distances {
    double shoulder;        // [m] of the wrist centre from the cylinder around the waist that it cannot enter
    double elbow;           // [m] L - |K|, L the length of the forearm, K its part along the upper arm: 0 when stretched or folded
    double wrist;           // |sin q5|
};
Distances distances(const Joints& q);

// Which of them are near, that is nearer than 0.03 m, 0.005 m, 0.03: a sum of these.
constexpr unsigned kShoulder = 1, kElbow = 2, kWrist = 4;
unsigned singularities(const Distances& d);

// All postures that bring the flange to a pose.
struct Solutions {
    enum Reach { reachable, tooClose, tooFar };     // tooClose: the wrist centre is within the shoulder's offset

    Reach reach = reachable;
    // By configuration: 4 (shoulder: arm to the left of the waist) + 2 (elbow) + 1 (wrist), each for the negative sign of the
    // formula. Each angle is shifted by full turns into its limits, and there as near to the posture as possible. An angle
    // without a place there is only as near to the posture as possible.
    std::array<Joints, 8> q;
    std::array<bool, 8> within;             // the limits, and not the same as one before it (at a singularity)
    std::array<unsigned, 8> near;           // a singularity
    std::array<double, 8> distance;         // largest weighted difference of an angle from the posture
    int count = 0;                          // of those within the limits
    std::array<int, 8> order;               // their configurations, nearest first
};

// posture: the present one. weights: of the angles, in the distance. Where the wrist is singular q4 is that of the posture.
// The pose must be a rotation and a finite position (isPose).
void inverse(const Pose& pose, const Joints& posture, const Limits& limits, const Joints& weights, Solutions& out);

// The centre of the wrist, where the last three axes meet, for a pose of the flange, in the base frame [m].
Eigen::Vector3d wristCentre(const Pose& pose);

// Distance of a wrist centre from the shoulder, in the plane of the arm, and what the arm bridges [m].
struct Reach {
    double distance, least, most;
};
Reach reachOf(const Eigen::Vector3d& wristCentre);

// Finite numbers, and columns of length 1 at right angles to each other, right-handed, all to 1e-6.
bool isPose(const Pose& pose);

}  // namespace puma
