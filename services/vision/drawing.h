// drawing.h -- draws results into a picture, for people.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "blobs.h"

namespace vision {

class Drawing {
public:
    enum Colour { good, bad, note };

    explicit Drawing(const cv::Mat& rgb) : rgb_(rgb.clone()) {}

    // All in pixels. Points that are not finite, or far outside, are left out.
    void circle(double u, double v, double radius, Colour colour);
    void cross(double u, double v, Colour colour);
    void box(double left, double top, double right, double bottom, Colour colour);
    void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, Colour colour);
    void text(double u, double v, const std::string& text, Colour colour);     // cut where the picture ends
    void blobs(const std::vector<Blob>& blobs);     // a box around each

    void ppm(std::vector<unsigned char>& out) const;

private:
    cv::Mat rgb_;
};

}  // namespace vision
