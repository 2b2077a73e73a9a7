// sighting -- where something that a camera of the tool has seen is in the world: a unit for circuits.
//
//     sighting.ball.t -> track.ball.t
//     sighting.ball.z -> track.ball.z
#include <algorithm>
#include <cmath>
#include <limits>

#include "sighting.h"

namespace robot {

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kFloats{Severity::error, "SIGHTING FLOATS", 1, "{}: EXEC expects no floats, got {}"};
const sorma::Prototype kInside{Severity::error, "OPTION VALUE", 2, "{}: {} must be empty, or least and largest x, y, z; {} is above {}"};

constexpr std::int64_t kLook = 50'000'000;  // [ns] between two looks for buffers
constexpr double kSame = 0.2;               // [s] clocks that differ by less are the same one
constexpr double kFuture = 0.05;            // [s] so far ahead a time may be: the newest pose is of the last tick

}  // namespace

sorma::Class Sighting::describe() {
    using enum sorma::Field;
    return sorma::Class::of<Sighting>("sighting", "where something that a camera of the tool has seen is in the world")
        .named("-seen", &Sighting::seenKey_, {.help = "key of the buffer that says what was seen: time, x y z in the tool frame, residual, code (0: valid)"})
        .named("-poses", &Sighting::posesKey_, {.help = "key of the buffer of the tool's poses: time, position, quaternion"})
        .real("-longest", &Sighting::longest_, {.unit = "s", .low = 0.01, .high = 10, .help = "an older measurement is not used"})
        .real("-residual", &Sighting::residual_, {.low = 0, .help = "a measurement with a larger residual is not used"})
        .vector("-inside", &Sighting::inside_, {.unit = "m", .low = -10, .high = 10, .help = "measurements outside are not used: least and "
                                                "largest x, y, z in the tool frame; empty: anywhere", .maxLength = 6})
        .action("-reset", &Sighting::forget, "", "begin to count again")
        .inspection({"-state", "", "how many were used, and how many were not, by reason", 0, 0,
                     [](sorma::Service& s, sorma::Args, Message& m) { static_cast<Sighting&>(s).tell(m.text, ""); }})
        .reads(floats, sorma::exactly(0), "", "nothing")
        .writes(floats, sorma::exactly(4), "", "time [s], position in the world [m]; nan when there is nothing new")
        .concurrency(sorma::Concurrency::concurrent)
        .realtime()
        .example("sighting CTRL -longest 0.3");
}

void Sighting::born() {
    changed({});
    watch();
}

void Sighting::changed(std::span<const sorma::Option* const> options) {
    if (!inside_.empty() && inside_.size() != 6) fail(kInside, name(), "-inside", "its length " + sorma::numberText(double(inside_.size())), "or below 6");
    for (std::size_t i = 0; i + 1 < inside_.size(); i += 2)
        if (inside_[i] > inside_[i + 1]) fail(kInside, name(), "-inside", sorma::numberText(inside_[i]), sorma::numberText(inside_[i + 1]));
    for (auto* o : options) {
        if (o->name == "-seen") seen_.use({}), counter_ = 0;
        if (o->name == "-poses") poses_.use({});
    }
}

// Buffers come and go; no tick can look for them.
void Sighting::watch() {
    if (sorm().hasLoop()) timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    auto attach = [&](BufferInput& tap, const Key& key, auto begin) {
        if (tap.attached()) return;
        auto found = tap.look(key.use(*this));
        sorma::BetweenTicks between(*this);
        tap.use(std::move(found));
        begin();
    };
    attach(poses_, posesKey_, [] {});
    // Records that are older than this object are not used.
    attach(seen_, seenKey_, [this] { counter_ = seen_.attached() ? seen_.reader()->count() : 0; });
}

void Sighting::exec(Message& m) {
    if (!m.floats.empty()) [[unlikely]] fail(kFloats, name(), m.floats.size());
    if (!sorma::Tick::current()) watch();
    std::array<double, 4> out;
    out.fill(std::numeric_limits<double>::quiet_NaN());
    if (double time; now(time) && seen_.attached() && seen_.reader()->count() != counter_) {
        std::array<double, 4> found;
        const Fate fate = look(time, found);
        ++fates_[fate];
        if (fate == used) out = found, out[0] += offset_;
    }
    m.floats.assign(out.begin(), out.end());
}

bool Sighting::now(double& time) noexcept {
    auto* reader = poses_.reader();
    if (!reader) return false;
    std::array<double, kPoseMost> f;
    shmem::Stamp stamp;
    if (reader->latest(f.data(), nullptr, stamp) != shmem::Outcome::read || !std::isfinite(f[0])) return false;
    time = f[0];
    if (auto* tick = sorma::Tick::current()) {
        const double difference = double(tick->time) * 1e-9 - time;
        if (std::fabs(difference) < kSame) offset_ = 0;
        else offset_ += std::fabs(difference - offset_) > 0.05 ? difference - offset_ : 0.01 * (difference - offset_);
    }
    return true;
}

Sighting::Fate Sighting::look(double now, std::array<double, 4>& out) noexcept {
    const auto& reader = *seen_.reader();
    std::array<double, kSeen> f;
    shmem::Stamp stamp;
    const auto outcome = reader.latest(f.data(), nullptr, stamp);
    if (outcome == shmem::Outcome::damaged) return counter_ = stamp.counter, damaged;
    if (outcome != shmem::Outcome::read) return lost;
    if (stamp.counter > counter_ + 1) fates_[lost] += stamp.counter - counter_ - 1;
    counter_ = stamp.counter;
    if (f[5] != 0) return refused;
    if (!std::all_of(f.begin(), f.end(), [](double x) { return std::isfinite(x); })) return damaged;
    if (f[0] > now + kFuture) return future;
    if (f[0] < now - longest_) return old;
    if (f[0] <= last_ && last_ <= now + kFuture) return late;
    if (f[4] > residual_) return outside;
    for (std::size_t i = 0; i + 1 < inside_.size(); i += 2)
        if (!(f[1 + i / 2] >= inside_[i] && f[1 + i / 2] <= inside_[i + 1])) return outside;
    ToolPose tool;
    if (!poseAt(f[0], tool)) return unknown;
    const Vector3d z = tool.p + tool.r * Vector3d(f[1], f[2], f[3]);
    last_ = f[0];
    out = {f[0], z.x(), z.y(), z.z()};
    return used;
}

// Between the two records around it; what is younger than the newest one is taken for that.
bool Sighting::poseAt(double time, ToolPose& place) const noexcept {
    auto* reader = poses_.reader();
    if (!reader) return false;
    std::array<double, kPoseMost> f;
    shmem::Stamp stamp;
    ToolPose later;
    double laterTime = 0;
    bool any = false;
    for (std::uint64_t n = reader->count(), oldest = reader->oldest(n); n >= oldest && n > 0; --n) {
        if (!reader->read(n, f.data(), nullptr, stamp)) return false;
        for (std::size_t i = 0; i < kPose; ++i)
            if (!std::isfinite(f[i])) return false;
        const ToolPose at{{f[1], f[2], f[3]}, Quaterniond(f[4], f[5], f[6], f[7]).normalized()};
        if (f[0] <= time) {
            const double part = any && laterTime > f[0] ? (time - f[0]) / (laterTime - f[0]) : 0;
            place = any ? ToolPose{at.p + part * (later.p - at.p), at.r.slerp(part, later.r)} : at;
            return true;
        }
        later = at, laterTime = f[0], any = true;
    }
    return false;
}

void Sighting::forget(sorma::Args, Message&) {
    for (auto& fate : fates_) fate.clear();
    last_ = -sorma::kInfinity;
}

void Sighting::tellIncidents(sorma::Incidents& out) const {
    for (std::size_t i = used + 1; i < std::size(kFates); ++i) out.push_back({name(), std::string("measurement ") + kFates[i], fates_[i]});
    seen_.tellIncidents(name(), seenKey_.get(sorma::Permit::owner()), out);
    poses_.tellIncidents(name(), posesKey_.get(sorma::Permit::owner()), out);
}

std::vector<sorma::Pin> Sighting::pins(std::string_view, std::size_t) const {
    return {{"t", false, 0, 1, "s", "when it was seen; nan: nothing new"}, {"z", false, 1, 3, "m", "where it was then, in the world"}};
}

void Sighting::tell(std::string& out, const std::string& before) const {
    for (std::size_t i = 0; i < std::size(kFates); ++i) out += before + kFates[i] + " " + std::to_string(fates_[i]) + "\n";
    for (auto* tap : {&seen_, &poses_})
        if (const auto why = tap->missing(); !why.empty()) out += before + "missing " + why + "\n";
}

}  // namespace robot
