// path.h -- the path of a motion, and how far along it the arm is at a time.
//
// A path is a sequence of straight lines, in joint space or of the tool, whose corners may be rounded. A profile says how
// far along it one is: it speeds up, keeps the speed, slows down. It can be told to brake at any time, which stays on the
// path.
//
// Threads:   one at a time.
// Allocates: Path::add alone.
#pragma once

#include <vector>

#include "place.h"

namespace robot {

struct Profile {
    Profile() = default;
    // From rest to rest.   length: in units of the path; speed, acceleration: of these, > 0.
    Profile(double length, double speed, double acceleration);

    double duration() const { return braking_ ? brakeAt_ + brakeSpeed_ / acceleration_ : total_; }      // [s] in all
    double at(double time) const;           // how far, 0 .. length
    double speedAt(double time) const;
    void brake(double time);                // slow down from then on; no change if it slows down already

private:
    double length_ = 0, acceleration_ = 1, top_ = 0;
    double ramp_ = 0, total_ = 0;           // [s] of speeding up, of all
    bool braking_ = false;
    double brakeAt_ = 0, brakeFrom_ = 0, brakeSpeed_ = 0;
};

struct Knot {                               // a point of a path, given in one of two ways
    Joints q = Joints::Zero();
    ToolPose tool;
};

class Path {
public:
    enum class Kind { joints, line };

    // metresPerRadian: how much a turn of the tool counts on a line.
    Path(Kind kind, const Knot& start, double metresPerRadian);
    // Go on to there. rounding: of the corner before it, as a distance from it; at most half of either side.
    void add(const Knot& next, double rounding = 0);

    Kind kind() const { return kind_; }
    double length() const { return pieces_.empty() ? 0 : pieces_.back().from + pieces_.back().length; }     // [rad] or [m]
    // The largest speed at which rounded corners stay within an acceleration.
    double fastest(double acceleration) const;
    Knot at(double distance) const;

private:
    struct Piece {
        Knot a, corner, b;                  // a line from a to b, or rounded
        bool round;
        double from, length;
        double bend;                        // of a round one: by how much the direction changes, 0 .. 2
    };
    double distance(const Knot& a, const Knot& b) const;
    Knot mix(const Knot& a, const Knot& b, double part) const;
    void append(Piece piece);

    Kind kind_;
    Knot start_;
    double metresPerRadian_;
    std::vector<Piece> pieces_;
};

}  // namespace robot
