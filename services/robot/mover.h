// mover.h -- base of the classes that move the arm: their common options, and motions as requests to the arm.
//
// Threads: the SORM's.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <sorma.h>

#include "errors.h"
#include "motion.h"
#include "pino.h"

namespace robot {

// The arm does not reach a place.   part: of the way
[[noreturn]] void failReach(const std::string& who, const Frames& frames, const ToolPose& place, double part);
// None of the solutions is within the limits: names the joint that is least outside.
[[noreturn]] void failLimits(const std::string& who, const puma::Solutions& s, const puma::Limits& limits, double part);

class Mover : public sorma::Service {
public:
    void removing() override;

protected:
    template <class S> static void describe(sorma::Class& c) {
        c.service("-arm", &S::arm_, {.help = "the arm, of class pino; empty: pino"})
            .text("-guards", &S::guards_, {.help = "names of guards (class wspc) that hold while it moves, besides those "
                                                   "of the arm"})
            .choice("-whenBusy", &S::whenBusy_, {"refuse", "queue"},
                    {.help = "when another object moves the arm: fail, or wait for the turn"})
            .real("-speed", &S::speed_, {.unit = "m/s", .low = 0.001, .high = 1.5, .help = "of the tool on straight lines"})
            .real("-acceleration", &S::acceleration_, {.unit = "m/s2", .low = 0.01, .high = 5,
                                                       .help = "of the tool on straight lines; also how it brakes"})
            .real("-turnSpeed", &S::turnSpeed_, {.unit = "rad/s", .low = 0.01, .high = 5,
                                                 .help = "of turns of the tool on straight lines"})
            .action({"-stop", "", "stop its motion: the next tick of the control task begins to brake", 0, 0,
                     [](Service& s, sorma::Args, sorma::Message& m) { static_cast<S&>(s).stopNow(m); }, sorma::Right::call,
                         true})
            .danger(sorma::Danger::stop)
            .execDanger(sorma::Danger::move)
            .concurrency(sorma::Concurrency::concurrent);
    }

    Pino& pino();                           // fails with OPTION VALUE when -arm is none
    void stopNow(sorma::Message& m);
    // A line of the tool, or several of them with the corner's rounding, from rest to rest.
    PathMotion::Leg line(const Path& path, double speed) const;
    Path lineFrom(const Now& now) const { return Path(Path::Kind::line, {now.q, now.tool}, speed_ / turnSpeed_); }

    // Simulate a motion as the control task would execute it. Fails with ROBOT UNREACHABLE, LIMITS, SINGULAR, GUARD.
    void verify(const Now& now, PathMotion& trial, const std::vector<Guard>& guards) const;
    // The guards for the next motion. Fails with ROBOT SENSOR when one needs a sensor that gives no data.
    std::vector<Guard> guards(const Now& now);
    // Submit a motion to the arm; m is answered when it has ended. plan is called when its turn has come, finish when it has
    // succeeded.
    void launch(sorma::Message& m, std::function<Job::Plan(const Now&)> plan, std::function<void(sorma::Message&, const Now&,
        Motion&)> finish);

    sorma::Reference arm_;
    std::string guards_, whenBusy_ = "refuse";
    double speed_ = 0.25, acceleration_ = 0.5, turnSpeed_ = 0.8;
};

}  // namespace robot
