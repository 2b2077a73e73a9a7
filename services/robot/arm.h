// arm.h -- the arm's buffers. Their other side is a real arm's controller, a simulation, or a recording (doc/hardware.man).
//
// Threads:   the SORM's thread calls look, and between ticks attach and publish; the ticks call read, write and record.
// Allocates: look, attach and publish only.
#pragma once

#include <array>
#include <optional>
#include <string>

#include <shmem/ring.h>

#include "place.h"

namespace robot {

enum class Mode { off, hold, run, stop };
// Why the other side has cut the power, as it reports.
enum class Cause { none, emergencyStop, table, wrist, late, limit };
inline constexpr std::size_t kCauses = std::size_t(Cause::limit) + 1;
const char* toText(Cause cause);

struct ArmState {
    double time = 0;                        // [s] lab time
    Joints q = Joints::Zero(), qdot = Joints::Zero();
    bool power = false;
    Cause cause = Cause::none;
    std::uint64_t inUse = 0;                // the other side's set-point: its number
};

class Arm {
public:
    static constexpr std::size_t kSetFloats = 14, kStateFloats = 22, kWristFloats = 7, kPoseFloats = 14, kForceFloats = 7;

    explicit Arm(std::string prefix) : prefix_(std::move(prefix)) {}

    // Become the writer of arm.set, and with records of tool.pose and tool.force. Fails with shmem::Failure.
    void publish(const std::string& program, bool records);
    // Readers of the other side's buffers, as far as these exist; problem() says what is wrong with the others.
    struct Readers {
        std::optional<shmem::Reader> state, wrist;
        std::string problem;
    };
    Readers look() const;                   // any time
    void attach(Readers readers);
    bool attached() const { return readers_.state && !readers_.state->retired(); }
    bool alive() const { return attached() && readers_.state->segment()->writing().alive(); }      // its writer's process runs
    const std::string& problem() const { return readers_.problem; }

    // The newest state. False: there is none, or its numbers are not finite.   age: [s] since it was written.
    bool read(ArmState& state, double& age) noexcept;
    // Lab time less the machine's monotonic time [s], as of the state that was read last.
    double clockOffset() const { return clockOffset_; }
    // Mean of the wrist's sensor since the last call. False: no record for longer than `silence` [s], or numbers not finite.
    bool readWrist(Wrench& raw, double silence) noexcept;

    void write(double time, const Joints& q, const Joints& qdot, Mode mode) noexcept;
    std::uint64_t written() const { return set_->count(); }     // number of the last set-point
    void record(double time, const ToolPose& tool, const Joints& q, const Wrench& felt) noexcept;

private:
    const std::string prefix_;
    Readers readers_;
    std::optional<shmem::Writer> set_, pose_, force_;
    double clockOffset_ = 0;
    std::uint64_t wristSeen_ = 0;
    Wrench wrist_ = Wrench::Zero();         // as read last
    std::int64_t wristTime_ = 0;            // [ns] monotonic
};

}  // namespace robot
