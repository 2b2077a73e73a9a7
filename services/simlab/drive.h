// drive.h -- the arm's servos, their power, and automatic stops.
//
// A set-point has the time at which it is to be reached. In between the drive interpolates positions and speeds linearly,
// and goes on at the last speed while the next one is late. The motors carry the arm's weight. They add in advance the
// torque that inertia and friction need on the path. It stops in two ways:
//
//     category 0   power off at once, the brakes engage 20 ms later: emergency stop, table force, wrist force
//     category 1   decelerates along its path, then brakes and cuts the power: no set-point for three periods, one that breaks
//                  a limit, and, without a cause, set-points of mode off or stop
//
// Power comes with a set-point of mode hold or run that follows one of mode off, where the arm is. After a stop that has a
// cause it needs reset() first; so a program that goes on streaming does not move the arm when another one calls reset().
//
// Threads: none of its own; called by the thread that steps the model.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene.h"

namespace simlab {

enum class Mode { off = 0, hold = 1, run = 2, stop = 3 };
enum class Cause { none = 0, emergency = 1, table = 2, wrist = 3, late = 4, limit = 5 };
const char* toText(Cause cause);

class Drive {
public:
    explicit Drive(Scene& scene);           // changes gains and friction of the scene's model

    double deceleration = 4;                // [rad/s^2] of the fastest joint in a stop of category 1

    // A record of arm.set: q6, qdot6, mode; due, now: [s].
    void take(const double* record, double due, std::uint64_t counter, double now);
    // Between mj_step1 and mj_step2.
    void control(mjData& d, double now);
    void cut(Cause cause, std::string why, double now);         // category 0
    void reset();
    void place(mjData& d, const Joints& q);                     // put the arm there, braked

    bool power() const { return phase_ == Phase::powered || phase_ == Phase::slowing; }
    Cause cause() const { return cause_; }
    const std::string& why() const { return why_; }             // text of the cause, or why power does not come back
    std::uint64_t counter() const { return counter_; }          // of the set-point in use
    double period() const { return period_; }
    double due() const { return lastDue_; }                     // of the last set-point that came
    bool streaming(double now) const;                           // set-points come: the last one three periods ago at most
    double torque(const mjData& d, std::size_t joint) const;    // [N m] of the motor

    // Measures of the last stop, from its beginning to the last motion; known when the arm stands still.
    struct Stopped {
        Cause cause = Cause::none;
        double seconds = 0, tool = 0, joint = 0;
    };  // [m] at the tool, [rad] of a joint
    // True once for each stop.
    bool stopped(Stopped& out);

private:
    enum class Phase { braked, powered, slowing };
    struct Point { double due = 0; Joints q{}, speed{}, acceleration{}; };

    Point reference(double now) const;
    void slow(Cause cause, std::string why, double now);
    void follow(mjData& d, const Point& at);
    void switchServos(bool on);
    void brake(bool on);
    void watch(const mjData& d, double now);
    std::string nearness(const Point& p) const;
    std::string fault(const Point& p, Mode mode, double now) const;     // what limit a set-point breaks

    Scene& scene_;
    Joints gain_, damping_, friction_, actual_{};
    std::vector<mjtNum> wanted_, needed_;   // accelerations of all joints of the model, and the torques that they take
    Phase phase_ = Phase::braked;
    Cause cause_ = Cause::none;
    std::string why_;
    bool armed_ = false;                // power may come with the next set-point of mode hold or run
    Point from_, next_;
    std::uint64_t counter_ = 0;
    double period_ = 0.015, lastDue_ = -1;
    double arrival_ = 0, came_ = -1;    // of the last one that is obeyed; of any
    double brakeAt_ = -1;               // the brakes engage then; -1: it is settled
    // slowing
    double since_ = 0, until_ = 0;
    Point slowFrom_;
    // the stop that is being measured
    bool measuring_ = false, measured_ = false;
    double stopTime_ = 0, stillSince_ = 0;
    Joints stopFrom_{};
    std::array<double, 3> stopTool_{};
    Stopped stop_;
};

}  // namespace simlab
