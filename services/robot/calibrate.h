// calibrate.h -- measures the hand's weight and centre, and the reading of the wrist's sensor without it.
#pragma once

#include "mover.h"

namespace robot {

// A measurement of the wrist at rest, in one orientation.
struct Weighing {
    Vector3d up;                            // the world's z in tool axes
    Wrench felt;
};

struct Load {
    double mass = 0;                        // [kg]
    Vector3d centre = {0, 0, 0};            // [m] tool axes, from the sensor
    Wrench offset = Wrench::Zero();
    double forceResidual = 0, momentResidual = 0;       // root of the mean square
};

// Least squares over at least three orientations in which gravity acts along different axes of the tool. False: they are
// too alike.
bool weigh(const std::vector<Weighing>& weighings, Load& load);

class Calibrate final : public Mover {
public:
    static sorma::Class describe();
    void born() override { changed({}); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;

private:
    Job::Plan plan(const Now& now);
    void save(const std::vector<std::string>& words, const Load& load);

    std::vector<double> postures_;
    double jointSpeed_ = 0.5, rest_ = 1, mostResidual_ = 0.5;
    sorma::Named<sorma::Kind::file> file_;
};

}  // namespace robot
