// vision.cpp -- what it costs to find things in a picture of 500x500, without grabbing.
#include "rows.h"

#include <cmath>
#include <string>

#include <opencv2/imgproc.hpp>

#include "vision/ball.h"
#include "vision/boardReader.h"
#include "vision/colourTable.h"

namespace bench {

namespace {

constexpr int kSide = 500;
const std::vector<Case> kCases = {
    {.row = "BALL", .what = "a ball found in the whole picture", .floor = "OpenCV's conversion to grey and threshold of the same pixels", .mostNs = 250e3,
     .batch = 2'000'000},
    {.row = "BALL_window", .what = "a ball found in a window of 90x90 around it", .floor = "the same of the window", .mostNs = 20e3},
    {.row = "BOARD", .what = "a board with 24 tokens: colours, blobs, markers, 64 fields", .floor = "OpenCV's conversion to hue, saturation, brightness",
     .mostNs = 2e6, .batch = 5'000'000},
};

void ball(Table& table) {
    cv::Mat picture(kSide, kSide, CV_8UC3, cv::Scalar(60, 70, 60)), grey;
    cv::circle(picture, {300, 220}, 30, cv::Scalar(255, 255, 255), -1);
    const vision::Lens lens;
    const vision::BallRules rules;
    const cv::Rect window(255, 175, 90, 90);
    vision::BallFinder finder;
    auto bare = [&](const cv::Mat& part) {
        cv::cvtColor(part, grey, cv::COLOR_RGB2GRAY);
        cv::threshold(grey, grey, rules.threshold - 1, 255, cv::THRESH_BINARY);
        keep(grey);
    };
    auto found = [&](std::optional<cv::Rect> where) {
        auto s = finder.find(picture, lens, rules, where);
        keep(s);
    };
    if (table.wants(kCases[0].row)) table.measure(kCases[0], repeat([&] { found({}); }), repeat([&] { bare(picture); }));
    if (table.wants(kCases[1].row)) table.measure(kCases[1], repeat([&] { found(window); }), repeat([&] { bare(picture(window)); }));
}

// Seen from straight above, so that it can be drawn here.
void board(Table& table) {
    const vision::BoardShape shape;
    vision::CameraView view;
    view.camera.linear() << 0, -1, 0, -1, 0, 0, 0, 0, -1;
    view.camera.translation() << 0.57, 0, 0.62;
    vision::BoardPose pose;
    pose.x = 0.57;
    cv::Mat picture(kSide, kSide, CV_8UC3, cv::Scalar(150, 146, 138)), labels = cv::Mat::zeros(kSide, kSide, CV_8U), colours, hsv;
    auto disc = [&](double x, double y, double z, double radius, cv::Scalar colour, int label) {
        auto at = view.pixelOf(pose.world(x, y, z));
        const int r = int(std::lround(view.lens.f * radius / (0.62 - z)));
        cv::circle(picture, cv::Point(int(std::lround(at.x())), int(std::lround(at.y()))), r, colour, -1);
        cv::circle(labels, cv::Point(int(std::lround(at.x())), int(std::lround(at.y()))), r, label, -1);
    };
    disc(-shape.behind, -shape.aside, 0, 0.013, {128, 13, 191}, vision::violet);
    disc(-shape.behind, shape.aside, 0, 0.009, {128, 13, 191}, vision::violet);
    for (int i = 0; i < 64; ++i)
        if (int row = i / 8, column = i % 8; (row + column) % 2 == 0 && (row < 3 || row > 4))
            disc((row - 3.5) * shape.field, (column - 3.5) * shape.field, shape.height, shape.token,
                 row < 3 ? cv::Scalar(204, 15, 10) : cv::Scalar(242, 204, 13), row < 3 ? vision::red : vision::yellow);
    vision::Training training;
    training.add(picture, labels);
    const vision::ColourTable colourTable = training.table();
    vision::BlobFinder finder;
    table.measure(kCases[2],
                  repeat([&] {
                      colourTable.classify(picture, colours, hsv);
                      const auto& blobs = finder.find(colours, 8);
                      auto s = vision::readBoard(blobs, view, shape, vision::findMarkers(blobs, view, shape));
                      keep(s);
                  }),
                  repeat([&] {
                      cv::cvtColor(picture, hsv, cv::COLOR_RGB2HSV_FULL);
                      keep(hsv);
                  }));
}

}  // namespace

void vision(Table& table) {
    if (!table.wantsAny(kCases)) return;
    cv::setNumThreads(1);
    ball(table);
    if (table.wants(kCases[2].row)) board(table);
}

}  // namespace bench
