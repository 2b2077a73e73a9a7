#include "place.h"

namespace robot {

ToolPose Frames::toolOf(const Joints& q) const {
    const puma::Pose t = puma::forward(q);
    const Eigen::Matrix3d r = t.leftCols<3>();
    return {base + t.col(3) + r * tool, Quaterniond(r)};
}

puma::Pose Frames::flangeOf(const ToolPose& place) const {
    puma::Pose t;
    t.leftCols<3>() = place.r.toRotationMatrix();
    t.col(3) = place.p - place.r * tool - base;
    return t;
}

}  // namespace robot
