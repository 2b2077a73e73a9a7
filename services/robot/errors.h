// errors.h -- the errors of the robot's classes.
#pragma once

#include <string>

#include <sorma.h>

#include "guard.h"

namespace robot {

extern const sorma::Prototype kHardware, kTask, kPower, kPowerLost, kSilent, kBusy, kWord, kTarget, kValue, kUnreachable,
    kTooClose, kLimits, kGate, kSingular, kSpeed, kGuard, kWouldTrip, kOverload, kOverloaded, kSensor, kStopped, kGone,
    kNotAGuard, kNotAnArm, kIncrements, kName,
    kNoContact, kCalibration, kFile, kOrder;

std::string number(double x);               // four digits
std::string text(const Vector3d& v);        // "0.5600 0.0000 0.3000"
std::string allowed(const Trip& trip);      // "0 .. 0.25", "at least 0.03"

}  // namespace robot
