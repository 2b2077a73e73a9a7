// motion.h -- motions of the arm: each tick asks a motion for the next set-point.
//
// The SORM's thread makes a motion. The control task executes it. When it has ended it belongs to the SORM's thread again.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include <shmem/ring.h>

#include "guard.h"
#include "path.h"

namespace robot {

struct ArmLimits {
    puma::Limits angles;
    Joints speed, acceleration;             // [rad/s], [rad/s2]
};

// The posture that brings the tool to a place, nearest to a present one.
struct Posture {
    enum Fault { none, unreachable, limits, singular };
    Fault find(const Frames& frames, const ArmLimits& limits, const ToolPose& place, const Joints& near, Joints& q) noexcept;
    puma::Solutions solutions;              // of the last one
};

// The inputs of a motion in a tick.
struct Senses {
    double period = 0;                      // [s]
    bool sensed = false;
    Wrench raw = Wrench::Zero();            // reading of the wrist's sensor
    Vector3d pressed = {0, 0, 0};           // [N] from outside on the hand, world axes
};

class Motion {
public:
    enum class Step { going, done, unreachable, limits, singular };

    virtual ~Motion() = default;
    // The set-point after the present one.   q: in: the present one; out: the next one.
    virtual Step next(const Senses& senses, Joints& q) noexcept = 0;
    // Slow down within the limits, stay on the path, and be done then.
    virtual void brake() noexcept = 0;
    virtual double part() const = 0;        // of the way, 0 .. 1
    // Its deceleration when it brakes [m/s2]; 0: the places where it can come to rest were checked before it began.
    virtual double looksAhead() const { return 0; }
};

// Relative displacements from a buffer: each record's floats 1 .. 6 (x y z [m], rotation vector [rad], world
// axes) are
// added to where the tool shall be. It goes there within speed and acceleration.
class Increments {
public:
    // fails with shmem::Failure
    Increments(const std::string& key, double speed, double acceleration, double metresPerRadian);
    static constexpr std::size_t kFloats = 7;

    const shmem::Shape& shape() const { return reader_.shape(); }
    void next(double period) noexcept;
    void stop() noexcept { stopping_ = true; }
    bool still() const { return rate_ == 0; }
    Vector3d shift() const { return at_.head<3>(); }
    Quaterniond turn() const { return turnBy(at_.tail<3>() / metresPerRadian_); }

private:
    shmem::Reader reader_;
    std::uint64_t seen_;
    double speed_, acceleration_, metresPerRadian_;
    Wrench wanted_ = Wrench::Zero(), at_ = Wrench::Zero();      // turns as metres
    Wrench direction_ = Wrench::Zero();
    double rate_ = 0;                       // [m/s]
    bool stopping_ = false;
};

// Along paths, one after another; the arm rests between them.
class PathMotion : public Motion {
public:
    struct Leg {
        Path path;
        Profile profile;
        double pause = 0;                   // [s] of rest at its end
    };
    PathMotion(const Frames& frames, const ArmLimits& limits, std::vector<Leg> legs);

    void follow(std::unique_ptr<Increments> increments, bool stays, double acceleration);
    double duration() const;                // [s]
    Knot here() const { return legs_[leg_].path.at(legs_[leg_].profile.at(time_)); }   // of the path alone
    const puma::Solutions& solutions() const { return posture_.solutions; }             // of the last step on a line

    Step next(const Senses& senses, Joints& q) noexcept override;
    void brake() noexcept override;
    double part() const override;
    double looksAhead() const override { return increments_ ? acceleration_ : 0; }

protected:
    // In the pause of a leg. rested: part of it that has passed.
    virtual void resting(std::size_t leg, double rested, const Senses& senses) noexcept { (void)leg, (void)rested,
        (void)senses; }

private:
    const Frames frames_;
    const ArmLimits limits_;
    std::vector<Leg> legs_;
    std::size_t leg_ = 0;
    double time_ = 0;                       // [s] in this leg
    bool braking_ = false;
    std::unique_ptr<Increments> increments_;
    bool stays_ = false;                    // when the path has ended it goes on with the increments
    double acceleration_ = 0;
    Posture posture_;
};

}  // namespace robot
