#include "errors.h"

#include <cstdio>

namespace robot {

using sorma::Severity;

const sorma::Prototype kHardware{Severity::error, "ROBOT HARDWARE", 1,
                                 "{}: the arm's other side is not there: {}; start it (simlab, or what drives the arm)"};
const sorma::Prototype kTask{Severity::error, "ROBOT TASK", 1, "{}: the control task does not run: {}"};
const sorma::Prototype kPower{Severity::error, "ROBOT POWER", 1, "{}: the arm has no power; {}"};
const sorma::Prototype kPowerLost{Severity::error, "ROBOT POWER", 1,
                                  "{}: the arm has lost its power: {}; a person must reset it there, then say \"{} EXEC "
                                  "power on\""};
const sorma::Prototype kSilent{Severity::error, "ROBOT SILENT", 1,
                               "{}: the arm's other side has fallen silent, and brakes by itself; when it is there again "
                               "say \"{} EXEC power on\""};
const sorma::Prototype kBusy{Severity::error, "ROBOT BUSY", 1, "{}: the arm is moved by {} for {}, {} of the way; wait, or "
                                                               "CTRL -stop stops it"};
const sorma::Prototype kWord{Severity::error, "ROBOT WORD", 2, "{}: bad word \"{}\": must be {}"};
const sorma::Prototype kTarget{Severity::error, "ROBOT TARGET", 1, "{}: {}"};
const sorma::Prototype kValue{Severity::error, "ROBOT VALUE", 1, "{}: float {} is {}; all must be finite numbers"};
const sorma::Prototype kUnreachable{Severity::error, "ROBOT UNREACHABLE", 1,
                                    "{}: the arm does not reach {} m, {} % of the way: its wrist would be {} m from the "
                                    "shoulder, which the arm bridges from {} to {} m"};
const sorma::Prototype kTooClose{Severity::error, "ROBOT UNREACHABLE", 1,
                                 "{}: the arm does not reach {} m, {} % of the way: its wrist would be too close to the "
                                 "waist"};
const sorma::Prototype kGate{Severity::error, "ROBOT LIMITS", 1,
                             "{}: joint {} was to have the {} {}, allowed is {}; the gate has stopped the arm at {} m"};
const sorma::Prototype kLimits{Severity::error, "ROBOT LIMITS", 1,
                               "{}: joint {} would need the angle {} rad, {} % of the way, allowed is {}"};
const sorma::Prototype kSingular{Severity::error, "ROBOT SINGULAR", 1,
                                 "{}: a straight line through {} m, {} % of the way, comes too near to a singularity ({}); "
                                 "move with -move joints, or around it"};
const sorma::Prototype kSpeed{Severity::error, "ROBOT LIMITS", 1,
                              "{}: joint {} would need {} {}, {} % of the way, allowed is {}; less -speed or -acceleration "
                              "helps"};
const sorma::Prototype kGuard{Severity::error, "ROBOT GUARD", 2,
                              "{}: guard {} has tripped: {} was {}, allowed is {}; the arm has stopped at {} m"};
const sorma::Prototype kWouldTrip{Severity::error, "ROBOT GUARD", 2,
                                  "{}: guard {} would trip {} % of the way: {} {}, allowed is {}; nothing has moved"};
const sorma::Prototype kOverload{Severity::error, "ROBOT OVERLOAD", 1,
                                 "{}: too much at the wrist: {} was {}, allowed is {}; the arm has stopped at {} m; see "
                                 "why, then say \"{} EXEC reset\""};
const sorma::Prototype kOverloaded{Severity::error, "ROBOT OVERLOAD", 1,
                                   "{}: the arm was stopped for too much at the wrist; see why, then say \"{} EXEC reset\""};
const sorma::Prototype kSensor{Severity::error, "ROBOT SENSOR", 1, "{}: the wrist's sensor gives no data, and {}"};
const sorma::Prototype kStopped{Severity::error, "ROBOT STOPPED", 1, "{}: the motion was stopped, {}; the arm is at {} m"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const sorma::Prototype kNotAGuard{Severity::error, "OPTION VALUE", 2,
                                  "{}: {} {}: is of class {}; a guard is of class wspc, and in this process"};
const sorma::Prototype kNotAnArm{Severity::error, "OPTION VALUE", 2,
                                 "{}: {} {}: is of class {}; an arm is of class pino, and in this process"};
const sorma::Prototype kIncrements{Severity::error, "ROBOT INCREMENTS", 1, "{}: -increments: {}"};
const sorma::Prototype kName{Severity::error, "ROBOT NAME", 2, "{}: {}"};
const sorma::Prototype kNoContact{Severity::error, "ROBOT CONTACT", 1,
                                  "{}: no contact: up to {} m the force against the motion was at most {} N, -contactForce "
                                  "is {} N"};
const sorma::Prototype kCalibration{Severity::error, "ROBOT CALIBRATION", 1, "{}: {}"};
const sorma::Prototype kFile{Severity::error, "ROBOT FILE", 2, "{}: {}: {}"};
const sorma::Prototype kOrder{Severity::error, "OPTION VALUE", 2, "{}: {}: {}"};

std::string number(double x) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.4g", x);
    return buffer;
}

std::string text(const Vector3d& v) {
    char buffer[96];
    std::snprintf(buffer, sizeof buffer, "%.4f %.4f %.4f", v.x(), v.y(), v.z());
    return buffer;
}

std::string allowed(const Trip& trip) {
    if (trip.high == Guard::kAny) return "at least " + number(trip.low);
    if (trip.low == -Guard::kAny) return "at most " + number(trip.high);
    return number(trip.low) + " .. " + number(trip.high);
}

}  // namespace robot
