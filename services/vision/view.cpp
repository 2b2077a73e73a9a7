#include "view.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace vision {

namespace {
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
}

Lens Lens::of(int width, int height, double fieldOfView) {
    return {height / (2 * std::tan(fieldOfView / 2)), width / 2.0 - 0.5, height / 2.0 - 0.5};
}

Eigen::Vector2d CameraView::pixelOf(const Eigen::Vector3d& point) const {
    Eigen::Vector3d p = camera.inverse() * point;
    if (!(p.z() > 0)) return {kNone, kNone};
    return {lens.centreU + lens.f * p.x() / p.z(), lens.centreV + lens.f * p.y() / p.z()};
}

Eigen::Vector3d CameraView::onPlane(const Eigen::Vector2d& pixel, double height) const {
    Eigen::Vector3d ray = camera.linear() * Eigen::Vector3d((pixel.x() - lens.centreU) / lens.f, (pixel.y() - lens.centreV) / lens.f, 1);
    double t = (height - camera.translation().z()) / ray.z();
    if (!(t > 0) || !std::isfinite(t)) return Eigen::Vector3d::Constant(kNone);
    return camera.translation() + t * ray;
}

BallImage imageOfBall(const Lens& lens, const Eigen::Vector3d& centre, double radius) {
    double distance = centre.norm(), sine = radius / distance;          // of the half angle under which it is seen
    double across = std::hypot(centre.x(), centre.y()), sinOff = across / distance, cosOff = centre.z() / distance;
    double delta = cosOff * cosOff - sine * sine, cosine = std::sqrt(1 - sine * sine);
    BallImage image;
    image.a = lens.f * sine * cosine / delta;
    image.b = lens.f * sine / std::sqrt(delta);
    image.area = std::numbers::pi * image.a * image.b;
    image.eccentricity = sinOff / cosine;
    double off = lens.f * sinOff * cosOff / delta;
    image.u = lens.centreU + (across > 0 ? off * centre.x() / across : 0);
    image.v = lens.centreV + (across > 0 ? off * centre.y() / across : 0);
    return image;
}

}  // namespace vision
