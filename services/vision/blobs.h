// blobs.h -- connected pixels of one colour, and their moments.
#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

namespace vision {

// Pixel centres have whole coordinates: u to the right, v down, from 0.
struct Blob {
    std::uint8_t colour = 0;
    bool clipped = false;                           // it touches the border of the picture
    int left = 0, top = 0, right = 0, bottom = 0;   // the last ones belong to it
    double area = 0;                                // [pixels]
    double u = 0, v = 0;                            // its centroid
    double uu = 0, uv = 0, vv = 0;                  // central second moments, by area
};

// The ellipse that has the moments of a blob: half axes a >= b, angle of a [rad].
struct Ellipse {
    double a = 0, b = 0, angle = 0;
    double radius() const;                          // of the disc of its area
    double eccentricity() const;
};
Ellipse ellipseOf(const Blob& blob);

// Finds blobs by the runs of pixels in each row, neighbours in 8 directions; it keeps its room from one picture to the next.
class BlobFinder {
public:
    // The blobs of a picture of colours (CV_8U, 0 is background) with at least so many pixels, top first. Valid until the next
    // call.
    const std::vector<Blob>& find(const cv::Mat& colours, double leastArea = 1);

private:
    struct Run {
        int row, from, to;                          // to is the last one
        std::uint32_t parent;                       // an earlier run of the same blob, or itself
        std::uint8_t colour;
    };
    std::uint32_t rootOf(std::uint32_t run);

    std::vector<Run> runs_;
    std::vector<std::uint32_t> blobOf_;             // by root
    std::vector<Blob> blobs_;
};

}  // namespace vision
