#include "ball.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

namespace vision {

Sighting BallFinder::find(const cv::Mat& rgb, const Lens& lens, const BallRules& rules, std::optional<cv::Rect> window) {
    const cv::Rect whole(0, 0, rgb.cols, rgb.rows), part = window ? *window & whole : whole;
    Sighting s;
    if (part.empty()) return s;
    cv::cvtColor(rgb(part), grey_, cv::COLOR_RGB2GRAY);
    cv::threshold(grey_, grey_, rules.threshold - 1, 255, cv::THRESH_BINARY);
    const auto& blobs = finder_.find(grey_, 4);
    const Blob* ball = nullptr;
    double second = 0;
    for (auto& b : blobs) {
        if (!ball || b.area > ball->area) second = ball ? ball->area : 0, ball = &b;
        else second = std::max(second, b.area);
    }
    if (!ball) return s;
    const Ellipse e = ellipseOf(*ball);
    s.u = part.x + ball->u;
    s.v = part.y + ball->v;
    s.area = ball->area;
    s.radius = e.radius();
    s.eccentricity = e.eccentricity();
    s.angle = e.angle;
    auto breaks = [&](Verdict verdict, double measured, double limit) {
        s.verdict = verdict, s.measured = measured, s.limit = limit;
        return s;
    };
    if (ball->clipped) return breaks(Verdict::clipped, 0, 0);
    if (!(s.radius >= rules.least)) return breaks(Verdict::size, s.radius, rules.least);
    if (s.radius > rules.most) return breaks(Verdict::size, s.radius, rules.most);
    if (second > rules.second * s.area) return breaks(Verdict::ambiguous, second / s.area, rules.second);
    // A wide lens makes an ellipse of a ball that is off its axis: e = sin(off) / cos(half the angle under which it is seen).
    const double off = std::atan(std::hypot(s.u - lens.centreU, s.v - lens.centreV) / lens.f), seen = s.radius / lens.f * std::cos(off);
    const double expected = std::sqrt(std::max(0.0, 1 - std::pow(std::sin(off), 2) / (1 - std::min(0.99, seen * seen))));
    const double roundness = e.b / e.a / expected, least = s.radius >= rules.wideFrom ? rules.round : rules.roundSmall;
    if (roundness < least) return breaks(Verdict::shape, roundness, least);
    const double solidity = s.area / (std::numbers::pi * e.a * e.b);
    if (solidity < rules.solid) return breaks(Verdict::occluded, solidity, rules.solid);
    return breaks(Verdict::valid, 0, 0);
}

}  // namespace vision
