#include "mover.h"

#include <algorithm>
#include <cmath>

namespace robot {

namespace {

std::string percent(double part) { return number(100 * part); }

std::string singularities(unsigned near) {
    std::string out;
    for (auto& [bit, word] : {std::pair{puma::kShoulder, "shoulder"}, {puma::kElbow, "elbow"}, {puma::kWrist, "wrist"}})
        if (near & bit) out += (out.empty() ? "" : ", ") + std::string(word);
    return out;
}

}  // namespace

void failReach(const std::string& who, const Frames& frames, const ToolPose& place, double part) {
    const Vector3d wrist = puma::wristCentre(frames.flangeOf(place));
    const auto reach = puma::reachOf(wrist);
    if (reach.distance >= reach.least && reach.distance <= reach.most) fail(kTooClose, who, text(place.p), percent(part));
    fail(kUnreachable, who, text(place.p), percent(part), number(reach.distance), number(reach.least), number(reach.most));
}

void failLimits(const std::string& who, const puma::Solutions& s, const puma::Limits& limits, double part) {
    double least = Guard::kAny, angle = 0;
    int joint = 0;
    for (auto& q : s.q) {
        int i;
        const double most = (q - limits.upper).cwiseMax(limits.lower - q).maxCoeff(&i);
        if (most < least) least = most, joint = i, angle = q[i];
    }
    fail(kLimits, who, joint + 1, number(angle), percent(part), allowed({"", 0, limits.lower[joint], limits.upper[joint]}));
}

Pino& Mover::pino() {
    sorma::Reference arm = arm_ ? arm_ : sorm().get("pino");
    auto* p = dynamic_cast<Pino*>(arm.get());
    if (!p) fail(kNotAnArm, name(), "-arm", arm->name(), arm->type().name());
    return *p;
}

void Mover::removing() {
    if (auto* p = dynamic_cast<Pino*>(arm_ ? arm_.get() : sorm().find("pino")); p && p->moves(name()))
        p->stopMotion("because " + name() + " has been removed");
}

void Mover::stopNow(sorma::Message& m) {
    Pino& p = pino();
    const bool moves = p.moves(name());
    m.text += moves ? "stopping" : "it does not move the arm";
    if (moves) p.stopMotion("by CTRL -stop of " + name() + " from " + sorma::CallContext::currentCallers());
}

PathMotion::Leg Mover::line(const Path& path, double speed) const {
    return {path, Profile(path.length(), std::min(speed, path.fastest(acceleration_)), acceleration_), 0};
}

std::vector<Guard> Mover::guards(const Now& now) {
    Pino& p = pino();
    auto all = p.guards(*this, guards_, author("-guards"));
    auto general = p.guards(p, p.ownGuards(), p.author("-guards"));
    all.insert(all.end(), general.begin(), general.end());
    for (auto& g : all)
        if (g.feels() && !now.sensed) fail(kSensor, name(), "guard " + g.name + " needs it");
    return all;
}

void Mover::verify(const Now& now, PathMotion& trial, const std::vector<Guard>& guards) const {
    Senses senses;
    senses.period = now.period;
    const auto& limits = now.settings.limits;
    Joints q = now.q, qdot = Joints::Zero();
    Vector3d before = now.tool.p;
    for (bool over = false; !over;) {
        Joints next = q;
        const auto step = trial.next(senses, next);
        const double part = trial.part();
        switch (step) {
            case Motion::Step::unreachable: failReach(name(), now.settings.frames, trial.here().tool, part);
            case Motion::Step::limits: failLimits(name(), trial.solutions(), limits.angles, part);
            case Motion::Step::singular: {
                auto& s = trial.solutions();
                fail(kSingular, name(), text(trial.here().tool.p), percent(part),
                     singularities(s.near[std::size_t(s.order[0])]));
            }
            case Motion::Step::done: over = true; break;
            case Motion::Step::going: break;
        }
        const Joints rate = (next - q) / now.period;
        for (int i = 0; i < 6; ++i) {
            auto within = [&](const char* what, double value, double low, double high) {
                if (value >= low && value <= high) return;
                fail(kSpeed, name(), i + 1, what, number(value), percent(part), allowed({"", 0, low, high}));
            };
            within("an angle [rad] of", next[i], limits.angles.lower[i] - 1e-9, limits.angles.upper[i] + 1e-9);
            within("a speed [rad/s] of", std::fabs(rate[i]), 0, limits.speed[i]);
            if (!over) within("an acceleration [rad/s2] of", std::fabs(rate[i] - qdot[i]) / now.period, 0,
                              1.5 * limits.acceleration[i]);
        }
        q = next, qdot = rate;
        GuardInput view;
        view.tool = now.settings.frames.toolOf(q);
        view.ahead = view.tool.p;
        view.speed = (view.tool.p - before).norm() / now.period;
        view.singular = puma::distances(q);
        before = view.tool.p;
        Trip trip;
        for (auto& g : guards)
            if (!g.check(view, trip))
                fail(kWouldTrip, name(), g.name, percent(part), trip.what, number(trip.value), allowed(trip));
    }
}

void Mover::launch(sorma::Message& m, std::function<Job::Plan(const Now&)> plan,
                   std::function<void(sorma::Message&, const Now&, Motion&)> finish) {
    Pino& p = pino();
    p.admit(whenBusy_ == "queue", name());
    auto job = std::make_shared<Job>();
    job->who = name();
    // The object stays as long as its job is known.
    job->plan = [self = sorma::Reference(this), plan = std::move(plan)](const Now& n) { return plan(n); };
    job->finish = std::move(finish);
    job->progress = [this](double part) {
        sorma::Message told;
        told.floats = {part};
        publish("progress", told);
    };
    p.submit(std::move(job), [&] { return later(m); });
}

}  // namespace robot
