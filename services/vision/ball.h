// ball.h -- finds a bright ball in a picture: its place and size, and whether the measurement is valid.
#pragma once

#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "blobs.h"
#include "view.h"

namespace vision {

enum class Verdict { valid, none, clipped, size, shape, occluded, ambiguous };      // as ball.obs numbers them
inline constexpr const char* kVerdicts[] = {"valid", "none", "clipped", "size", "shape", "occluded", "ambiguous"};

struct BallRules {
    int threshold = 250;                    // of the grey picture: only the lamp is so bright
    double least = 4, most = 120;           // radius [pixels]
    double round = 0.96;                    // least b/a, of what the lens makes of a ball there; from wideFrom pixels of radius on
    double roundSmall = 0.8, wideFrom = 15; // below, where pixels are coarse
    double solid = 0.95;                    // least part of its ellipse that is bright
    double second = 0.3;                    // a blob of that part of the largest one's area may be the ball, too
    double step = 60;                       // [pixels] farther than that it does not come from one picture to the next, unless it jumps
    double doubt = 2;                       // [s] without the ball, before another single blob is accepted
};

struct Sighting {
    Verdict verdict = Verdict::none;
    double u = 0, v = 0, area = 0, radius = 0, eccentricity = 0, angle = 0;
    double measured = 0, limit = 0;         // of the rule that it breaks
};

// Chooses the ball among several bright blobs, in pictures that follow each other: the blob nearest the last position.
// A blob beside the ball stays another one as long as it is seen, also when the ball goes out. One that appears alone may be
// the ball after a jump.
class BallMemory {
public:
    // The index of the ball among these, in a picture of time t [s]; none: it cannot be told.
    std::optional<std::size_t> choose(const std::vector<cv::Point2d>& seen, double t, const BallRules& rules);
    void forget() { *this = {}; }

private:
    std::optional<std::size_t> chosen(const std::vector<cv::Point2d>& seen, double t, const BallRules& rules) const;

    bool known_ = false;
    cv::Point2d ball_;
    double time_ = 0;                       // [s] when it was seen last
    std::vector<cv::Point2d> others_;       // in the last picture
};

class BallFinder {
public:
    // In the whole of an RGB picture, or in a window of it; the border that clips is the picture's, or the window's.
    Sighting find(const cv::Mat& rgb, const Lens& lens, const BallRules& rules, std::optional<cv::Rect> window = {}) {
        BallMemory none;
        return find(rgb, lens, rules, window, 0, none);
    }
    // One of pictures that follow each other, of time t [s].
    Sighting find(const cv::Mat& rgb, const Lens& lens, const BallRules& rules, std::optional<cv::Rect> window, double t, BallMemory& memory);

private:
    cv::Mat grey_, bright_;
    BlobFinder finder_;
};

}  // namespace vision
