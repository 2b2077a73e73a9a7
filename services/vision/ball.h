// ball.h -- a bright ball in a picture: where it is, how large, and whether that is to be believed.
#pragma once

#include <optional>

#include "blobs.h"
#include "view.h"

namespace vision {

enum class Verdict { valid, none, clipped, size, shape, occluded, ambiguous };      // as ball.obs numbers them
inline constexpr const char* kVerdicts[] = {"valid", "none", "clipped", "size", "shape", "occluded", "ambiguous"};

struct BallRules {
    int threshold = 250;                    // of the grey picture: the lamp is the only thing that is as bright
    double least = 4, most = 120;           // radius [pixels]
    double round = 0.96;                    // least b/a, of what the lens makes of a ball there; from wideFrom pixels of radius on
    double roundSmall = 0.8, wideFrom = 15; // below, where pixels are coarse
    double solid = 0.95;                    // least part of its ellipse that is bright
    double second = 0.3;                    // a second blob of that part of its area makes it ambiguous
};

struct Sighting {
    Verdict verdict = Verdict::none;
    double u = 0, v = 0, area = 0, radius = 0, eccentricity = 0, angle = 0;
    double measured = 0, limit = 0;         // of the rule that it breaks
};

class BallFinder {
public:
    // In the whole of an RGB picture, or in a window of it; the border that clips is the picture's, or the window's.
    Sighting find(const cv::Mat& rgb, const Lens& lens, const BallRules& rules, std::optional<cv::Rect> window = {});

private:
    cv::Mat grey_, bright_;
    BlobFinder finder_;
};

}  // namespace vision
