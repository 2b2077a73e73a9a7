// follow.h -- the arm follows a target that another object computes in each tick, until it is stopped.
//
// The tool never exceeds its limits of speed and acceleration, whatever the target does: each tick plans the next set-point
// from the last one. Without a target the tool comes to rest and waits.
#pragma once

#include <track/course.h>

#include "mover.h"
#include "bufferInput.h"

namespace robot {

class FollowMotion final : public Motion {
public:
    // A record: position, quaternion, velocity of the target, a velocity that is added.
    static constexpr std::size_t kTarget = 13;
    struct Manner {
        track::Limits line, turn;
        double patience = 0.1;              // [s] an older target does not count; its age is counted in ticks. At least three periods
    };
    // Its inputs, and their results.
    struct Feed {
        BufferInput target{kTarget, kTarget};
        sorma::Tally followed, waited, wrong;       // ticks with a target, without one, with one that is none
        sorma::Tally lost, damaged;                 // how often there was no target any more, or a wrong one
    };
    // feed: must exist as long as the motion
    FollowMotion(const Frames& frames, const ArmLimits& limits, const ToolPose& from, const Manner& manner, Feed& feed);

    Step next(const Senses& senses, Joints& q) noexcept override;
    void brake() noexcept override { braking_ = true; }
    double part() const override { return 0; }
    double looksAhead() const override { return manner.line.acceleration; }

    // Between ticks.
    Manner manner;
    void use(BufferInput::Found target) { feed_.target.use(std::move(target)), counter_ = 0; }

private:
    enum class Target { none, wrong, right };
    Target read(double period, std::array<double, kTarget>& f) noexcept;
    void note(Target now) noexcept;
    bool old(const shmem::Stamp& stamp, double period) noexcept;

    const Frames frames_;
    const ArmLimits limits_;
    Feed& feed_;
    Target last_ = Target::none;
    // [m/s2] of the last tick; and how it brakes: never less, or a guard that trips because less was set would be too late.
    double before_ = 0, brake_ = 0;
    track::Course course_;
    track::RotationCourse turn_;
    bool braking_ = false;
    std::uint64_t counter_ = 0;             // of the newest target; 0: none since its buffer was found
    double age_ = 0;                        // [s] of it
    Posture posture_;
};

class Follow final : public Mover, public sorma::HasIncidents {
public:
    static sorma::Class describe();
    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;
    void dumpState(std::string& out) const override;
    void tellIncidents(sorma::Incidents& out) const override;

private:
    FollowMotion::Manner manner() const;
    FollowMotion* motion() const;           // while it moves the arm
    void watch();

    sorma::Named<sorma::Kind::segment> target_ = "tool.target";
    double turnAcceleration_ = 3, soft_ = 4, stiff_ = 25, near_ = 0.010, patience_ = 0.1, floor_ = -10, touch_ = 0.02;
    FollowMotion::Feed feed_;
    FollowMotion* motion_ = nullptr;
    sorma::Timer timer_;
};

}  // namespace robot
