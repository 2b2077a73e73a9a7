// course.h -- set-points that reach a moving target with its own velocity, planned anew in each tick.
//
// In each tick the velocity goes, as far as the acceleration allows, to that of the target plus a speed towards it. From this
// speed the tool can stop in the rest of the way. Nothing is kept but position and velocity: the target may do what it likes.
// The law of braking is exact for steps of one tick: a straight way from rest to rest never overshoots when `brake` is
// at most 8/9 of the acceleration.
//
// Threads:   one at a time.
// Allocates: nothing.
#pragma once

#include <limits>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace track {

struct Limits {
    double speed = 0.5;             // [m/s], or [rad/s]
    double acceleration = 2;        // [m/s^2], or [rad/s^2]
    double brake = 8.0 / 9;         // part of the acceleration that braking counts on, above 0
    // Near the target the speed is at most kappa s at the distance s, with kappa rising from soft at 0 to stiff at `near`. The
    // bare law's slope is infinite at the target, so noise would make the arm tremble.
    double soft = 4, stiff = 25;    // [1/s]; soft 0: the bare law
    double near = 0.010;            // [m], or [rad]
    // For a Course: below the height `floor` it goes down with `touch` at most, since something may be touched there. It slows
    // down before.
    double floor = -std::numeric_limits<double>::infinity();    // [m]
    double touch = 0.02;            // [m/s]
};

// The speed from which steps of brake * dt lead to rest within distance s.
double stoppingSpeed(double s, double dt, const Limits& limits);

// A point in space.
struct Course {
    Eigen::Vector3d position = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();

    // A tick of dt [s]; where the target is, at its beginning. `extra` is added to the target velocity, like that of a pushing
    // hand.
    void step(double dt, const Eigen::Vector3d& target, const Eigen::Vector3d& targetVelocity, const Limits& limits,
              const Eigen::Vector3d& extra = Eigen::Vector3d::Zero());
};

// An orientation; the same law for the vector of the rotation that is left.
struct RotationCourse {
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();         // [rad/s], world

    void step(double dt, const Eigen::Quaterniond& target, const Limits& limits);
};

}  // namespace track
