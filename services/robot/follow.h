// follow.h -- the arm goes after a target that somebody else computes tick by tick, until it is stopped.
//
// Nothing that the target does, and no end of it, moves the tool faster or harder than the limits: the set-points are
// planned here, anew in each tick, from where the last one was. Without a target the tool comes to rest and waits.
#pragma once

#include <track/course.h>

#include "mover.h"
#include "tap.h"

namespace robot {

class FollowMotion final : public Motion {
public:
    // A record: position, quaternion, velocity of the target, a velocity that is added.
    static constexpr std::size_t kTarget = 13;
    struct Manner {
        track::Limits line, turn;
        double patience = 0.1;              // [s] a target that is older is none; at least three periods
    };
    FollowMotion(const Frames& frames, const ArmLimits& limits, const Place& from, const Manner& manner);

    Step next(const Senses& senses, Joints& q) noexcept override;
    void brake() noexcept override { braking_ = true; }
    double part() const override { return 0; }
    double looksAhead() const override { return manner.line.acceleration; }

    // Between ticks.
    Manner manner;
    Tap target{kTarget, kTarget};
    std::uint64_t followed = 0, waited = 0, wrong = 0;      // ticks with a target, without, with one that is no numbers

private:
    bool read(double period, std::array<double, kTarget>& f) noexcept;

    const Frames frames_;
    const ArmLimits limits_;
    track::Course course_;
    track::Turn turn_;
    bool braking_ = false;
    Posture posture_;
};

class Follow final : public Mover {
public:
    static sorma::Class describe();
    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;
    void dumpState(std::string& out) const override;

private:
    FollowMotion::Manner manner() const;
    FollowMotion* motion() const;           // while it moves the arm
    void watch();

    std::string target_ = "tool.target", problem_;
    double turnAcceleration_ = 3, soft_ = 4, stiff_ = 25, near_ = 0.010, patience_ = 0.1;
    FollowMotion* motion_ = nullptr;
    sorma::Timer timer_;
};

}  // namespace robot
