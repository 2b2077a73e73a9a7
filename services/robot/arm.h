// arm.h -- the other side of the buffers: a real arm's controller, a simulation, or a recording (doc/hardware.man).
//
// Threads:   attach, look, publish by the SORM's thread, between ticks; read and write by whoever ticks.
// Allocates: in the former alone.
#pragma once

#include <array>
#include <optional>
#include <string>

#include <shmem/ring.h>

#include "place.h"

namespace robot {

enum class Mode { off, hold, run, stop };
// Why the other side has cut the power, as it says it.
enum class Cause { none, emergencyStop, table, wrist, late, limit };
const char* toText(Cause cause);

struct ArmState {
    double time = 0;                        // [s] lab time
    Joints q = Joints::Zero(), qdot = Joints::Zero();
    bool power = false;
    Cause cause = Cause::none;
};

class Arm {
public:
    static constexpr std::size_t kSetFloats = 14, kStateFloats = 22, kWristFloats = 7, kPoseFloats = 14, kForceFloats = 7;

    explicit Arm(std::string prefix) : prefix_(std::move(prefix)) {}

    // Become the writer of arm.set, and with records of tool.pose and tool.force. Fails with shmem::Failure.
    void publish(const std::string& program, bool records);
    // Readers of the other side's buffers, as far as they are there; what is wrong with them is problem().
    struct Readers {
        std::optional<shmem::Reader> state, wrist;
        std::string problem;
    };
    Readers look() const;                   // any time
    void attach(Readers readers);
    bool attached() const { return readers_.state && !readers_.state->retired(); }
    bool alive() const { return attached() && readers_.state->segment()->writing().alive(); }      // its writer's process runs
    const std::string& problem() const { return readers_.problem; }

    // The newest state. False: there is none, or it is no state (not finite).   age: [s] since it was written.
    bool read(ArmState& state, double& age) noexcept;
    // Lab time less the machine's monotonic time [s], as of the state that was read last.
    double clockOffset() const { return clockOffset_; }
    // The mean of what the wrist has felt since it was read last. False: nothing for longer than `silence` [s], or no numbers.
    bool readWrist(Wrench& raw, double silence) noexcept;

    void write(double time, const Joints& q, const Joints& qdot, Mode mode) noexcept;
    void record(double time, const Place& tool, const Joints& q, const Wrench& felt) noexcept;

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
