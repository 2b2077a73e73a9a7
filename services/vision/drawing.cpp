#include "drawing.h"

#include <cmath>

#include <opencv2/imgproc.hpp>

namespace vision {

namespace {

const cv::Scalar& scalar(Drawing::Colour colour) {
    static const cv::Scalar all[] = {{0, 255, 128}, {255, 64, 255}, {0, 160, 255}};
    return all[colour];
}

bool near(double u, double v) { return std::fabs(u) < 1e4 && std::fabs(v) < 1e4; }
cv::Point point(double u, double v) { return {int(std::lround(u)), int(std::lround(v))}; }

}  // namespace

void Drawing::circle(double u, double v, double radius, Colour colour) {
    if (near(u, v) && near(radius, 0)) cv::circle(rgb_, point(u, v), int(std::lround(radius)), scalar(colour), 1, cv::LINE_AA);
}

void Drawing::cross(double u, double v, Colour colour) {
    line({u - 4, v}, {u + 4, v}, colour);
    line({u, v - 4}, {u, v + 4}, colour);
}

void Drawing::box(double left, double top, double right, double bottom, Colour colour) {
    if (near(left, top) && near(right, bottom)) cv::rectangle(rgb_, point(left, top), point(right, bottom), scalar(colour));
}

void Drawing::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, Colour colour) {
    if (near(from.x(), from.y()) && near(to.x(), to.y()))
        cv::line(rgb_, point(from.x(), from.y()), point(to.x(), to.y()), scalar(colour), 1, cv::LINE_AA);
}

void Drawing::text(double u, double v, const std::string& text, Colour colour) {
    if (near(u, v)) cv::putText(rgb_, text, point(u, v), cv::FONT_HERSHEY_SIMPLEX, 0.38, scalar(colour), 1, cv::LINE_AA);
}

void Drawing::blobs(const std::vector<Blob>& blobs) {
    for (auto& b : blobs) box(b.left - 1, b.top - 1, b.right + 1, b.bottom + 1, note);
}

void Drawing::ppm(std::vector<unsigned char>& out) const {
    const std::string head = "P6\n" + std::to_string(rgb_.cols) + " " + std::to_string(rgb_.rows) + "\n255\n";
    out.assign(head.begin(), head.end());
    out.insert(out.end(), rgb_.data, rgb_.data + rgb_.total() * 3);
}

}  // namespace vision
