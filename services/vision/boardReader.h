// boardReader.h -- a draughts board in a picture: its place, from its two markers, and the token on each field.
//
// Board frame: origin in its middle, x away from the robot, y to the left. Fields are the game's: file a..h = 1..n along y, rank 1 at
// the person, x = (n/2 - rank + 1/2) F (doc/simlab.man).
#pragma once

#include <string>
#include <vector>

#include "blobs.h"
#include "view.h"

namespace vision {

struct BoardShape {
    int fields = 8;                                     // of a side
    double field = 0.045;                               // [m]
    double behind = 0.206, aside = 0.160;               // markers A (large) and B at (-behind, -aside) and (-behind, +aside) [m]
    double token = 0.015, height = 0.008;               // radius and height of a token [m]
};

struct BoardPose {
    double x = 0, y = 0, yaw = 0;                       // of the board in the world [m], [rad]
    Eigen::Vector2d a, b;                               // pixels of the markers
    std::string trouble;                                // why it was not found: "1 marker", "ratio 1.2 ..."; empty: it was

    Eigen::Vector3d world(double boardX, double boardY, double height) const;
};

// The two violet discs among the blobs; tests by their number, sizes, roundness and distance.
BoardPose findMarkers(const std::vector<Blob>& blobs, const CameraView& view, const BoardShape& shape);

struct Situation {
    std::string symbols;                // n*n of . r y and ?, for uncertain; rank n first, file a first
    std::vector<double> confidences;    // as the symbols
    std::string trouble;                // "token between d4 and e5"; empty: none
};

// The tokens on the fields: each token goes to the field that it fits best, and each field keeps the one that fits best.
Situation readBoard(const std::vector<Blob>& blobs, const CameraView& view, const BoardShape& shape, const BoardPose& pose);

// One token, where one is expected: the blob of this colour that fits best, and how well it does (0 .. 1). null: there is none.
struct Disk {
    const Blob* blob = nullptr;
    double fit = 0, expectedArea = 0;
};
Disk findDisk(const std::vector<Blob>& blobs, std::uint8_t colour, const Eigen::Vector2d& expected, double radius, double error);

}  // namespace vision
