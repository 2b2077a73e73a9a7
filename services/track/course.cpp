#include "course.h"

#include <algorithm>
#include <cmath>

namespace track {

double stoppingSpeed(double s, double dt, const Limits& limits) {
    const double brake = limits.brake * limits.acceleration, x = 0.5 * brake * dt;
    double speed = std::min(s / dt, std::sqrt(x * x + 2 * brake * s) - x);
    if (limits.soft > 0) {
        const double part = limits.near > 0 ? std::min(1.0, s / limits.near) : 1;
        speed = std::min(speed, s * (limits.soft + part * (limits.stiff - limits.soft)));
    }
    return speed;
}

namespace {

Eigen::Vector3d shortened(const Eigen::Vector3d& v, double most) {
    const double length = v.norm();
    return length > most ? Eigen::Vector3d(v * (most / length)) : v;
}

// The next velocity, with `left` as the way to the target; it goes down with `down` at most.
Eigen::Vector3d steered(const Eigen::Vector3d& velocity, const Eigen::Vector3d& left, const Eigen::Vector3d& aimed, double dt,
                        const Limits& limits, double down) {
    const double s = left.norm();
    Eigen::Vector3d wanted = aimed;
    if (s > 0) wanted += left * (stoppingSpeed(s, dt, limits) / s);
    wanted = shortened(wanted, limits.speed);
    wanted.z() = std::max(wanted.z(), -down);
    const double most = limits.acceleration * dt;
    Eigen::Vector3d change = wanted - velocity;
    if (velocity.z() >= -down) return velocity + shortened(change, most);
    // Too fast downwards: braking comes first, what is left of the acceleration is for the other directions.
    const double up = std::min(change.z(), most);
    change.z() = 0;
    change = shortened(change, std::sqrt(most * most - up * up));
    change.z() = up;
    return velocity + change;
}

constexpr double kAnyhow = std::numeric_limits<double>::infinity();

// How fast it may go down where it is. Half of the brakes are left for what else the target asks for.
double downSpeed(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity, double dt, const Limits& limits) {
    const double height = std::max(0.0, position.z() - limits.floor + std::min(0.0, velocity.z()) * dt);
    return std::sqrt(limits.touch * limits.touch + limits.brake * limits.acceleration * height);
}

}  // namespace

void Course::step(double dt, const Eigen::Vector3d& target, const Eigen::Vector3d& targetVelocity, const Limits& limits,
                  const Eigen::Vector3d& extra) {
    velocity = steered(velocity, target - position, targetVelocity + extra, dt, limits, downSpeed(position, velocity, dt, limits));
    position += velocity * dt;
}

void RotationCourse::step(double dt, const Eigen::Quaterniond& target, const Limits& limits) {
    Eigen::Quaterniond left = target * orientation.conjugate();
    if (left.w() < 0) left.coeffs() = -left.coeffs();           // the shorter way
    const Eigen::AngleAxisd rest(left);
    velocity = steered(velocity, rest.angle() * rest.axis(), Eigen::Vector3d::Zero(), dt, limits, kAnyhow);
    const double angle = velocity.norm() * dt;
    if (angle > 0) orientation = (Eigen::AngleAxisd(angle, velocity.normalized()) * orientation).normalized();
}

}  // namespace track
