// track.h -- the classes track and trajectory.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <sorma.h>

#include "bus/incident.h"

#include "abg.h"
#include "course.h"

namespace track {

inline constexpr std::array kTaken{"used", "begun", "late", "refused"};       // as Taken numbers them

class Track final : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe();
    void born() override;
    void changed(std::span<const sorma::Option* const>) override;
    sorma::Commit prepare(const sorma::Change& change) override;
    void exec(sorma::Message& m) override;
    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override;
    void dumpState(std::string& out) const override;
    void tellIncidents(sorma::Incidents& out) const override;

private:
    Settings settings() const;                  // as the options say
    void need(const sorma::Message& m, const char* task, std::size_t count, const char* what) const;
    void measure(sorma::Message& m);
    void wait(sorma::Message& m, const sorma::Tick* tick);
    void watch(const sorma::Tick* tick);
    void predict(sorma::Message& m) const;
    void tellGains(sorma::Message& m) const;
    void start(sorma::Message& m);
    void forget(sorma::Args, sorma::Message&);
    void answer(sorma::Message& m, double time) const;
    void tell(std::string& out) const;

    double index_ = 1, interval_ = 0.07, longest_ = 1, gate_ = 0, instant_ = 0, calmSpeed_ = 0, calmAcceleration_ = 0,
           trust_ = 0.1, fade_ = 0, expiry_ = 0.5, decay_ = 0.2;
    std::int64_t axes_ = 3, confirm_ = 2;
    bool predict_ = false;
    Settings settings_;
    Filter filter_;
    std::vector<Filter::Axis> room_;
    std::array<sorma::Tally, kTaken.size()> counts_;
    sorma::Tally lost_;                         // times that nothing was measured for longer than -expiry
    bool missing_ = false;                      // since the last measurement
};

class Trajectory final : public sorma::Service {
public:
    static sorma::Class describe();
    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;
    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override;
    void dumpState(std::string& out) const override;

private:
    void forget(sorma::Args, sorma::Message&) { begun_ = false; }
    double period() const;

    double speed_ = 0.5, acceleration_ = 2, turnSpeed_ = 1, turnAcceleration_ = 4, brake_ = 8.0 / 9, soft_ = 4, stiff_ = 25, near_ = 0.010;
    double turnNear_ = 0.05, period_ = 0, floor_ = -100, touch_ = 0.02;
    Limits limits_, turnLimits_;
    Course course_;
    RotationCourse turn_;
    bool begun_ = false;
};

}  // namespace track
