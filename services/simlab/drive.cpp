#include "drive.h"

#include <algorithm>
#include <cmath>

namespace simlab {

namespace {

constexpr Joints kMostSpeed = {1.92, 1.51, 2.40, 5.34, 5.09, 5.74};      // [rad/s]
constexpr Joints kBrake = {97.6, 186.4, 89.4, 24.2, 20.1, 21.3};         // [N m]
constexpr double kBrakeDelay = 0.020;       // [s] until the brakes have closed
constexpr double kNear = 0.05;              // [rad] power comes back when a set-point is so near to the arm
constexpr double kSlowest = 0.002;          // [rad/s] below, friction is compensated in part: a joint that shall rest must not creep
constexpr double kStill = 0.002;            // [rad/s]
constexpr double kStillFor = 0.05;          // [s]
constexpr double kFarAhead = 1;             // [s] a set-point may be due so late
constexpr int kSilentPeriods = 3;

std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return text;
}

}  // namespace

const char* toText(Cause cause) {
    static constexpr const char* kNames[] = {"none",        "emergency stop",  "table force",
                                             "wrist force", "late set-points", "limit"};
    return kNames[std::size_t(cause)];
}

Drive::Drive(Scene& scene) : scene_(scene), wanted_(std::size_t(scene.model->nv)), needed_(wanted_.size()) {
    for (std::size_t i = 0; i < 6; ++i) {
        const int s = scene.servo[i];
        gain_[i] = scene.model->actuator_gainprm[mjNGAIN * s];
        damping_[i] = -scene.model->actuator_biasprm[mjNBIAS * s + 2];
        friction_[i] = scene.model->dof_frictionloss[scene.armDof[i]];
    }
    switchServos(false);
    brake(true);
}

void Drive::switchServos(bool on) {
    for (std::size_t i = 0; i < 6; ++i) {
        const int s = scene_.servo[i];
        scene_.model->actuator_gainprm[mjNGAIN * s] = on ? gain_[i] : 0;
        scene_.model->actuator_biasprm[mjNBIAS * s + 1] = on ? -gain_[i] : 0;
        scene_.model->actuator_biasprm[mjNBIAS * s + 2] = on ? -damping_[i] : 0;
    }
}

void Drive::brake(bool on) {
    for (std::size_t i = 0; i < 6; ++i)
        scene_.model->dof_frictionloss[scene_.armDof[i]] = friction_[i] + (on ? kBrake[i] : 0);
}

void Drive::place(mjData& d, const Joints& q) {
    for (std::size_t i = 0; i < 6; ++i) d.qpos[scene_.armQpos[i]] = d.ctrl[scene_.servo[i]] = q[i];
    actual_ = q;
}

// ---- set-points ----

std::string Drive::fault(const Point& p, Mode mode, double now) const {
    const auto limits = [&](std::size_t i) { return scene_.model->actuator_ctrlrange + 2 * scene_.servo[i]; };
    if (mode != Mode::hold && mode != Mode::run) return {};
    const Point at = reference(now);
    const double ahead = std::max(p.due - now, double(scene_.model->opt.timestep));
    for (std::size_t i = 0; i < 6; ++i) {
        const std::string joint = "joint " + std::to_string(i + 1);
        if (p.q[i] < limits(i)[0] - 1e-6 || p.q[i] > limits(i)[1] + 1e-6)
            return joint + " at " + number(p.q[i]) + " rad is outside " + number(limits(i)[0]) + " .. " +
                   number(limits(i)[1]);
        if (std::fabs(p.speed[i]) > 1.05 * kMostSpeed[i])
            return joint + " at " + number(p.speed[i]) + " rad/s is faster than " + number(kMostSpeed[i]);
        // It must be reached at 1.5 times the greatest speed; what comes late leaves less time, so a small step is no fault.
        const double step = std::fabs(p.q[i] - at.q[i]);
        if (power() && step > 1.5 * kMostSpeed[i] * ahead && step > kNear)
            return joint + " would have to move by " + number(step) + " rad in " + number(ahead) + " s";
    }
    return {};
}

// Why power does not come back with this set-point: it must be where the arm is.
std::string Drive::nearness(const Point& p) const {
    for (std::size_t i = 0; i < 6; ++i)
        if (std::fabs(p.q[i] - actual_[i]) > kNear)
            return "it is " + number(std::fabs(p.q[i] - actual_[i])) + " rad from where joint " + std::to_string(i + 1) +
                   " is; power comes within " + number(kNear);
    return {};
}

void Drive::take(const double* record, double due, std::uint64_t counter, double now) {
    came_ = now;
    bool finite = std::isfinite(due);
    for (int i = 0; i < 13; ++i) finite = finite && std::isfinite(record[i]);
    const double kind = finite ? record[12] : -1;
    const std::string which = "set-point " + std::to_string(counter) + ": ";
    if (!finite) return slow(Cause::limit, which + "it is not finite", now);
    if (kind != 0 && kind != 1 && kind != 2 && kind != 3)
        return slow(Cause::limit, which + "mode " + number(kind) + " is none of 0 (off), 1 (hold), 2 (run), 3 (stop)", now);
    const Mode mode = Mode(int(kind));
    if (due > now + kFarAhead)
        return slow(Cause::limit, which + "due " + number(due - now) + " s from now; at most 1 s ahead is taken", now);
    if (lastDue_ >= 0 && due > lastDue_) period_ = std::clamp(due - lastDue_, 0.001, 0.2);
    lastDue_ = due;
    if (mode == Mode::run && due < now - kSilentPeriods * period_) return;     // too old to be of use: as if it had not come
    Point p;
    p.due = due;
    std::copy_n(record, 6, p.q.begin());
    if (mode == Mode::run) std::copy_n(record + 6, 6, p.speed.begin());
    if (auto wrong = fault(p, mode, now); !wrong.empty()) return slow(Cause::limit, which + wrong, now);

    arrival_ = now;
    counter_ = counter;
    if (mode == Mode::off) armed_ = cause_ == Cause::none;
    if (mode == Mode::off || mode == Mode::stop) return phase_ == Phase::powered ? slow(Cause::none, {}, now) : void();
    if (phase_ == Phase::slowing || brakeAt_ >= 0) return;      // first it stands
    if (phase_ == Phase::braked) {
        if (cause_ != Cause::none || !armed_) return;
        if (auto far = nearness(p); !far.empty()) return slow(Cause::limit, which + far, now);
        armed_ = false;
        switchServos(true);
        brake(false);
    }
    from_ = phase_ == Phase::braked ? Point{now, actual_, {}} : reference(now);
    phase_ = Phase::powered;
    next_ = p;
}

bool Drive::streaming(double now) const { return came_ >= 0 && now - came_ <= kSilentPeriods * period_; }

// Where it shall be now.
Drive::Point Drive::reference(double now) const {
    Point p;
    p.due = now;
    if (phase_ == Phase::slowing) {
        const double length = until_ - since_, t = std::clamp(now - since_, 0.0, length),
                     rest = length > 0 ? 1 - t / length : 0;
        for (std::size_t i = 0; i < 6; ++i) {
            p.q[i] = slowFrom_.q[i] + slowFrom_.speed[i] * (length > 0 ? t * (1 + rest) / 2 : 0);
            p.speed[i] = slowFrom_.speed[i] * rest;
            p.acceleration[i] = t < length ? -slowFrom_.speed[i] / length : 0;
        }
        return p;
    }
    if (phase_ == Phase::braked) {
        p.q = actual_;
        return p;
    }
    const double part = next_.due > from_.due ? std::clamp((now - from_.due) / (next_.due - from_.due), 0.0, 1.0) : 1;
    const double beyond = std::max(now - next_.due, 0.0);
    for (std::size_t i = 0; i < 6; ++i) {
        p.speed[i] = from_.speed[i] + part * (next_.speed[i] - from_.speed[i]);
        p.q[i] = from_.q[i] + part * (next_.q[i] - from_.q[i]) + beyond * next_.speed[i];
        p.acceleration[i] = part < 1 ? (next_.speed[i] - from_.speed[i]) / (next_.due - from_.due) : 0;
    }
    return p;
}

// ---- stops ----

void Drive::slow(Cause cause, std::string why, double now) {
    if (cause_ != Cause::none) return;
    cause_ = cause;
    if (cause != Cause::none) {
        why_ = std::move(why);
        armed_ = false;
    }
    if (!power()) return;
    const Point at = reference(now);
    double fastest = 0;
    for (double v : at.speed) fastest = std::max(fastest, std::fabs(v));
    slowFrom_ = at;
    since_ = now;
    until_ = now + fastest / deceleration;
    phase_ = Phase::slowing;
    stopTime_ = now;
    measuring_ = true;
    stop_ = {};
}

void Drive::cut(Cause cause, std::string why, double now) {
    if (cause_ != Cause::none && phase_ == Phase::braked) return;
    cause_ = cause;
    why_ = std::move(why);
    armed_ = false;
    if (!measuring_) stop_ = {}, stopTime_ = now;
    measuring_ = true;
    if (phase_ == Phase::braked) return;
    phase_ = Phase::braked;
    switchServos(false);
    brakeAt_ = now + kBrakeDelay;
}

void Drive::reset() {
    cause_ = Cause::none;
    why_.clear();
}

double Drive::torque(const mjData& d, std::size_t joint) const {
    if (!power()) return 0;
    return d.actuator_force[scene_.servo[joint]] + d.qfrc_applied[scene_.armDof[joint]];
}

// ---- each step ----

void Drive::control(mjData& d, double now) {
    for (std::size_t i = 0; i < 6; ++i) actual_[i] = d.qpos[scene_.armQpos[i]];
    // The weight is borne by the motors' gravity compensation, or by the brakes, which therefore only have to stop motion.
    for (int dof : scene_.armDof) d.qfrc_applied[dof] = d.qfrc_bias[dof];
    if (phase_ == Phase::powered && now - arrival_ > kSilentPeriods * period_ + 1e-9)
        slow(Cause::late,
             "no set-point for " + std::to_string(kSilentPeriods) + " periods of " + number(1000 * period_) + " ms", now);
    if (phase_ == Phase::slowing && now >= until_ + kStillFor) {
        phase_ = Phase::braked;
        switchServos(false);
        brakeAt_ = now;
    }
    if (brakeAt_ >= 0 && now >= brakeAt_) {
        brake(true);
        brakeAt_ = -1;
    }
    if (power()) follow(d, reference(now));
    watch(d, now);
}

// Servos alone would be behind by what friction and inertia take over their stiffness: more than half a millimetre at the tool.
void Drive::follow(mjData& d, const Point& at) {
    for (std::size_t i = 0; i < 6; ++i) wanted_[std::size_t(scene_.armDof[i])] = at.acceleration[i];
    mj_mulM(scene_.model.get(), &d, needed_.data(), wanted_.data());
    for (std::size_t i = 0; i < 6; ++i) {
        const int dof = scene_.armDof[i];
        const double torque = needed_[std::size_t(dof)] + friction_[i] * std::clamp(at.speed[i] / kSlowest, -1.0, 1.0) +
                              (damping_[i] + scene_.model->dof_damping[dof]) * at.speed[i];
        d.ctrl[scene_.servo[i]] = at.q[i] + torque / gain_[i];
    }
}

// How far it comes from the first moment of a stop.
void Drive::watch(const mjData& d, double now) {
    const mjtNum* tool = d.site_xpos + 3 * scene_.tool;
    if (!measuring_) {
        stopFrom_ = actual_;
        std::copy_n(tool, 3, stopTool_.begin());
        stillSince_ = now;
        return;
    }
    double fastest = 0;
    for (int dof : scene_.armDof) fastest = std::max(fastest, std::fabs(double(d.qvel[dof])));
    if (fastest > kStill) stillSince_ = now;
    if (now - stillSince_ < kStillFor && now - stopTime_ < 5) return;
    measuring_ = false;
    measured_ = cause_ != Cause::none;
    stop_.cause = cause_;
    stop_.seconds = std::max(stillSince_ - stopTime_, 0.0);
    stop_.tool = std::hypot(tool[0] - stopTool_[0], tool[1] - stopTool_[1], tool[2] - stopTool_[2]);
    stop_.joint = 0;
    for (std::size_t i = 0; i < 6; ++i) stop_.joint = std::max(stop_.joint, std::fabs(actual_[i] - stopFrom_[i]));
}

bool Drive::stopped(Stopped& out) {
    if (!measured_) return false;
    measured_ = false;
    out = stop_;
    return true;
}

}  // namespace simlab
