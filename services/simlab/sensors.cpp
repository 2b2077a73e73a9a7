#include "sensors.h"

#include <algorithm>

namespace simlab {

namespace {
constexpr double kLegX = 0.55, kLegY = 0.65;        // [m] of the legs from the centre of the table
}

std::array<double, 6> Sensors::wrist(const mjData& d) {
    std::array<double, 6> out;
    for (std::size_t i = 0; i < 3; ++i) {
        out[i] = d.sensordata[scene_.wristForce + int(i)] + wristNoise * random_.gaussian();
        out[3 + i] = d.sensordata[scene_.wristTorque + int(i)] + wristNoise / 50 * random_.gaussian();
    }
    return out;
}

// The force of a contact acts on its second geom, and reversed on the first. Force and moments are split over the four legs so that
// their squares are least.
Sensors::Table Sensors::table(const mjData& d) {
    double force = 0, x = 0, y = 0;
    const mjtNum* centre = d.geom_xpos + 3 * scene_.tabletop;
    for (int i = 0; i < d.ncon; ++i) {
        const mjContact& c = d.contact[i];
        if (c.geom1 != scene_.tabletop && c.geom2 != scene_.tabletop) continue;
        mjtNum f[6];
        mj_contactForce(scene_.model.get(), &d, i, f);
        double down = c.frame[2] * f[0] + c.frame[5] * f[1] + c.frame[8] * f[2];
        if (c.geom2 == scene_.tabletop) down = -down;
        force += down;
        x += down * (c.pos[0] - centre[0]);
        y += down * (c.pos[1] - centre[1]);
    }
    Table out{{}, force};
    for (std::size_t i = 0; i < 4; ++i)
        out.legs[i] =
            (force + (i < 2 ? x : -x) / kLegX + (i % 2 == 0 ? y : -y) / kLegY) / 4 + tableNoise * random_.gaussian();
    return out;
}

std::array<double, 3> Sensors::tips(const mjData& d) {
    std::array<double, 3> out;
    for (std::size_t i = 0; i < 3; ++i) out[i] = std::max(0.0, d.sensordata[scene_.touch[i]] + tipNoise * random_.gaussian());
    return out;
}

}  // namespace simlab
