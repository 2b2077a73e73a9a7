// control.h -- the control task: in each tick it reads the sensors and writes the next set-point.
//
//     read state and forces  ->  power  ->  motion  ->  guards  ->  gate  ->  set-point, records
//
// The gate is the last check, and does not depend on motions and guards. It lets no set-point pass that exceeds the joints'
// limits of angle, speed and acceleration. It stops the arm when the force at the wrist is too large.
//
// Threads:   any thread may call tick() and requestStop(), one tick at a time. All else belongs to the SORM's thread,
//            between ticks.
// Allocates: never in tick().
#pragma once

#include <array>
#include <atomic>
#include <string>
#include <vector>

#include "bus/incident.h"

#include "arm.h"
#include "motion.h"

namespace robot {

struct Settings {
    Frames frames;
    ArmLimits limits;
    bool labClock = false;                  // ticks are due by lab time
    double silence = 0.1;                   // [s] wall time, at least three periods; without a record for so long it is absent
    bool sensors = true;                    // read the wrist's sensor
    bool compensate = true;                 // subtract the hand's weight
    double handMass = 0;                    // [kg]
    Vector3d handCentre = {0, 0, 0};        // [m] tool axes, from the sensor
    Wrench sensorOffset = Wrench::Zero();   // reading without any load
    double forceFilter = 0.01;              // [s]
    double wristForce = 60, wristMoment = 10;   // [N], [N m] more than that stops the arm
};

enum class Phase { off, waking, holding, moving, braking };
const char* toText(Phase phase);

enum class Outcome { done, stopped, guard, overload, powerLost, silent, unreachable, limits, singular, gate, sensorLost };
inline constexpr std::size_t kOutcomes = std::size_t(Outcome::sensorLost) + 1;

const char* toText(Outcome outcome);

// The result of a motion, or of waking up (then only done, powerLost, silent).
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

    void wake();                            // ask for power; with power it holds the posture that is measured
    void sleep();                           // power off
    // Begin a motion. It must exist until its ending was taken.   guards: are checked while it goes on.
    void begin(Motion& motion, std::vector<Guard> guards);
    void replaceGuard(const Guard& guard);  // a guard with that name has other settings
    void acknowledge() { overloaded_ = false, armed_ = false; }
    bool takeEnding(Ending& ending);        // true: a motion has ended since the last call
    int bell() const { return bell_; }      // a descriptor that can be read when one has ended
    void quiet() const;                     // make it unreadable again

    Phase phase() const { return phase_; }
    bool heard() const { return heard_; }               // the other side writes its state
    bool knows() const { return knows_; }               // the other side has written its state at least once
    bool sensed() const { return sensed_; }             // the wrist's sensor is read
    bool overloaded() const { return overloaded_; }     // the wrist was overloaded; acknowledge() allows motions again
    const ArmState& state() const { return state_; }
    const Joints& setPoint() const { return q_; }
    const Wrench& felt() const { return felt_; }
    const Wrench& raw() const { return raw_; }
    double part() const { return motion_ ? motion_->part() : 0; }

    // ---- any time ----
    struct Faults {
        std::array<sorma::Tally, kOutcomes> motions;        // that have ended so
        std::array<sorma::Tally, kCauses> power;            // lost while nothing moved or was to wake, by cause
        sorma::Tally silences, overloads;                   // the same
        sorma::Tally senseless;                             // the wrist's sensor has fallen silent, or has written what is no number
    } faults;

private:
    void sense(double period, double silence) noexcept;
    void followPower() noexcept;
    void move(double period) noexcept;
    GuardInput viewOf(const Joints& q, double period) const noexcept;
    void checkGuards(const Joints& q, double period) noexcept;
    bool restsInside(Joints q, double period) noexcept;
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
    ToolPose tool_;                                        // and where it brings the tool
    Vector3d velocity_ = {0, 0, 0}, acceleration_ = {0, 0, 0};     // of the tool, by the last set-points

    Motion* motion_ = nullptr;
    bool onPath_ = true;                                // it brakes along its path, not joint by joint
    bool reason_ = false;                               // ending_ says already why it will end
    std::vector<Guard> guards_;
    bool guardsChanged_ = false, needsForce_ = false;
    double waited_ = 0;                                 // [s] for power
    std::uint64_t before_ = 0;                          // waking: number of the last set-point before it
    bool offTaken_ = false;                             // waking: the other side has taken one that says "off"
    Ending ending_;
    bool ended_ = false;
    std::atomic<bool> stop_{false};
    int bell_;
};

}  // namespace robot
