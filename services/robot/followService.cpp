// follow -- the arm follows a target that another object computes in each tick.
//
//     follow.ball EXEC            until CTRL -stop
#include <algorithm>
#include <array>
#include <cmath>

#include "errors.h"
#include "follow.h"

namespace robot {

using sorma::Message;

namespace {

constexpr std::int64_t kLook = 50'000'000;  // [ns] between two looks for the target's buffer

}  // namespace

FollowMotion::FollowMotion(const Frames& frames, const ArmLimits& limits, const ToolPose& from, const Manner& given, Feed& feed)
    : manner(given), frames_(frames), limits_(limits), feed_(feed) {
    course_.position = from.p;
    turn_.orientation = from.r;
}

Motion::Step FollowMotion::next(const Senses& senses, Joints& q) noexcept {
    const double period = senses.period;
    std::array<double, kTarget> f;
    if (!braking_) brake_ = std::max(before_, manner.line.acceleration), before_ = manner.line.acceleration;
    const Target target = braking_ ? Target::none : read(period, f);
    if (!braking_) note(target);
    if (target == Target::right) {
        course_.step(period, Eigen::Map<Vector3d>(&f[0]), Eigen::Map<Vector3d>(&f[7]), manner.line, Eigen::Map<Vector3d>(&f[10]));
        turn_.step(period, Quaterniond(f[3], f[4], f[5], f[6]).normalized(), manner.turn);
    } else {
        // Its own place as a target at rest: it slows down as hard as it may.
        track::Limits limits = manner.line;
        if (braking_) limits.acceleration = std::max(brake_, limits.acceleration);
        course_.step(period, course_.position, Vector3d::Zero(), limits);
        turn_.step(period, turn_.orientation, manner.turn);
    }
    switch (posture_.find(frames_, limits_, {course_.position, turn_.orientation}, q, q)) {
        case Posture::unreachable: return Step::unreachable;
        case Posture::limits: return Step::limits;
        case Posture::singular: return Step::singular;
        case Posture::none: break;
    }
    return braking_ && course_.velocity.norm() < 1e-9 && turn_.velocity.norm() < 1e-9 ? Step::done : Step::going;
}

FollowMotion::Target FollowMotion::read(double period, std::array<double, kTarget>& f) noexcept {
    auto* reader = feed_.target.reader();
    shmem::Stamp stamp;
    if (!reader) return Target::none;
    const auto outcome = reader->latest(f.data(), nullptr, stamp);
    if (outcome == shmem::Outcome::damaged) return Target::wrong;
    if (outcome != shmem::Outcome::read || old(stamp, period)) return Target::none;
    const bool finite = std::all_of(f.begin(), f.end(), [](double x) { return std::fabs(x) < 1e6; });
    if (finite && std::fabs(Quaterniond(f[3], f[4], f[5], f[6]).norm() - 1) < 1e-3) return Target::right;
    return Target::wrong;
}

void FollowMotion::note(Target now) noexcept {
    feed_.followed += now == Target::right;
    feed_.waited += now != Target::right;
    feed_.wrong += now == Target::wrong;
    if (now != last_) feed_.lost += now == Target::none, feed_.damaged += now == Target::wrong;
    last_ = now;
}

// By ticks: lab time may stand still, and nothing grows old then. The first record may have any age.
bool FollowMotion::old(const shmem::Stamp& stamp, double period) noexcept {
    if (stamp.counter == counter_) age_ += period;
    else age_ = counter_ == 0 ? double(shmem::nanoseconds() - stamp.monotonic) * 1e-9 : 0;
    counter_ = stamp.counter;
    return age_ > std::max(manner.patience, 3 * period);
}

sorma::Class Follow::describe() {
    using enum sorma::Field;
    auto c = sorma::Class::of<Follow>("follow", "follows a target that another object computes in each tick");
    Mover::describe<Follow>(c);
    c.named("-target", &Follow::target_, {.help = "key of the buffer with the target: position, quaternion, velocity, a velocity that is added", .fixed = true})
        .real("-turnAcceleration", &Follow::turnAcceleration_, {.unit = "rad/s2", .low = 0.01, .high = 50, .help = "of turns of the tool"})
        .real("-soft", &Follow::soft_, {.unit = "1/s", .low = 0, .high = 1000, .help = "at the target: speed by distance; 0: stop as fast as it can be done"})
        .real("-stiff", &Follow::stiff_, {.unit = "1/s", .low = 0, .high = 1000, .help = "the same, -near from it; it rises in between"})
        .real("-near", &Follow::near_, {.unit = "m", .low = 1e-6, .high = 1, .help = "distance for -stiff"})
        .real("-floor", &Follow::floor_, {.unit = "m", .low = -10, .high = 10, .help = "height of the tool below which it may touch the table: it goes down with -touchSpeed at most, and slows down before"})
        .real("-touchSpeed", &Follow::touch_, {.unit = "m/s", .low = 0.001, .high = 2, .help = "downwards, below -floor"})
        .real("-patience", &Follow::patience_, {.unit = "s", .low = 0.001, .high = 10, .help = "a target that is older by the control task's clock is not used: the tool comes to rest, and waits"})
        .reads(floats, sorma::exactly(0), "", "nothing")
        .example("follow CTRL -speed 0.5 -acceleration 2");
    return c;
}

FollowMotion::Manner Follow::manner() const {
    constexpr double kBrake = 8.0 / 9;
    return {{speed_, acceleration_, kBrake, soft_, stiff_, near_, floor_, touch_},
            {turnSpeed_, turnAcceleration_, kBrake, soft_, stiff_, 0.05}, patience_};
}

FollowMotion* Follow::motion() const {
    auto* p = dynamic_cast<Pino*>(arm_ ? arm_.get() : sorm().find("pino"));
    return p && p->moves(name()) ? motion_ : nullptr;
}

// Everything but -target may change while it moves.
void Follow::changed(std::span<const sorma::Option* const>) {
    if (auto* m = motion()) {
        sorma::BetweenTicks between(pino());
        m->manner = manner();
    }
}

void Follow::exec(Message& m) {
    m.clear();
    launch(m, [this](const Now& now) {
               auto next = std::make_unique<FollowMotion>(now.settings.frames, now.settings.limits, now.tool, manner(), feed_);
               motion_ = next.get();
               motion_->use(feed_.target.look(target_.use(*this)));
               timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
               return Job::Plan{std::move(next), guards(now)};
           },
           [](Message&, const Now&, Motion&) {});
}

// The target's writer may come late, and may be replaced.
void Follow::watch() {
    auto* m = motion();
    if (!m) return;
    timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    if (feed_.target.attached()) return;
    auto found = feed_.target.look(target_.use(*this));
    sorma::BetweenTicks between(pino());
    m->use(std::move(found));
}

void Follow::tellIncidents(sorma::Incidents& out) const {
    out.push_back({name(), "no target any more", feed_.lost});
    out.push_back({name(), "wrong target", feed_.damaged});
    feed_.target.tellIncidents(name(), target_.get(sorma::Permit::owner()), out);
}

void Follow::dumpState(std::string& out) const {
    out += "# followed " + std::to_string(feed_.followed) + "\n# waited " + std::to_string(feed_.waited) + "\n# wrong " +
           std::to_string(feed_.wrong) + "\n";
    if (const auto why = feed_.target.missing(); !why.empty()) out += "# missing " + why + "\n";
}

}  // namespace robot
