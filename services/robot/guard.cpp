#include "guard.h"

#include <algorithm>
#include <array>

namespace robot {

namespace {

constexpr std::array<const char*, 3> kPosition = {"x of the tool [m]", "y of the tool [m]", "z of the tool [m]"};
constexpr std::array<const char*, 6> kFelt = {"force x [N]", "force y [N]", "force z [N]", "moment x [N m]",
                                              "moment y [N m]", "moment z [N m]"};

bool contains(const Box& box, const Vector3d& p) {
    constexpr double kTolerance = 1e-9;     // a point on the border of a box is in it
    return ((p - box.low).array() >= -kTolerance).all() && ((box.high - p).array() >= -kTolerance).all();
}

// The axis along which a point is farthest outside of a box.
int worstAxis(const Box& box, const Vector3d& p) {
    int axis;
    (p - box.high).cwiseMax(box.low - p).maxCoeff(&axis);
    return axis;
}

}  // namespace

bool Guard::check(const GuardInput& view, Trip& trip) const {
    auto within = [&](const char* what, double value, double low, double high) {
        if (value >= low && value <= high) return true;
        trip = {what, value, low, high};
        return false;
    };
    for (const Vector3d& p : {view.tool.p, view.ahead}) {
        if (!inside.empty() && std::none_of(inside.begin(), inside.end(), [&](auto& box) { return contains(box, p); })) {
            const int axis = worstAxis(inside[0], p);
            trip = {kPosition[std::size_t(axis)], p[axis], inside[0].low[axis], inside[0].high[axis]};
            return false;
        }
        for (auto& box : outside)
            if (contains(box, p)) {
                trip = {"height of the tool in a forbidden box, z [m]", p.z(), box.high.z(), kAny};
                return false;
            }
    }
    if (!within("speed [m/s]", view.speed, 0, speed) ||
        !within("distance from the shoulder's singularity [m]", view.singular.shoulder, singular.shoulder, kAny) ||
        !within("distance from the elbow's singularity [m]", view.singular.elbow, singular.elbow, kAny) ||
        !within("distance from the wrist's singularity", view.singular.wrist, singular.wrist, kAny))
        return false;
    if (!view.sensed) return true;
    if (!within("force [N]", view.felt.head<3>().norm(), 0, force)) return false;
    if (!within("moment [N m]", view.felt.tail<3>().norm(), 0, moment)) return false;
    Wrench felt = view.felt;
    if (worldForces) felt << view.tool.r * view.felt.head<3>(), view.tool.r * view.felt.tail<3>();
    for (int i = 0; i < 6; ++i)
        if (!within(kFelt[std::size_t(i)], felt[i], low[i], high[i])) return false;
    return true;
}

}  // namespace robot
