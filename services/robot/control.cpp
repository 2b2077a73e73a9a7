#include "control.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <system_error>

namespace robot {

namespace {

constexpr double kPatience = 1.5;           // [s] until the power must have come
constexpr double kSpeedSlack = 1.05, kAccelerationSlack = 2;    // of the gate: what rounding and corners of speed may add
constexpr double kMostFelt = 1e6;           // [N], [N m]
const Vector3d kGravity(0, 0, -9.81);       // [m/s2]

}  // namespace

const char* toText(Phase phase) {
    switch (phase) {
        case Phase::off: return "off";
        case Phase::waking: return "waking";
        case Phase::holding: return "holding";
        case Phase::moving: return "moving";
        case Phase::braking: return "braking";
    }
    return "";
}

const char* toText(Outcome outcome) {
    switch (outcome) {
        case Outcome::done: return "done";
        case Outcome::stopped: return "stopped";
        case Outcome::guard: return "guard";
        case Outcome::overload: return "overload";
        case Outcome::powerLost: return "power lost";
        case Outcome::silent: return "other side silent";
        case Outcome::unreachable: return "place out of reach";
        case Outcome::limits: return "limits of a joint";
        case Outcome::singular: return "singularity";
        case Outcome::gate: return "stopped by the gate";
        case Outcome::sensorLost: return "no sensor for a guard";
    }
    return "";
}

Control::Control(std::string prefix) : arm(std::move(prefix)), bell_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (bell_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    ending_.guard.reserve(256);
}

Control::~Control() { close(bell_); }

namespace {

// A tick of joints that brake, each as hard as it may.
void slowDown(const ArmLimits& l, double period, Joints& q, Joints& qdot) noexcept {
    for (int i = 0; i < 6; ++i) qdot[i] = std::copysign(std::max(0.0, std::fabs(qdot[i]) - l.acceleration[i] * period), qdot[i]);
    q += qdot * period;
}

}  // namespace

// ---- between ticks ----

void Control::wake() {
    if (phase_ == Phase::off) phase_ = Phase::waking, waited_ = 0, offTaken_ = false, before_ = arm.written();
}

void Control::sleep() { phase_ = Phase::off; }

void Control::begin(Motion& motion, std::vector<Guard> guards) {
    motion_ = &motion;
    guards_ = std::move(guards);
    needsForce_ = std::any_of(guards_.begin(), guards_.end(), [](auto& g) { return g.feels(); });
    for (auto& g : guards_) ending_.guard.reserve(g.name.size());
    guardsChanged_ = false, reason_ = false, onPath_ = true, ended_ = false;
    stop_ = false;
    phase_ = Phase::moving;
}

void Control::replaceGuard(const Guard& guard) {
    for (auto& g : guards_)
        if (g.name == guard.name) g = guard, guardsChanged_ = true;
    needsForce_ = std::any_of(guards_.begin(), guards_.end(), [](auto& g) { return g.feels(); });
}

bool Control::takeEnding(Ending& ending) {
    if (!ended_) return false;
    ended_ = false;
    ending = ending_;
    return true;
}

void Control::quiet() const {
    std::uint64_t count;
    (void)!read(bell_, &count, sizeof count);
}

// ---- the tick ----

void Control::tick(std::int64_t time, double period) noexcept {
    double age = 0;
    const double silence = std::max(settings.silence, 3 * period);
    heard_ = arm.read(state_, age) && age < silence;
    knows_ = knows_ || heard_;
    sense(period, silence);
    followPower();
    const Joints before = qdot_;
    if (phase_ == Phase::moving || phase_ == Phase::braking) move(period);
    if (phase_ == Phase::off || phase_ == Phase::waking) q_ = state_.q, qdot_.setZero();
    const ToolPose tool = settings.frames.toolOf(q_);
    const Vector3d velocity = (tool.p - tool_.p) / period;
    const bool resting = phase_ == Phase::off || phase_ == Phase::waking;
    acceleration_ = resting ? Vector3d(0, 0, 0) : Vector3d((velocity - velocity_) / period);
    velocity_ = resting ? Vector3d(0, 0, 0) : velocity;
    tool_ = tool;
    if (!heard_) return;
    const double now = double(time) * 1e-9 + (settings.labClock ? 0 : arm.clockOffset());
    // The measured speed is the mean of the last period; the set-point's own is half a period ahead of it.
    const Joints speed = qdot_.isZero(0) ? Joints(Joints::Zero()) : Joints(qdot_ + 0.5 * (qdot_ - before));
    const bool runs = phase_ == Phase::moving || phase_ == Phase::braking;
    const Mode mode = phase_ == Phase::off ? Mode::off : runs ? Mode::run : Mode::hold;
    arm.write(now + period, q_, speed, phase_ == Phase::waking && !offTaken_ ? Mode::off : mode);
    if (phase_ == Phase::waking) waited_ += period;
    arm.record(state_.time, settings.frames.toolOf(state_.q), state_.q, felt_);
}

void Control::sense(double period, double silence) noexcept {
    const bool before = sensed_;
    sensed_ = settings.sensors && heard_ && arm.readWrist(raw_, silence);
    faults.senseless += before && !sensed_ && settings.sensors && heard_;
    if (!sensed_) return felt_.setZero(), void();
    Wrench felt = settings.sensorOffset - raw_;
    if (settings.compensate) {
        const Eigen::Matrix3d r = settings.frames.toolOf(state_.q).r.toRotationMatrix();
        const Vector3d carried = settings.handMass * (r.transpose() * (acceleration_ - kGravity));
        felt.head<3>() += carried;
        felt.tail<3>() += settings.handCentre.cross(carried);
    }
    // A value that no sensor can feel must not stay for long, or overflow.
    felt = felt.cwiseMax(-kMostFelt).cwiseMin(kMostFelt);
    felt_ += -std::expm1(-period / settings.forceFilter) * (felt - felt_);
    const bool over = !(felt_.head<3>().norm() <= settings.wristForce && felt_.tail<3>().norm() <= settings.wristMoment);
    if (!over) armed_ = true;
    if (!over || !armed_ || overloaded_) return;
    overloaded_ = true;
    if (phase_ != Phase::moving && phase_ != Phase::braking) ++faults.overloads;
    if (phase_ == Phase::moving || (phase_ == Phase::braking && onPath_)) {
        if (reason_) onPath_ = false;
        else {
            const double force = felt_.head<3>().norm();
            const bool byForce = force > settings.wristForce;
            ending_.trip = {byForce ? "force [N]" : "moment [N m]", byForce ? force : felt_.tail<3>().norm(), 0,
                            byForce ? settings.wristForce : settings.wristMoment};
            failMotion(Outcome::overload, false);
        }
    }
}

void Control::followPower() noexcept {
    if (phase_ == Phase::off) return;
    if (phase_ == Phase::waking) {
        // First comes "off", which the other side waits for after a reset. It looks at the newest set-point, and may have been busy: so "off"
        // stays until it is in use.
        if (heard_ && !offTaken_) offTaken_ = !state_.power && state_.inUse > before_ && state_.inUse <= arm.written();
        else if (heard_ && state_.power) {
            phase_ = Phase::holding, q_ = state_.q, qdot_.setZero();
            ending_.outcome = Outcome::done;
            return finish();
        }
        if (heard_ && waited_ < kPatience) return;
    } else if (heard_ && state_.power) {
        return;
    }
    const bool waited = phase_ == Phase::waking;
    ending_.outcome = heard_ ? Outcome::powerLost : Outcome::silent;
    phase_ = Phase::off;
    if (motion_ || waited) return finish();
    if (heard_) ++faults.power[std::size_t(state_.cause)];
    else ++faults.silences;
}

void Control::move(double period) noexcept {
    if (stop_.exchange(false) && phase_ == Phase::moving) failMotion(Outcome::stopped, true);
    if (phase_ == Phase::moving && needsForce_ && !sensed_) failMotion(Outcome::sensorLost, true);
    Joints q = q_;
    if (onPath_) {
        const Senses senses{period, sensed_, raw_, settings.frames.toolOf(state_.q).r * felt_.head<3>()};
        switch (motion_->next(senses, q)) {
            case Motion::Step::going: break;
            case Motion::Step::done:
                if (!reason_) ending_.outcome = Outcome::done;
                phase_ = Phase::holding;
                break;
            case Motion::Step::unreachable: failMotion(Outcome::unreachable, false); break;
            case Motion::Step::limits: failMotion(Outcome::limits, false); break;
            case Motion::Step::singular: failMotion(Outcome::singular, false); break;
        }
    }
    if (onPath_ && phase_ == Phase::moving) checkGuards(q, period);
    if (onPath_ && motion_->looksAhead() > 0 && !restsInside(q, period))
        failMotion(ending_.trip.what ? Outcome::guard : Outcome::limits, false);
    if (onPath_) {
        const Joints qdot = phase_ == Phase::holding ? Joints(Joints::Zero()) : Joints((q - q_) / period);
        if (Ending why; passes(q, qdot, period, why)) {
            q_ = q, qdot_ = qdot;
        } else {
            phase_ = Phase::moving;         // also where it was to be over
            if (!reason_) ending_.joint = why.joint, ending_.trip = why.trip;
            failMotion(Outcome::gate, false);
        }
    }
    if (!onPath_) brakeJoints(period);
    if (phase_ == Phase::holding) finish();
}

// Not where the arm is, but where it is being sent.
GuardInput Control::viewOf(const Joints& q, double period) const noexcept {
    GuardInput view;
    view.tool = settings.frames.toolOf(q);
    const Vector3d velocity = (view.tool.p - tool_.p) / period;
    view.speed = velocity.norm();
    view.ahead = view.tool.p;
    const double slowing = guardsChanged_ ? std::max(0.5, motion_->looksAhead()) : motion_->looksAhead();
    if (slowing > 0) view.ahead += velocity * (view.speed / (2 * slowing) + period);
    view.sensed = sensed_;
    view.felt = felt_;
    view.singular = puma::distances(q);
    return view;
}

void Control::checkGuards(const Joints& q, double period) noexcept {
    const GuardInput view = viewOf(q, period);
    for (auto& guard : guards_) {
        if (guard.check(view, ending_.trip)) continue;
        ending_.guard.assign(guard.name);
        return failMotion(Outcome::guard, true);
    }
}

bool Control::passes(const Joints& q, const Joints& qdot, double period, Ending& why) const noexcept {
    const auto& l = settings.limits;
    for (int i = 0; i < 6; ++i) {
        const double acceleration = std::fabs(qdot[i] - qdot_[i]) / period;
        why.joint = i + 1;
        constexpr double kTolerance = 1e-9;
        if (!(q[i] >= l.angles.lower[i] - kTolerance && q[i] <= l.angles.upper[i] + kTolerance))
            why.trip = {"angle [rad]", q[i], l.angles.lower[i], l.angles.upper[i]};
        else if (!(std::fabs(qdot[i]) <= kSpeedSlack * l.speed[i]))
            why.trip = {"speed [rad/s]", std::fabs(qdot[i]), 0, l.speed[i]};
        else if (!(acceleration <= kAccelerationSlack * l.acceleration[i]) && phase_ != Phase::holding)
            why.trip = {"acceleration [rad/s2]", acceleration, 0, l.acceleration[i]};
        else continue;
        return false;
    }
    return true;
}

// After a set-point something may stop the arm by its joints at any moment, and that leads off its path. There, too, it must
// stay where guards and the joints' limits allow it. False: ending_.trip is what a guard says, or empty.
bool Control::restsInside(Joints q, double period) noexcept {
    Joints qdot = (q - q_) / period;
    for (int i = 0; i < 6; ++i)     // the gate would stop it: it does not get as far as that
        if (!(std::fabs(qdot[i]) <= kSpeedSlack * settings.limits.speed[i])) return true;
    GuardInput view;
    for (Trip trip; !qdot.isZero(0);) {
        slowDown(settings.limits, period, q, qdot);
        view.ahead = view.tool.p = settings.frames.toolOf(q).p;
        for (auto& guard : guards_) {
            if (guard.check(view, trip)) continue;
            if (!reason_) ending_.guard.assign(guard.name), ending_.trip = trip;
            return false;
        }
    }
    const auto& angles = settings.limits.angles;
    constexpr double kTolerance = 1e-9;
    if ((q - angles.upper).maxCoeff() <= kTolerance && (angles.lower - q).maxCoeff() <= kTolerance) return true;
    if (!reason_) ending_.trip = {};
    return false;
}

void Control::brakeJoints(double period) noexcept {
    slowDown(settings.limits, period, q_, qdot_);
    q_ = q_.cwiseMax(settings.limits.angles.lower).cwiseMin(settings.limits.angles.upper);
    phase_ = qdot_.isZero(0) ? Phase::holding : Phase::braking;
}

// onPath: it can go on along its path while it slows down.
void Control::failMotion(Outcome outcome, bool onPath) noexcept {
    if (!reason_) ending_.outcome = outcome;
    reason_ = true;
    phase_ = Phase::braking;
    if (onPath && onPath_) motion_->brake();
    else onPath_ = false;
}

void Control::finish() noexcept {
    ++faults.motions[std::size_t(ending_.outcome)];
    motion_ = nullptr;
    ended_ = true;
    const std::uint64_t one = 1;
    (void)!::write(bell_, &one, sizeof one);
}

}  // namespace robot
