// control.h -- the control task: what happens in each tick between the sensors and the next set-point.
//
//     read state and forces  ->  power  ->  motion  ->  guards  ->  gate  ->  set-point, records
//
// The gate is the last layer, and stands apart from motions and guards: whatever they want, no set-point leaves the joints'
// limits of angle, speed and acceleration, and more force at the wrist than it may bear stops the arm.
//
// Threads:   tick() and requestStop() by any thread, one tick at a time; everything else by the SORM's thread, between
// ticks.
// Allocates: never in tick().
#pragma once

#include <array>
#include <atomic>
#include <string>
#include <vector>

#include "arm.h"
#include "motion.h"

namespace robot {

struct Settings {
    Frames frames;
    ArmLimits limits;
    bool labClock = false;                  // ticks are due by lab time
    double silence = 0.1;                   // [s] of wall time, and at least three periods: then the other side is not there
    bool sensors = true;                    // read the wrist's sensor
    bool compensate = true;                 // take the hand's weight off
    double handMass = 0;                    // [kg]
    Vector3d handCentre = {0, 0, 0};        // [m] tool axes, from the sensor
    Wrench sensorOffset = Wrench::Zero();   // what it shows without any load
    double forceFilter = 0.01;              // [s]
    double wristForce = 60, wristMoment = 10;   // [N], [N m] more than that stops the arm
};

enum class Phase { off, waking, holding, moving, braking };
const char* toText(Phase phase);

enum class Outcome { done, stopped, guard, overload, powerLost, silent, unreachable, limits, singular, gate, sensorLost };

// What has become of a motion, or of waking up (then only done, powerLost, silent).
struct Ending {
    Outcome outcome = Outcome::done;
    std::string guard;                      // its name; memory from before the first tick
    Trip trip;
    int joint = 0;                          // of gate, from 1
};

class Control {
public:
    explicit Control(std::string prefix);
    ~Control();
    Control(const Control&) = delete;
    Control& operator=(const Control&) = delete;

    void tick(std::int64_t time, double period) noexcept;       // time [ns]
    void requestStop() noexcept { stop_ = true; }               // any thread; the next tick begins to brake

    // ---- between ticks ----
    Arm arm;
    Settings settings;

    void wake();                            // ask for power: it goes on holding what is measured
    void sleep();                           // power off
    // Take over a motion. guards: those that hold while it goes on. It must exist until its ending has been taken.
    void begin(Motion& motion, std::vector<Guard> guards);
    void replaceGuard(const Guard& guard);  // one of them has other settings
    void acknowledge() { overloaded_ = false, armed_ = false; }
    bool takeEnding(Ending& ending);        // true: something has ended since
    int bell() const { return bell_; }      // a descriptor that can be read then
    void quiet() const;                     // ... and cannot be read again

    Phase phase() const { return phase_; }
    bool heard() const { return heard_; }               // the other side speaks
    bool knows() const { return knows_; }               // where the arm is: the other side has spoken
    bool sensed() const { return sensed_; }
    bool overloaded() const { return overloaded_; }     // since; acknowledge() allows motions again
    const ArmState& state() const { return state_; }
    const Joints& setPoint() const { return q_; }
    const Wrench& felt() const { return felt_; }
    const Wrench& raw() const { return raw_; }
    double part() const { return motion_ ? motion_->part() : 0; }

private:
    void sense(double period, double silence) noexcept;
    void followPower() noexcept;
    void move(double period) noexcept;
    View viewOf(const Joints& q, double period) const noexcept;
    void checkGuards(const Joints& q, double period) noexcept;
    bool passes(const Joints& q, const Joints& qdot, double period, Ending& why) const noexcept;
    void brakeJoints(double period) noexcept;
    void failMotion(Outcome outcome, bool onPath) noexcept;
    void finish() noexcept;

    Phase phase_ = Phase::off;
    ArmState state_;
    bool heard_ = false, knows_ = false, sensed_ = false;
    Wrench raw_ = Wrench::Zero(), felt_ = Wrench::Zero();
    bool overloaded_ = false, armed_ = true;            // armed: it has felt less than that since

    Joints q_ = Joints::Zero();                         // of the last set-point
    Joints qdot_ = Joints::Zero();                      // mean speed on the way there
    Place tool_;                                        // and where it brings the tool
    Vector3d velocity_ = {0, 0, 0}, acceleration_ = {0, 0, 0};     // of the tool, by the last set-points

    Motion* motion_ = nullptr;
    bool onPath_ = true;                                // it brakes along its path, not joint by joint
    bool reason_ = false;                               // ending_ says already why it will end
    std::vector<Guard> guards_;
    bool guardsChanged_ = false, needsForce_ = false;
    double waited_ = 0;                                 // [s] for power
    Ending ending_;
    bool ended_ = false;
    std::atomic<bool> stop_{false};
    int bell_;
};

}  // namespace robot
