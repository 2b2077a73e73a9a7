#include "ball.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

namespace vision {

namespace {

constexpr double kNever = 1e9;          // [pixels]
constexpr double kClear = 0.5;          // the ball is the nearest one when the next one is twice as far

// A pixel that the ball covers in part is not bright enough. Its brightness, compared with the background two pixels farther
// out, gives the covered part. So the radius is known to a hundredth of a pixel, not to a few.
Blob withEdge(const Blob& blob, const cv::Mat& grey, const cv::Mat& bright) {
    constexpr double kFull = 255, kOutwards = 2;
    double area = blob.area, u = area * blob.u, v = area * blob.v;
    double uu = area * (blob.uu + blob.u * blob.u), uv = area * (blob.uv + blob.u * blob.v), vv = area * (blob.vv + blob.v * blob.v);
    auto touches = [&](int x, int y) {
        for (int j = std::max(0, y - 1); j <= std::min(bright.rows - 1, y + 1); ++j)
            for (int i = std::max(0, x - 1); i <= std::min(bright.cols - 1, x + 1); ++i)
                if (bright.at<std::uint8_t>(j, i)) return true;
        return false;
    };
    for (int y = blob.top - 1; y <= blob.bottom + 1; ++y)
        for (int x = blob.left - 1; x <= blob.right + 1; ++x) {
            if (bright.at<std::uint8_t>(y, x) || !touches(x, y)) continue;
            const double du = x - blob.u, dv = y - blob.v, far = std::max(1.0, std::hypot(du, dv));
            const int bx = int(std::lround(x + kOutwards * du / far)), by = int(std::lround(y + kOutwards * dv / far));
            if (bx < 0 || by < 0 || bx >= grey.cols || by >= grey.rows || bright.at<std::uint8_t>(by, bx)) continue;
            const double behind = grey.at<std::uint8_t>(by, bx);
            const double part = std::clamp((grey.at<std::uint8_t>(y, x) - behind) / std::max(1.0, kFull - behind), 0.0, 1.0);
            area += part, u += part * x, v += part * y;
            uu += part * x * x, uv += part * x * y, vv += part * y * y;
        }
    Blob whole = blob;
    whole.area = area, whole.u = u / area, whole.v = v / area;
    whole.uu = uu / area - whole.u * whole.u, whole.uv = uv / area - whole.u * whole.v, whole.vv = vv / area - whole.v * whole.v;
    return whole;
}

}  // namespace

std::optional<std::size_t> BallMemory::chosen(const std::vector<cv::Point2d>& seen, double t, const BallRules& rules) const {
    auto far = [](cv::Point2d a, cv::Point2d b) { return std::hypot(a.x - b.x, a.y - b.y); };
    std::vector<std::size_t> ball, unknown;         // those that go on from the ball, and from nothing
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const double fromBall = known_ ? far(seen[i], ball_) : kNever;
        double fromOther = kNever;
        for (auto& other : others_) fromOther = std::min(fromOther, far(seen[i], other));
        if (fromOther < rules.step && fromOther <= fromBall) continue;
        unknown.push_back(i);
        if (fromBall < rules.step) ball.push_back(i);
    }
    if (ball.size() > 1) {
        std::sort(ball.begin(), ball.end(), [&](auto a, auto b) { return far(seen[a], ball_) < far(seen[b], ball_); });
        if (far(seen[ball[0]], ball_) > kClear * far(seen[ball[1]], ball_)) return {};
    }
    if (!ball.empty()) return ball[0];
    if (unknown.size() == 1) return unknown[0];
    if (seen.size() == 1 && t - time_ > rules.doubt) return 0;
    return {};
}

std::optional<std::size_t> BallMemory::choose(const std::vector<cv::Point2d>& seen, double t, const BallRules& rules) {
    const auto choice = chosen(seen, t, rules);
    if (choice) known_ = true, ball_ = seen[*choice], time_ = t;
    others_.clear();
    for (std::size_t i = 0; i < seen.size(); ++i)
        if (i != choice) others_.push_back(seen[i]);
    return choice;
}

Sighting BallFinder::find(const cv::Mat& rgb, const Lens& lens, const BallRules& rules, std::optional<cv::Rect> window, double t, BallMemory& memory) {
    const cv::Rect whole(0, 0, rgb.cols, rgb.rows), part = window ? *window & whole : whole;
    Sighting s;
    if (part.empty()) return s;
    cv::cvtColor(rgb(part), grey_, cv::COLOR_RGB2GRAY);
    cv::threshold(grey_, bright_, rules.threshold - 1, 255, cv::THRESH_BINARY);
    const auto& blobs = finder_.find(bright_, 4);
    double largest = 0;
    for (auto& b : blobs) largest = std::max(largest, b.area);
    std::vector<const Blob*> all;
    std::vector<cv::Point2d> places;
    for (auto& b : blobs)
        if (b.area > rules.second * largest) all.push_back(&b), places.emplace_back(part.x + b.u, part.y + b.v);
    const auto choice = memory.choose(places, t, rules);
    const Blob* ball = nullptr;
    for (auto* b : all)
        if (!ball || b->area > ball->area) ball = b;
    if (choice) ball = all[*choice];
    if (!ball) return s;
    const Blob disc = ball->clipped ? *ball : withEdge(*ball, grey_, bright_);
    const Ellipse e = ellipseOf(disc);
    s.u = part.x + disc.u;
    s.v = part.y + disc.v;
    s.area = disc.area;
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
    if (!choice) return breaks(Verdict::ambiguous, double(all.size()), 1);
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
