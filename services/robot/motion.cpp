#include "motion.h"

#include <algorithm>
#include <cmath>

namespace robot {

Posture::Fault Posture::find(const Frames& frames, const ArmLimits& limits, const ToolPose& place, const Joints& near,
                             Joints& q) noexcept {
    puma::inverse(frames.flangeOf(place), near, limits.angles, Joints::Ones(), solutions);
    if (solutions.reach != puma::Solutions::reachable) return unreachable;
    if (solutions.count == 0) return Fault::limits;
    const auto first = std::size_t(solutions.order[0]);
    q = solutions.q[first];
    return solutions.near[first] ? singular : none;
}

Increments::Increments(const std::string& key, double speed, double acceleration, double metresPerRadian)
    : reader_(key), seen_(reader_.count()), speed_(speed), acceleration_(acceleration), metresPerRadian_(metresPerRadian) {}

void Increments::next(double period) noexcept {
    std::array<double, kFloats> f;
    shmem::Stamp stamp;
    for (std::uint64_t newest = reader_.count(); !stopping_ && seen_ < newest;) {
        if (!reader_.read(++seen_, f.data(), nullptr, stamp)) continue;
        Wrench d = Eigen::Map<const Wrench>(&f[1]);
        d.tail<3>() *= metresPerRadian_;
        if (d.allFinite()) wanted_ += d;
    }
    const Wrench way = wanted_ - at_;
    const double left = way.norm();
    // In a new direction only as fast as the old one allows.
    if (left > 0 && !stopping_) rate_ *= std::max(0.0, direction_.dot(way) / left), direction_ = way / left;
    const double step = acceleration_ * period;
    const double stoppable = std::max(0.0, std::sqrt(step * step / 4 + 2 * acceleration_ * left) - step / 2);
    const double most = stopping_ ? 0 : std::min(speed_, stoppable);
    rate_ = std::clamp(most, std::max(0.0, rate_ - step), rate_ + step);
    if (!stopping_ && rate_ * period >= left) at_ = wanted_, rate_ = 0;
    else at_ += direction_ * rate_ * period;
}

PathMotion::PathMotion(const Frames& frames, const ArmLimits& limits, std::vector<Leg> legs)
    : frames_(frames), limits_(limits), legs_(std::move(legs)) {}

void PathMotion::follow(std::unique_ptr<Increments> increments, bool stays, double acceleration) {
    increments_ = std::move(increments), stays_ = stays, acceleration_ = acceleration;
}

double PathMotion::duration() const {
    double sum = 0;
    for (auto& leg : legs_) sum += leg.profile.duration() + leg.pause;
    return sum;
}

Motion::Step PathMotion::next(const Senses& senses, Joints& q) noexcept {
    time_ += senses.period;
    if (!braking_ && time_ > legs_[leg_].profile.duration() + legs_[leg_].pause && leg_ + 1 < legs_.size())
        time_ -= legs_[leg_].profile.duration() + legs_[leg_].pause, ++leg_;
    const Leg& leg = legs_[leg_];
    const double there = leg.profile.duration();
    if (time_ > there && leg.pause > 0) resting(leg_, (time_ - there) / leg.pause, senses);
    if (increments_) increments_->next(senses.period);
    const bool over = time_ >= there + (braking_ ? 0 : leg.pause) && (!increments_ || increments_->still()) &&
        (braking_ || !stays_);
    const Knot knot = leg.path.at(leg.profile.at(time_));
    if (leg.path.kind() == Path::Kind::joints) {
        q = knot.q;
        return over ? Step::done : Step::going;
    }
    ToolPose place = knot.tool;
    if (increments_) place = {place.p + increments_->shift(), increments_->turn() * place.r};
    switch (posture_.find(frames_, limits_, place, q, q)) {
        case Posture::unreachable: return Step::unreachable;
        case Posture::limits: return Step::limits;
        case Posture::singular: return Step::singular;
        case Posture::none: break;
    }
    return over ? Step::done : Step::going;
}

void PathMotion::brake() noexcept {
    if (braking_) return;
    braking_ = true;
    legs_[leg_].profile.brake(time_);
    if (increments_) increments_->stop();
}

double PathMotion::part() const {
    double all = 0, gone = 0;
    for (std::size_t i = 0; i < legs_.size(); ++i) {
        const double length = legs_[i].path.length();
        all += length;
        gone += i < leg_ ? length : i == leg_ ? legs_[i].profile.at(time_) : 0;
    }
    return all > 0 ? gone / all : 1;
}

}  // namespace robot
