// pino.h -- the arm as a service object: its control task, its power, and the queue of motions.
//
// The other classes of the robot make motions and submit them (Job). One motion is executed at a time.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sorma.h>

#include "control.h"

namespace robot {

// The state from which a motion is planned.
struct Now {
    ArmState state;
    Joints q;                               // where it has been sent, or where it is while it has no power
    ToolPose tool;                             // the same
    Settings settings;
    double period = 0;                      // [s]
    Wrench felt = Wrench::Zero();
    bool sensed = false;
};

struct Job {
    struct Plan {
        std::unique_ptr<Motion> motion;
        std::vector<Guard> guards;
    };
    std::string who;                        // the object that moves it
    std::function<Plan(const Now&)> plan;   // when its turn has come; throws to refuse
    std::function<void(sorma::Message&, const Now&, Motion&)> finish;      // it is there: fill in the answer; throws to fail
    std::function<void(double)> progress;   // part of the way; null: nobody is told

    // The pino's:
    sorma::Reply reply;
    sorma::KeptCallPointer call;
    std::string caller, stopped;            // who asked; why it was stopped
    Plan present;
};

class Pino final : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe();
    ~Pino() override;

    void born() override;
    void changed(std::span<const sorma::Option* const>) override;
    void removing() override;
    void exec(sorma::Message& m) override;
    void dumpState(std::string& out) const override;
    std::string selftest() override;
    void tellIncidents(sorma::Incidents& out) const override;

    Now now();
    // Fails with ROBOT ... when no motion is possible now.   waits: it may be busy, since the motion would wait for its
    // turn.
    void admit(bool waits, const std::string& who);
    // Execute a motion when its turn comes. An error of the job's plan is thrown at once, or answered later.
    // later: takes the request over.
    void submit(std::shared_ptr<Job> job, const std::function<sorma::Reply()>& later);
    void stopMotion(const std::string& why);    // the present motion: the next tick begins to brake
    bool moves(const std::string& who) const { return job_ && job_->who == who; }
    void guardChanged(const Guard& guard);
    std::vector<Guard> guards(const sorma::Service& user, const std::string& names,
                              const sorma::PrincipalPointer& author) const;
    const std::string& ownGuards() const { return guards_; }

private:
    static std::vector<double> list(const Joints& q) { return {q.data(), q.data() + 6}; }
    void run();
    void start(sorma::Args, sorma::Message& m);
    void end(sorma::Args, sorma::Message& m);
    void stop(sorma::Args, sorma::Message& m);
    void halt();
    void status(sorma::Message& m);
    void power(sorma::Message& m);
    void park(sorma::Message& m);
    void turnOff();
    void needHardware();
    Settings settings() const;
    std::string steps() const;
    void configureCycle(std::vector<std::string> words);
    void watch();
    void ended();
    void answerJob(Job& job, const Ending& ending, const Now& n, Motion& motion);
    void begin(std::shared_ptr<Job> job, Job::Plan plan);
    void nextJob();
    void failAll(const sorma::Error& why);
    void tell(std::string_view event, std::string text, std::vector<double> floats = {});
    sorma::Error errorOf(const Ending& ending, const std::string& who, const Now& n, const std::string& stopped) const;

    // options
    double interval_ = 0.015, handMass_ = 0, forceFilter_ = 0.01, wristForce_ = 60, wristMoment_ = 10, parkSpeed_ = 0.5;
    double silence_ = 0.1;
    bool labTime_ = false, sensors_ = true, compensate_ = true, records_ = true;
    std::int64_t priority_ = 50;
    sorma::Named<sorma::Kind::segment> prefix_;
    std::string tasks_, guards_;
    std::vector<double> lower_ = list(puma::Limits{}.lower), upper_ = list(puma::Limits{}.upper);
    std::vector<double> speed_{1.9, 1.5, 2.4, 5.3, 5, 5.7}, acceleration_{6, 6, 8, 20, 20, 20};
    std::vector<double> base_{0, 0, -0.25}, tool_{0, 0, 0.2}, handCentre_{0, 0, 0}, sensorOffset_ = std::vector<double>(6);
    std::vector<double> park_{0.2713, 1.1164, -3.2675, 0, -0.9905, -2.8703};     // above the table, the tool down

    std::unique_ptr<Control> control_;      // while the control task runs
    sorma::Reference cycle_;
    std::shared_ptr<Job> job_;              // under way
    std::deque<std::shared_ptr<Job>> queue_;
    std::vector<sorma::Reply> waking_, sleeping_;
    sorma::Timer timer_;
};

}  // namespace robot
