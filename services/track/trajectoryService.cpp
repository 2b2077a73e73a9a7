// trajectory -- set-points on the way to a target that may move, with limits of speed and acceleration.
//
//     trajectory.tool EXEC start FMSG 7 0.4 0 0.3 1 0 0 0          where the tool is
//     trajectory.tool EXEC FMSG 13 x y z  qw qx qy qz  vx vy vz  0 0 0     once in each tick: where it shall be, how fast that moves
//
// A step of a cycle or a unit of a circuit. doc/track.man tells all.
#include <cmath>

#include "track.h"

namespace track {

namespace {

using sorma::Message;
using sorma::Severity;
using Eigen::Map;
using Eigen::Quaterniond;
using Eigen::Vector3d;

const sorma::Prototype kWord{Severity::error, "TRAJECTORY WORD", 2, "{}: bad word \"{}\": must be start"};
const sorma::Prototype kFloats{Severity::error, "TRAJECTORY FLOATS", 1, "{}: {} expects {} floats ({}), got {}"};
const sorma::Prototype kValue{Severity::error, "TRAJECTORY VALUE", 1, "{}: float {} is {}; it must be a finite number"};
const sorma::Prototype kOrientation{Severity::error, "TRAJECTORY ORIENTATION", 1,
                                    "{}: the quaternion w x y z has the length {}; it must be 1"};
const sorma::Prototype kStart{Severity::error, "TRAJECTORY START", 1, "{}: it does not know where the tool is: EXEC start, position and quaternion"};
const sorma::Prototype kPeriod{Severity::error, "TRAJECTORY PERIOD", 1, "{}: it has no time step: run it in a cycle, in a circuit with -period, or give it a -period"};

constexpr std::size_t kPose = 7, kTarget = 13, kAnswer = 13;

}  // namespace

sorma::Class Trajectory::describe() {
    using enum sorma::Field;
    return sorma::Class::of<Trajectory>("trajectory", "leads a tool to a target that may move, within limits of speed and acceleration")
        .real("-speed", &Trajectory::speed_, {.unit = "m/s", .low = 1e-4, .high = 10, .help = "at most"})
        .real("-acceleration", &Trajectory::acceleration_, {.unit = "m/s^2", .low = 1e-3, .high = 100, .help = "at most, in any direction"})
        .real("-turnSpeed", &Trajectory::turnSpeed_, {.unit = "rad/s", .low = 1e-4, .high = 20, .help = "of the orientation, at most"})
        .real("-turnAcceleration", &Trajectory::turnAcceleration_, {.unit = "rad/s^2", .low = 1e-3, .high = 200, .help = "of the orientation, at most"})
        .real("-brake", &Trajectory::brake_, {.unit = "1", .low = 0.1, .high = 1,
                                              .help = "part of the acceleration that braking counts on; above 8/9 it may overshoot"})
        .real("-soft", &Trajectory::soft_, {.unit = "1/s", .low = 0, .high = 1000,
                                            .help = "at the target: speed by distance, so that noise does not make it tremble; 0: stop as fast as it can be done"})
        .real("-stiff", &Trajectory::stiff_, {.unit = "1/s", .low = 0, .high = 1000, .help = "the same, -near from it; it rises in between"})
        .real("-near", &Trajectory::near_, {.unit = "m", .low = 1e-6, .high = 1, .help = "distance for -stiff"})
        .real("-floor", &Trajectory::floor_, {.unit = "m", .low = -100, .high = 100, .help = "height below which something may be touched: it goes down with -touchSpeed at most, and slows down before"})
        .real("-touchSpeed", &Trajectory::touch_, {.unit = "m/s", .low = 1e-4, .high = 10, .help = "downwards, below -floor"})
        .real("-turnNear", &Trajectory::turnNear_, {.unit = "rad", .low = 1e-6, .high = 3, .help = "the same for the orientation"})
        .real("-period", &Trajectory::period_, {.unit = "s", .low = 0, .high = 1, .help = "time step when neither cycle nor circuit gives one"})
        .action("-reset", &Trajectory::forget, "", "forget where the tool is; EXEC start must say it again")
        .words("?start?")
        .reads(floats, sorma::between(kPose, kTarget), "",
               "target: position [m], quaternion w x y z, its velocity [m/s], a velocity to be added [m/s]; start: the pose, 7")
        .writes(floats, sorma::exactly(kAnswer), "", "set-point: position [m], quaternion, velocity [m/s], turning [rad/s]")
        .realtime()
        .example("trajectory EXEC start FMSG 7 0.4 0 0.3 1 0 0 0");
}

void Trajectory::changed(std::span<const sorma::Option* const>) {
    limits_ = {speed_, acceleration_, brake_, soft_, stiff_, near_, floor_, touch_};
    turnLimits_ = {turnSpeed_, turnAcceleration_, brake_, soft_, stiff_, turnNear_};
}

double Trajectory::period() const {
    if (auto* tick = sorma::Tick::current()) [[likely]] return tick->period;
    if (period_ == 0) [[unlikely]] fail(kPeriod, name());
    return period_;
}

void Trajectory::exec(Message& m) {
    const bool starts = !m.words.empty();
    if (starts && (m.words.size() > 1 || m.words[0] != "start")) [[unlikely]] fail(kWord, name(), m.words[m.words.size() > 1 ? 1 : 0]);
    const std::size_t count = starts ? kPose : kTarget;
    if (m.floats.size() != count) [[unlikely]]
        fail(kFloats, name(), starts ? "start" : "a target", count,
             starts ? "position, quaternion" : "position, quaternion, velocity, velocity to be added", m.floats.size());
    for (std::size_t i = 0; i < count; ++i)
        if (!std::isfinite(m.floats[i])) [[unlikely]] fail(kValue, name(), i + 1, m.floats[i]);
    const double* f = m.floats.data();
    Quaterniond orientation(f[3], f[4], f[5], f[6]);
    const double length = orientation.norm();
    if (std::abs(length - 1) > 1e-3) [[unlikely]] fail(kOrientation, name(), length);
    orientation.normalize();
    const Vector3d position = Map<const Vector3d>(f);
    if (starts) {
        sorma::BetweenTicks between(*this);
        course_ = {position, Vector3d::Zero()};
        turn_ = {orientation, Vector3d::Zero()};
        begun_ = true;
    } else {
        if (!begun_) [[unlikely]] fail(kStart, name());
        const double dt = period();
        course_.step(dt, position, Map<const Vector3d>(f + 7), limits_, Map<const Vector3d>(f + 10));
        turn_.step(dt, orientation, turnLimits_);
    }
    m.clear();
    m.floats.resize(kAnswer);
    const Quaterniond& q = turn_.orientation;
    Map<Eigen::Matrix<double, kAnswer, 1>>(m.floats.data()) << course_.position, q.w(), q.x(), q.y(), q.z(), course_.velocity, turn_.velocity;
}

std::vector<sorma::Pin> Trajectory::pins(std::string_view, std::size_t) const {
    return {{"target", true, 0, 3, "m", "where it shall be"},
            {"orientation", true, 3, 4, "1", "w x y z"},
            {"velocity", true, 7, 3, "m/s", "of the target"},
            {"extra", true, 10, 3, "m/s", "to be added, as by a hand that pushes"},
            {"position", false, 0, 3, "m", "set-point"},
            {"turned", false, 3, 4, "1", "set-point, w x y z"},
            {"speed", false, 7, 3, "m/s", "of the set-point"},
            {"turning", false, 10, 3, "rad/s", "of the set-point"}};
}

void Trajectory::dumpState(std::string& out) const {
    if (!begun_) return;
    out += "# position";
    for (double x : course_.position) {
        out += ' ';
        sorma::appendNumber(out, x);
    }
    out += "\n# speed";
    for (double x : course_.velocity) {
        out += ' ';
        sorma::appendNumber(out, x);
    }
    out += '\n';
}

}  // namespace track
