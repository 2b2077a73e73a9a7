#include "boardReader.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "colourTable.h"

namespace vision {

namespace {

constexpr double kLeastMarker = 40;                         // [pixels]
constexpr double kRatioLow = 1.5, kRatioHigh = 2.8;         // of the areas of A and B; 2.09 by their radii
constexpr double kRound = 0.6, kDistance = 0.03;
constexpr double kSizeSpread = 0.35;                        // of the logarithm of a token's area
constexpr double kOccupied = 0.15, kUncertain = 0.6;
constexpr double kAstray = 0.3;                             // of the distance of two fields: nobody's
constexpr double kBeside = 0.75;                            // of it: beside the board; where four fields meet it is 0.71

double fit(const Eigen::Vector2d& offset, double sigma, double area, double expected) {
    double size = std::log(area / expected);
    return std::exp(-offset.squaredNorm() / (2 * sigma * sigma) - size * size / (2 * kSizeSpread * kSizeSpread));
}

std::string fieldName(int file, int rank) { return char('a' + file) + std::to_string(rank + 1); }

}  // namespace

Eigen::Vector3d BoardPose::world(double boardX, double boardY, double height) const {
    double c = std::cos(yaw), s = std::sin(yaw);
    return {x + c * boardX - s * boardY, y + s * boardX + c * boardY, height};
}

BoardPose findMarkers(const std::vector<Blob>& blobs, const CameraView& view, const BoardShape& shape) {
    BoardPose pose;
    std::vector<const Blob*> found;
    for (auto& b : blobs) {
        if (b.colour != violet || b.area < kLeastMarker || b.clipped) continue;
        Ellipse e = ellipseOf(b);
        if (e.b >= kRound * e.a) found.push_back(&b);
    }
    if (found.size() != 2) {
        pose.trouble = fmt::format("{} round violet marker{} of at least {} pixels {} seen; there must be 2", found.size(), found.size() == 1 ? "" : "s",
                                   kLeastMarker, found.size() == 1 ? "is" : "are");
        return pose;
    }
    const Blob* large = found[0]->area >= found[1]->area ? found[0] : found[1];
    const Blob* small = large == found[0] ? found[1] : found[0];
    pose.a = {large->u, large->v};
    pose.b = {small->u, small->v};
    if (double ratio = large->area / small->area; ratio < kRatioLow || ratio > kRatioHigh) {
        pose.trouble = fmt::format("the areas of the markers have the ratio {:.2f}; it must be {} to {}", ratio, kRatioLow, kRatioHigh);
        return pose;
    }
    const Eigen::Vector3d a = view.onPlane(pose.a, 0), b = view.onPlane(pose.b, 0), along = b - a;
    if (!along.allFinite()) {
        pose.trouble = "the camera does not look at the table";
        return pose;
    }
    if (double off = along.norm() / (2 * shape.aside) - 1; std::abs(off) > kDistance) {
        pose.trouble = fmt::format("the markers are {:.1f} mm apart; it must be {:.1f} mm, to {:.0f} %", 1e3 * along.norm(), 2e3 * shape.aside, 100 * kDistance);
        return pose;
    }
    pose.yaw = std::remainder(std::atan2(along.y(), along.x()) - std::numbers::pi / 2, 2 * std::numbers::pi);
    pose.x = (a.x() + b.x()) / 2 + shape.behind * std::cos(pose.yaw);
    pose.y = (a.y() + b.y()) / 2 + shape.behind * std::sin(pose.yaw);
    return pose;
}

Situation readBoard(const std::vector<Blob>& blobs, const CameraView& view, const BoardShape& shape, const BoardPose& pose) {
    const int n = shape.fields;
    struct Field {
        Eigen::Vector2d pixel;
        double pitch, area;
        const Blob* token = nullptr;
        double best = 0;
        int fitting = 0;                // tokens that could stand there
    };
    std::vector<Field> fields;          // rank n first, file a first
    for (int rank = n - 1; rank >= 0; --rank)
        for (int file = 0; file < n; ++file) {
            auto pixel = [&](double f, double r) {
                return view.pixelOf(pose.world((n / 2.0 - r - 0.5) * shape.field, (f + 0.5 - n / 2.0) * shape.field, shape.height));
            };
            Field field;
            field.pixel = pixel(file, rank);
            field.pitch = ((pixel(file + 1, rank) - field.pixel).norm() + (pixel(file, rank + 1) - field.pixel).norm()) / 2;
            double radius = field.pitch * shape.token / shape.field;
            field.area = 0.95 * std::numbers::pi * radius * radius;
            fields.push_back(field);
        }
    auto nameOf = [&](std::size_t i) { return fieldName(int(i) % n, n - 1 - int(i) / n); };
    auto fitOf = [&](const Field& f, const Blob& b) { return fit(Eigen::Vector2d(b.u, b.v) - f.pixel, f.pitch / 4, b.area, f.area); };
    Situation s;
    auto complain = [&](const std::string& text) { s.trouble += (s.trouble.empty() ? "" : "; ") + text; };
    for (auto& b : blobs) {
        if (b.colour != red && b.colour != yellow) continue;
        std::size_t first = 0, second = 0;
        double most = -1, next = -1;
        for (std::size_t i = 0; i < fields.size(); ++i) {
            double distance = -(Eigen::Vector2d(b.u, b.v) - fields[i].pixel).norm() / fields[i].pitch;
            if (most == -1 || distance > most) second = first, next = most, first = i, most = distance;
            else if (next == -1 || distance > next) second = i, next = distance;
        }
        Field& field = fields[first];
        if (b.area < 0.2 * field.area) continue;                    // a gleam
        if (-most > kBeside) continue;                              // the heap
        double phi = fitOf(field, b);
        const char* colour = b.colour == red ? "red" : "yellow";
        if (phi <= kOccupied || -most > kAstray) {
            complain(-most > kAstray ? fmt::format("a {} token between {} and {}", colour, nameOf(first), nameOf(second))
                                 : fmt::format("something {} on {} has {:.0f} pixels; a token has {:.0f}", colour, nameOf(first), b.area, field.area));
            continue;
        }
        if (++field.fitting == 2) complain("two tokens on " + nameOf(first));
        if (phi > field.best) field.best = phi, field.token = &b;
    }
    for (auto& f : fields) {
        double confidence = f.token ? f.best : 1 - f.best;
        s.confidences.push_back(confidence);
        s.symbols += confidence < kUncertain ? '?' : !f.token ? '.' : f.token->colour == red ? 'r' : 'y';
    }
    return s;
}

Disk findDisk(const std::vector<Blob>& blobs, std::uint8_t colour, const Eigen::Vector2d& expected, double radius, double error) {
    Disk disk;
    disk.expectedArea = 0.95 * std::numbers::pi * radius * radius;
    for (auto& b : blobs) {
        if (b.colour != colour) continue;
        double phi = fit(Eigen::Vector2d(b.u, b.v) - expected, radius / 2 + error, b.area, disk.expectedArea);
        if (!disk.blob || phi > disk.fit) disk.blob = &b, disk.fit = phi;
    }
    return disk;
}

}  // namespace vision
