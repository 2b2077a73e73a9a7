#include "blobs.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace vision {

double Ellipse::radius() const { return std::sqrt(a * b); }
double Ellipse::eccentricity() const { return a > 0 ? std::sqrt(std::max(0.0, 1 - b * b / (a * a))) : 0; }

Ellipse ellipseOf(const Blob& blob) {
    double mean = (blob.uu + blob.vv) / 2, half = (blob.uu - blob.vv) / 2, root = std::sqrt(half * half + blob.uv * blob.uv);
    return {2 * std::sqrt(mean + root), 2 * std::sqrt(std::max(0.0, mean - root)), 0.5 * std::atan2(2 * blob.uv, blob.uu - blob.vv)};
}

std::uint32_t BlobFinder::rootOf(std::uint32_t run) {
    while (runs_[run].parent != run) run = runs_[run].parent = runs_[runs_[run].parent].parent;
    return run;
}

const std::vector<Blob>& BlobFinder::find(const cv::Mat& colours, double leastArea) {
    runs_.clear();
    std::size_t above = 0, aboveEnd = 0;            // runs of the row above
    for (int y = 0; y < colours.rows; ++y) {
        const std::uint8_t* row = colours.ptr(y);
        const std::size_t begin = runs_.size();
        std::size_t at = above;
        for (int x = 0; x < colours.cols;) {
            if (row[x] == 0) {
                std::uint64_t eight;                // most is background
                while (x + 8 <= colours.cols && (std::memcpy(&eight, row + x, 8), eight == 0)) x += 8;
                while (x < colours.cols && row[x] == 0) ++x;
                continue;
            }
            const int from = x;
            const std::uint8_t colour = row[x];
            while (x < colours.cols && row[x] == colour) ++x;
            const auto me = std::uint32_t(runs_.size());
            runs_.push_back({y, from, x - 1, me, colour});
            while (at < aboveEnd && runs_[at].to < from - 1) ++at;
            for (std::size_t k = at; k < aboveEnd && runs_[k].from <= x; ++k) {
                if (runs_[k].colour != colour) continue;
                std::uint32_t one = rootOf(std::uint32_t(k)), other = rootOf(me);
                runs_[std::max(one, other)].parent = std::min(one, other);
            }
        }
        above = begin;
        aboveEnd = runs_.size();
    }
    // Sums, then moments. The sum of squares from n to m: that of a run is had at once.
    constexpr auto none = std::numeric_limits<std::uint32_t>::max();
    auto squares = [](double n) { return n * (n + 1) * (2 * n + 1) / 6; };
    blobOf_.assign(runs_.size(), none);
    blobs_.clear();
    for (std::uint32_t k = 0; k < runs_.size(); ++k) {
        const Run& r = runs_[k];
        std::uint32_t root = rootOf(k);
        if (blobOf_[root] == none) {
            blobOf_[root] = std::uint32_t(blobs_.size());
            blobs_.emplace_back();
            blobs_.back().colour = r.colour;
            blobs_.back().left = r.from, blobs_.back().right = r.to, blobs_.back().top = r.row;
        }
        Blob& b = blobs_[blobOf_[root]];
        const double n = r.to - r.from + 1, u = n * (r.from + r.to) / 2.0, v = r.row;
        b.left = std::min(b.left, r.from);
        b.right = std::max(b.right, r.to);
        b.bottom = r.row;
        b.area += n;
        b.u += u;
        b.v += n * v;
        b.uu += squares(r.to) - squares(r.from - 1.0);
        b.uv += u * v;
        b.vv += n * v * v;
    }
    std::erase_if(blobs_, [&](const Blob& b) { return b.area < leastArea; });
    for (auto& b : blobs_) {
        b.u /= b.area;
        b.v /= b.area;
        b.uu = b.uu / b.area - b.u * b.u;
        b.uv = b.uv / b.area - b.u * b.v;
        b.vv = b.vv / b.area - b.v * b.v;
        b.clipped = b.left == 0 || b.top == 0 || b.right == colours.cols - 1 || b.bottom == colours.rows - 1;
    }
    return blobs_;
}

}  // namespace vision
