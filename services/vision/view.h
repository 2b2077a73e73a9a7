// view.h -- a camera and its pose: from points of the world to pixels, and back to a plane.
#pragma once

#include <Eigen/Geometry>

namespace vision {

// The lens: camera frame x right, y down, z forward; u = centreU + f X/Z, v = centreV + f Y/Z.
struct Lens {
    double f = 451.01;                              // [pixels]
    double centreU = 249.5, centreV = 249.5;

    static Lens of(int width, int height, double fieldOfView);      // vertical [rad]
};

struct CameraView {
    Lens lens;
    Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();       // the camera frame in the world's [m]

    // Pixel of a point in the world; behind the camera: not a number.
    Eigen::Vector2d pixelOf(const Eigen::Vector3d& point) const;
    // Where the ray through a pixel meets the plane at this height; not a number: it does not.
    Eigen::Vector3d onPlane(const Eigen::Vector2d& pixel, double height) const;
};

// The image of a ball, exactly: an ellipse. centre: in the camera frame [m].
struct BallImage {
    double u = 0, v = 0, a = 0, b = 0, area = 0, eccentricity = 0;
};
BallImage imageOfBall(const Lens& lens, const Eigen::Vector3d& centre, double radius);

}  // namespace vision
