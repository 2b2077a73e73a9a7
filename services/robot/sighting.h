// sighting.h -- a unit that computes where in the world an object is that a camera on the tool has seen.
//
// A measurement is older than the tick that uses it. So the unit combines it with the pose of the tool at the time of the
// picture, from the records of poses. It checks each measurement. One that cannot be used is counted by its reason, and the
// unit has no output in that tick.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <sorma.h>

#include "bus/incident.h"

#include "place.h"
#include "bufferInput.h"

namespace robot {

class Sighting final : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe();
    void born() override;
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;
    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override;
    void dumpState(std::string& out) const override { tell(out, "# "); }
    void tellIncidents(sorma::Incidents& out) const override;

private:
    // The result for a measurement.
    enum Fate { used, refused, outside, old, future, late, unknown, damaged, lost };
    static constexpr const char* kFates[] = {"used", "refused", "outside", "old", "future", "late", "noPose", "damaged", "lost"};

    void watch();
    void forget(sorma::Args, sorma::Message&);
    bool now(double& time) noexcept;                            // [s] lab time of the newest pose
    Fate look(double now, std::array<double, 4>& out) noexcept; // out: t z
    bool poseAt(double time, ToolPose& place) const noexcept;
    void tell(std::string& out, const std::string& before) const;

    using Key = sorma::Named<sorma::Kind::segment>;
    Key seenKey_ = "target.rel", posesKey_ = "tool.pose";
    double longest_ = 0.5, residual_ = sorma::kInfinity;
    std::vector<double> inside_;

    static constexpr std::size_t kSeen = 6, kPose = 8, kPoseMost = 64;
    BufferInput seen_{kSeen, kSeen}, poses_{kPose, kPoseMost};
    std::uint64_t counter_ = 0;             // of the record that was looked at last
    double last_ = -sorma::kInfinity;       // [s] time of the one that was used last
    double offset_ = 0;                     // [s] the tick's clock less lab time
    std::array<sorma::Tally, std::size(kFates)> fates_;
    sorma::Timer timer_;
};

}  // namespace robot
