#include "arm.h"

#include <algorithm>
#include <cmath>

namespace robot {

namespace {
constexpr double kMostNumber = 1e15;        // of a set-point; a double counts so far
}

const char* toText(Cause cause) {
    switch (cause) {
        case Cause::none: return "none";
        case Cause::emergencyStop: return "emergency stop";
        case Cause::table: return "table force";
        case Cause::wrist: return "wrist force";
        case Cause::late: return "late set-points";
        case Cause::limit: return "a limit";
    }
    return "unknown";
}

void Arm::publish(const std::string& program, bool records) {
    set_.emplace(prefix_ + "arm.set", shmem::Shape{.blocks = 16, .floats = kSetFloats}, program);
    set_->checksums(true);
    if (!records) return;
    pose_.emplace(prefix_ + "tool.pose", shmem::Shape{.blocks = 256, .floats = kPoseFloats}, program);
    force_.emplace(prefix_ + "tool.force", shmem::Shape{.blocks = 256, .floats = kForceFloats}, program);
    pose_->checksums(true);
    force_->checksums(true);
}

Arm::Readers Arm::look() const {
    Readers r;
    auto open = [&](const char* name, std::size_t floats, std::optional<shmem::Reader>& reader) {
        const std::string key = prefix_ + name;
        try {
            reader.emplace(key);
        } catch (const shmem::Failure& f) {
            if (r.problem.empty()) r.problem = f.what();
            return;
        }
        if (reader->shape().floats == floats) return;
        r.problem = "records of snapshot buffer " + key + " have " + std::to_string(reader->shape().floats) +
                    " floats instead of " +
                    std::to_string(floats);
        reader.reset();
    };
    open("arm.state", kStateFloats, r.state);
    if (r.state) open("wrist.state", kWristFloats, r.wrist);
    return r;
}

void Arm::attach(Readers readers) {
    readers_ = std::move(readers);
    wristSeen_ = 0;
}

bool Arm::read(ArmState& state, double& age) noexcept {
    if (!readers_.state) return false;
    std::array<double, kStateFloats> f;
    shmem::Stamp stamp;
    if (readers_.state->latest(f.data(), nullptr, stamp) != shmem::Outcome::read) return false;
    for (std::size_t i = 0; i < 13; ++i)
        if (!std::isfinite(f[i])) return false;
    age = double(shmem::nanoseconds() - stamp.monotonic) * 1e-9;
    state.time = f[0];
    state.q = Eigen::Map<const Joints>(&f[1]);
    state.qdot = Eigen::Map<const Joints>(&f[7]);
    state.power = f[19] != 0;
    state.cause = f[20] >= 0 && f[20] <= 5 ? Cause(int(f[20])) : Cause::limit;
    state.inUse = f[21] > 0 && f[21] < kMostNumber ? std::uint64_t(f[21]) : 0;
    // The writer's times jitter a little: follow them slowly, but a clock that has been set at once.
    const double offset = state.time - double(stamp.monotonic) * 1e-9;
    clockOffset_ += std::fabs(offset - clockOffset_) > 0.05 ? offset - clockOffset_ : 0.01 * (offset - clockOffset_);
    return true;
}

bool Arm::readWrist(Wrench& raw, double silence) noexcept {
    if (!readers_.wrist) return false;
    constexpr std::uint64_t kMost = 32;     // records
    std::array<double, kWristFloats> f;
    shmem::Stamp stamp;
    const std::uint64_t newest = readers_.wrist->count();
    Wrench sum = Wrench::Zero();
    int count = 0;
    for (std::uint64_t n = std::max(wristSeen_, newest > kMost ? newest - kMost : 0) + 1; n <= newest; ++n) {
        if (!readers_.wrist->read(n, f.data(), nullptr, stamp)) continue;
        sum += Eigen::Map<const Wrench>(&f[1]);
        ++count;
        wristTime_ = stamp.monotonic;
    }
    wristSeen_ = newest;
    if (count > 0) wrist_ = sum / count;
    raw = wrist_;
    return raw.allFinite() && double(shmem::nanoseconds() - wristTime_) * 1e-9 < silence;
}

void Arm::write(double time, const Joints& q, const Joints& qdot, Mode mode) noexcept {
    std::array<double, kSetFloats> f{time};
    std::copy_n(q.data(), 6, &f[1]);
    std::copy_n(qdot.data(), 6, &f[7]);
    f[13] = double(mode);
    set_->write(f.data(), nullptr);
}

void Arm::record(double time, const ToolPose& tool, const Joints& q, const Wrench& felt) noexcept {
    if (!pose_) return;
    std::array<double, kPoseFloats> f{time, tool.p.x(), tool.p.y(), tool.p.z(), tool.r.w(), tool.r.x(), tool.r.y(),
                                      tool.r.z()};
    std::copy_n(q.data(), 6, &f[8]);
    pose_->write(f.data(), nullptr);
    std::array<double, kForceFloats> w{time};
    std::copy_n(felt.data(), 6, &w[1]);
    force_->write(w.data(), nullptr);
}

}  // namespace robot
