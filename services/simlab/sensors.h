// sensors.h -- the readings of the laboratory's sensors after a step, with noise.
//
// Threads: none of its own; called by the thread that steps the model.
#pragma once

#include <cstdint>

#include <units/random.h>

#include "scene.h"

namespace simlab {

class Sensors {
public:
    Sensors(const Scene& scene, std::uint64_t seed) : scene_(scene), random_(seed) {}

    double wristNoise = 0.05;           // [N] standard deviation of a force; of a moment [N m] a fiftieth of it
    double tableNoise = 0.1;            // [N] of a leg
    double tipNoise = 0.01;             // [N]

    std::array<double, 6> wrist(const mjData& d);  // force [N], moment [N m] at the site fts, in its axes, weight included
    struct Table {
        std::array<double, 4> legs;     // [N] at (+x +y) (+x -y) (-x +y) (-x -y), of what lies on the table
        double load;                    // [N] together, without noise
    };
    Table table(const mjData& d);
    std::array<double, 3> tips(const mjData& d);        // [N] normal force

private:
    const Scene& scene_;
    units::Random random_;
};

}  // namespace simlab
