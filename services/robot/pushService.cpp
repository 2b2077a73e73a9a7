// push -- moves something with one straight finger: approaches until it feels it, pushes it along, gives way to more force.
//
//     push EXEC FMSG 6 0.5 0.1 0.03  0.6 0.1 0.03
#include <algorithm>
#include <cmath>

#include "push.h"

namespace robot {

using sorma::Message;

PushMotion::PushMotion(const Frames& frames, const ArmLimits& limits, PathMotion transfer, const ToolPose& from,
                       const Vector3d& to, const Manner& manner)
    : frames_(frames), limits_(limits), transfer_(std::move(transfer)), from_(from), direction_((to - from.p).normalized()),
      length_((to - from.p).norm()), manner_(manner) {}

Motion::Step PushMotion::next(const Senses& senses, Joints& q) noexcept {
    const double period = senses.period;
    if (phase_ == Phase::transfer) {
        const Step step = transfer_.next(senses, q);
        if (step != Step::done || over_) return step;
        phase_ = Phase::approach;
        return Step::going;
    }
    const double force = -senses.pressed.dot(direction_);
    peak = std::max(peak, force);
    const double step = manner_.acceleration * period;
    speed_ += std::clamp(wantedSpeed(force, period) - speed_, -step, step);
    way_ += speed_ * period;
    reached = std::max(reached, way_);
    switch (posture_.find(frames_, limits_, {from_.p + way_ * direction_, from_.r}, q, q)) {
        case Posture::unreachable: return Step::unreachable;
        case Posture::limits: return Step::limits;
        case Posture::singular: return Step::singular;
        case Posture::none: break;
    }
    return over_ && std::fabs(speed_) < 1e-9 ? Step::done : Step::going;
}

// And what follows on the present phase.
double PushMotion::wantedSpeed(double force, double period) noexcept {
    const double left = length_ - way_;
    auto towards = [&](double distance, double speed) {
        return std::min(speed, std::sqrt(2 * manner_.acceleration * std::max(0.0, distance - std::fabs(speed_) * period)));
    };
    if (phase_ == Phase::approach && force >= manner_.contact) {
        // It was between the last tick and this one that the force grew to that of contact.
        const double part = (manner_.contact - force_) / (force - force_);
        touched = true, contactWay = way_ - (force_ < manner_.contact ? 1 - part : 0) * speed_ * period;
        contact = from_.p + contactWay * direction_;
        phase_ = Phase::push;
    }
    force_ = force;
    if (phase_ == Phase::push || phase_ == Phase::approach) {
        const bool pushes = phase_ == Phase::push;
        // The larger the force, the slower; above the largest force it goes back.
        const double wanted = pushes
            ? manner_.pushSpeed * std::clamp((manner_.most - force) / (manner_.most - manner_.contact), -1.0, 1.0)
                                     : manner_.approachSpeed;
        stuck_ = std::fabs(speed_) < 5e-4 ? stuck_ + period : 0;
        if (left > 1e-5 && !(pushes && stuck_ > 1)) return wanted > 0 ? towards(left, wanted) : wanted;
        phase_ = Phase::retreat, back_ = std::max(0.0, way_ - manner_.retreat);
    }
    if (phase_ == Phase::retreat && way_ > back_ + 1e-5) return -towards(way_ - back_, manner_.approachSpeed);
    over_ = true;
    return 0;
}

void PushMotion::brake() noexcept {
    over_ = true;
    if (phase_ == Phase::transfer) transfer_.brake();
    else phase_ = Phase::braking;
}

sorma::Class Push::describe() {
    using enum sorma::Field;
    auto c = sorma::Class::of<Push>("push", "pushes something with one straight finger");
    Mover::describe<Push>(c);
    c.real("-approachSpeed", &Push::approachSpeed_, {.unit = "m/s", .low = 0.001, .high = 0.1,
                                                     .help = "until there is contact; the faster, the harder it hits"})
        .real("-pushSpeed", &Push::pushSpeed_, {.unit = "m/s", .low = 0.001, .high = 0.1,
                                                .help = "with the object, at the force of contact"})
        .real("-contactForce", &Push::contactForce_, {.unit = "N", .low = 0.2, .high = 50,
                                                      .help = "against the motion: that is contact"})
        .real("-mostForce", &Push::mostForce_, {.unit = "N", .low = 0.3, .high = 50,
                                                .help = "against the motion: there the push stands still; with more it "
                                                        "gives way"})
        .real("-retreat", &Push::retreat_, {.unit = "m", .low = 0, .high = 0.2, .help = "how far it goes back at the end"})
        .reads(floats, sorma::exactly(6), "m", "where the approach begins, where the push ends (3 each), of the tool in "
                                               "the world", -10, 10)
        .writes(floats, sorma::exactly(5), "", "where the contact was [m] (3), how far the object was pushed [m], largest "
                                               "force [N]")
        .example("push CTRL -contactForce 2");
    return c;
}

void Push::changed(std::span<const sorma::Option* const>) {
    if (mostForce_ <= contactForce_) fail(kOrder, name(), "-mostForce",
                                          number(mostForce_) + " N must be above -contactForce " + number(contactForce_));
}

void Push::exec(Message& m) {
    const std::vector<double> f = m.floats;
    const Vector3d from(f[0], f[1], f[2]), to(f[3], f[4], f[5]);
    if ((to - from).norm() < 1e-4) fail(kTarget, name(), "the push ends where the approach begins");
    launch(m, [this, f](const Now& now) { return plan(now, f); },
           [this, length = (to - from).norm()](Message& reply, const Now&, Motion& motion) {
               auto& push = static_cast<PushMotion&>(motion);
               if (!push.touched) fail(kNoContact, name(), number(length), number(push.peak), number(contactForce_));
               reply.floats = {push.contact.x(), push.contact.y(), push.contact.z(), push.reached - push.contactWay,
                               push.peak};
           });
}

Job::Plan Push::plan(const Now& now, const std::vector<double>& f) {
    if (!now.sensed) fail(kSensor, name(), "without it there is no contact to be felt");
    auto all = guards(now);
    const ToolPose from{{f[0], f[1], f[2]}, now.tool.r}, to{{f[3], f[4], f[5]}, now.tool.r};
    Path there = lineFrom(now), along(Path::Kind::line, {now.q, from}, speed_ / turnSpeed_);
    there.add({now.q, from});
    along.add({now.q, to});
    const auto &frames = now.settings.frames;
    const auto &limits = now.settings.limits;
    PathMotion trial(frames, limits, {line(there, speed_), line(along, std::max(approachSpeed_, pushSpeed_))});
    verify(now, trial, all);
    // Where it feels something it stops harder than on its way.
    const PushMotion::Manner manner{approachSpeed_, pushSpeed_, contactForce_, mostForce_, std::max(acceleration_, 1.0),
                                    retreat_};
    return {std::make_unique<PushMotion>(frames, limits, PathMotion(frames, limits, {line(there, speed_)}), from, to.p,
                                         manner), std::move(all)};
}

}  // namespace robot
