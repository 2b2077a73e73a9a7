// mvpos -- moves the arm to positions: absolute, named, relative, or displaced by increments from a buffer.
//
//     mvpos EXEC FMSG 6 q...                       joint angles
//     mvpos CTRL -as pose -move line
//     mvpos EXEC FMSG 7 x y z  w x y z             position and quaternion of the tool, on a straight line
//     mvpos CTRL -teach home;   mvpos.home EXEC
#include "mvpos.h"

#include <cmath>

namespace robot {

using sorma::Args;
using sorma::Message;

sorma::Class Mvpos::describe() {
    using enum sorma::Field;
    auto c = sorma::Class::of<Mvpos>("mvpos", "moves the arm to a position");
    Mover::describe<Mvpos>(c);
    c.choice("-as", &Mvpos::as_, {"joints", "pose", "matrix"}, {.help = "what a position is: 6 joint angles [rad]; "
                                                                "position [m] and quaternion w x y z of the tool; "
                                                                        "three rows of its 4x4 matrix"})
        .choice("-move", &Mvpos::move_, {"joints", "line"}, {.help = "what is interpolated: joint angles, or the tool on a "
                                                                     "straight line"})
        .text("-relativeTo", &Mvpos::relativeTo_, {.help = "frame of the position: world; tool, as it is at the begin; or "
                                                           "a taught name"})
        .vector("-target", &Mvpos::target_, {.help = "position of an EXEC without floats, as -as says it; empty: none"})
        .real("-jointSpeed", &Mvpos::jointSpeed_, {.unit = "rad/s", .low = 0.001, .high = 5,
                                                   .help = "of the fastest joint, with -move joints"})
        .real("-jointAcceleration", &Mvpos::jointAcceleration_, {.unit = "rad/s2", .low = 0.01, .high = 20,
                                                                 .help = "of the fastest joint, with -move joints"})
        .real("-blend", &Mvpos::blend_, {.unit = "m or rad", .low = 0, .high = 1,
                                         .help = "how far from the positions of EXEC via their corners may be cut; 0: the "
                                                 "arm rests there"})
        .named("-increments", &Mvpos::increments_, {.help = "key of a snapshot buffer: floats 1 .. 6 of each record "
                                                           "displace the tool, x y z [m] and rotation "
                                                           "vector [rad], world axes; with -move line"})
        .flag("-dry", &Mvpos::dry_, {.help = "check everything, say what would happen, move nothing"})
        .action("-teach", &Mvpos::teach, "name", "keep where the arm is as the recipe of mvpos.NAME", 1, 1)
        .words("?follow | via?")
        .reads(floats, {}, "m, rad", "a position: 6, 7 or 12 floats by -as, none for -target; via: several of them")
        .writes(floats, sorma::between(0, 13), "", "where it has been sent: position [m] (3) and quaternion (4) of the "
                                                   "tool, joint angles [rad] (6)")
        .writes(text, {}, "", "with -dry: what would happen; the code is 1 when it would be refused")
        .example("mvpos CTRL -move line -speed 0.1");
    return c;
}

void Mvpos::born() { changed({}); }

void Mvpos::changed(std::span<const sorma::Option* const>) {
    if (!target_.empty() && target_.size() != width())
        fail(kOrder, name(), "-target", "-as " + as_ + " needs " + std::to_string(width()) + " numbers, not " +
             std::to_string(target_.size()));
}

std::size_t Mvpos::width() const { return as_ == "joints" ? 6 : as_ == "pose" ? 7 : 12; }

void Mvpos::exec(Message& m) {
    const std::string word = m.words.empty() ? "" : m.words[0];
    if (m.words.size() > 1 || (word != "" && word != "follow" && word != "via"))
        fail(kWord, name(), m.words.back(), "follow or via");
    std::vector<double> given = m.floats;
    for (std::size_t i = 0; i < given.size(); ++i)
        if (!std::isfinite(given[i])) fail(kValue, name(), i + 1, number(given[i]));
    const bool follows = word == "follow";
    if (follows && (increments_.empty() || !given.empty()))
        fail(kTarget, name(), increments_.empty() ? "EXEC follow needs -increments" : "EXEC follow takes no floats");
    if (!increments_.empty() && move_ != "line") fail(kTarget, name(), "-increments needs -move line");
    if (given.empty() && !follows) given = target_;
    const std::size_t n = width();
    if (!follows && (given.empty() || (word == "via" ? given.size() % n != 0 : given.size() != n)))
        fail(kTarget, name(), "-as " + as_ + " needs " + std::to_string(n) + " floats" +
                                  (word == "via" ? " for each position" : "") + ", got " + std::to_string(given.size()) +
                                  (given.empty() ? ", and there is no -target" : ""));
    if (dry_) return tellDry(m, given);
    launch(m, [this, given, follows](const Now& now) { return plan(now, given, follows); },
           [](Message& reply, const Now& now, Motion&) {
               append(reply.floats, now.tool);
               reply.floats.insert(reply.floats.end(), now.q.data(), now.q.data() + 6);
           });
}

void Mvpos::tellDry(Message& m, const std::vector<double>& given) {
    const Now now = pino().now();
    m.clear();
    try {
        auto all = guards(now);
        PathMotion trial(now.settings.frames, now.settings.limits, legs(now, given));
        m.text = "it would take " + number(trial.duration()) + " s; nothing has moved";
        verify(now, trial, all);
    } catch (const sorma::Error& e) {
        m.text = e.what();
        m.code = 1;
    }
}

Job::Plan Mvpos::plan(const Now& now, const std::vector<double>& given, bool follows) {
    auto all = guards(now);
    auto way = legs(now, given);
    PathMotion trial(now.settings.frames, now.settings.limits, way);
    verify(now, trial, all);
    auto motion = std::make_unique<PathMotion>(now.settings.frames, now.settings.limits, std::move(way));
    if (!increments_.empty()) {
        std::unique_ptr<Increments> increments;
        try {
            increments = std::make_unique<Increments>(increments_.use(*this), speed_, acceleration_, speed_ / turnSpeed_);
        } catch (const shmem::Failure& f) {
            fail(kIncrements, name(), f.what());
        }
        if (increments->shape().floats != Increments::kFloats)
            fail(kIncrements, name(), "records of snapshot buffer " + increments_.get(sorma::Permit::owner()) + " have " +
                 std::to_string(increments->shape().floats) +
                                          " floats instead of " + std::to_string(Increments::kFloats));
        motion->follow(std::move(increments), follows, acceleration_);
    }
    return {std::move(motion), std::move(all)};
}

std::vector<PathMotion::Leg> Mvpos::legs(const Now& now, const std::vector<double>& given) {
    const bool line = move_ == "line";
    auto begun = [&](const Knot& from) {
        return line ? Path(Path::Kind::line, from, speed_ / turnSpeed_) : Path(Path::Kind::joints, from, 1);
    };
    auto ready = [&](const Path& path) {
        if (line) return this->line(path, speed_);
        return PathMotion::Leg{path, Profile(path.length(), std::min(jointSpeed_, path.fastest(jointAcceleration_)),
                                             jointAcceleration_), 0};
    };
    std::vector<PathMotion::Leg> out;
    Knot at{now.q, now.tool};
    Path path = begun(at);
    for (std::size_t i = 0; i < given.size(); i += width()) {
        const Knot next = knot(&given[i], now, at);
        path.add(next, blend_);
        at = next;
        if (blend_ > 0 || i + width() >= given.size()) continue;
        out.push_back(ready(path));
        path = begun(at);
    }
    out.push_back(ready(path));
    return out;
}

// A position as -as and -relativeTo say it. after: the one before it on the way.
Knot Mvpos::knot(const double* f, const Now& now, const Knot& after) {
    Knot frame{Joints::Zero(), {}};
    if (relativeTo_ == "tool") frame = {now.q, now.tool};
    else if (relativeTo_ != "world") frame = taught(relativeTo_, now);
    Knot out;
    if (as_ == "joints") {
        out.q = frame.q + Joints(Eigen::Map<const Joints>(f));
        out.tool = now.settings.frames.toolOf(out.q);
        return out;
    }
    ToolPose local;
    if (as_ == "pose") {
        local = {{f[0], f[1], f[2]}, {f[3], f[4], f[5], f[6]}};
        if (const double length = local.r.norm(); std::fabs(length - 1) > 1e-3)
            fail(kTarget, name(), "the quaternion, floats 4 to 7, has length " + number(length) + " instead of 1");
        local.r.normalize();
    } else {
        const puma::Pose t = Eigen::Map<const puma::Pose>(f);
        if (!puma::isPose(t)) fail(kTarget, name(), "the left 3x3 of the matrix is not a rotation: its columns must have "
                                                    "length 1 and right angles");
        const Eigen::Matrix3d r = t.leftCols<3>();
        local = {t.col(3), Quaterniond(r)};
    }
    out.tool = frame.tool * local;
    out.q = after.q;
    Posture posture;
    switch (posture.find(now.settings.frames, now.settings.limits, out.tool, after.q, out.q)) {
        case Posture::unreachable: failReach(name(), now.settings.frames, out.tool, 1);
        case Posture::limits: failLimits(name(), posture.solutions, now.settings.limits.angles, 1);
        case Posture::singular:
        case Posture::none: break;
    }
    return out;
}

Knot Mvpos::taught(const std::string& who, const Now& now) {
    const auto object = sorm().get("mvpos." + who, author("-relativeTo"));
    auto* other = dynamic_cast<Mvpos*>(object.get());
    if (!other || other->target_.empty() || other->relativeTo_ != "world")
        fail(kName, name(), "-relativeTo " + who + ": mvpos." + who + " has no -target in the world; CTRL -teach " +
                                  who + " keeps one");
    return other->knot(other->target_.data(), now, {now.q, now.tool});
}

void Mvpos::teach(Args args, Message& m) {
    const Now now = pino().now();
    std::string angles;
    for (double q : now.q) {
        char buffer[32];
        std::snprintf(buffer, sizeof buffer, "%.6f", q);
        angles += (angles.empty() ? "" : " ") + std::string(buffer);
    }
    const std::vector<std::string> recipe{"-as", "joints", "-relativeTo", "world", "-target", angles};
    const std::string taughtName = "mvpos." + args[0];
    Message add;
    add.words = {"-add", taughtName};
    add.words.insert(add.words.end(), recipe.begin(), recipe.end());
    add.author = m.author;
    sorm().call("dict", sorma::Method::ctrl, add);
    if (auto* there = sorm().find(taughtName)) {    // one that has been made already
        Message change;
        change.words = recipe;
        change.author = m.author;
        there->invoke(sorma::Method::ctrl, change);
    }
    m.text += taughtName + " " + angles;
}

}  // namespace robot
