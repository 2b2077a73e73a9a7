// push.h -- a guarded approach with one straight finger, contact, and a push with limited force.
#pragma once

#include "mover.h"

namespace robot {

class PushMotion final : public Motion {
public:
    struct Manner {
        double approachSpeed, pushSpeed;    // [m/s]
        double contact, most;               // [N] along the way: force of contact; force at which the push stands still
        double acceleration, retreat;       // [m/s2], [m] back at the end
    };
    // transfer: to where the approach begins. Then on a straight line to `to`, the tool as it is there.
    PushMotion(const Frames& frames, const ArmLimits& limits, PathMotion transfer, const ToolPose& from, const Vector3d& to,
               const Manner& manner);

    Step next(const Senses& senses, Joints& q) noexcept override;
    void brake() noexcept override;
    double part() const override { return length_ > 0 ? way_ / length_ : 1; }

    // The result.
    bool touched = false;
    Vector3d contact = {0, 0, 0};           // [m] where the tool was then
    double contactWay = 0, reached = 0, peak = 0;       // [m] along the line, farthest along it; [N]

private:
    enum class Phase { transfer, approach, push, retreat, braking };
    double wantedSpeed(double force, double period) noexcept;

    const Frames frames_;
    const ArmLimits limits_;
    PathMotion transfer_;
    const ToolPose from_;
    const Vector3d direction_;
    const double length_;
    const Manner manner_;
    Phase phase_ = Phase::transfer;
    bool over_ = false;
    double force_ = 0;                      // [N] against the motion, in the last tick
    double way_ = 0, speed_ = 0, back_ = 0, stuck_ = 0;     // [m], [m/s], [m], [s] without progress
    Posture posture_;
};

class Push final : public Mover {
public:
    static sorma::Class describe();
    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;

private:
    Job::Plan plan(const Now& now, const std::vector<double>& f);

    double approachSpeed_ = 0.03, pushSpeed_ = 0.03, contactForce_ = 2, mostForce_ = 8, retreat_ = 0.01;
};

}  // namespace robot
