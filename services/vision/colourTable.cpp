#include "colourTable.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

namespace vision {

namespace {

constexpr const char* kMagic = "SORMA hsvtable 1 ";
constexpr double kFar = 0.12;           // a sample that is farther from each centre of its class founds a new one
constexpr double kNarrow = 0.03;        // least width of a basis function
constexpr double kFaint = 8;            // below exp(-8) it is background
constexpr std::size_t kMostOfColour = 4, kMostOfBackground = 16;
constexpr int kRounds = 20;

std::uint16_t code(const std::uint8_t* hsv) { return std::uint16_t((hsv[0] >> 2) << 10 | (hsv[1] >> 3) << 5 | hsv[2] >> 3); }

// The middle of a code's bin in the cone of colours: hue means little where there is little colour or light.
cv::Vec3d placeOf(std::size_t code) {
    double h = 2 * std::numbers::pi * (double(code >> 10) + 0.5) / 64, s = (double(code >> 5 & 31) + 0.5) / 32, v = (double(code & 31) + 0.5) / 32;
    return {s * v * std::cos(h), s * v * std::sin(h), v};
}

double squared(const cv::Vec3d& x) { return x.dot(x); }

struct Cluster {
    cv::Vec3d centre;
    double width = kNarrow;
};

// Each sample belongs to the nearest centre, which moves to the mean of its own; codes weigh as the root of how often they came.
std::vector<Cluster> clustersOf(const std::vector<std::uint32_t>& counts, std::size_t most) {
    struct Sample {
        cv::Vec3d place;
        double weight;
    };
    std::vector<Sample> samples;
    for (std::size_t k = 0; k < counts.size(); ++k)
        if (counts[k] > 0) samples.push_back({placeOf(k), std::sqrt(double(counts[k]))});
    std::vector<Cluster> clusters;
    auto nearest = [&](const cv::Vec3d& at) {
        std::size_t best = clusters.size();
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t k = 0; k < clusters.size(); ++k)
            if (double d = squared(at - clusters[k].centre); d < least) least = d, best = k;
        return std::pair(best, least);
    };
    for (auto& s : samples)
        if (auto [k, d] = nearest(s.place); clusters.empty() || (d > kFar * kFar && clusters.size() < most)) clusters.push_back({s.place});
    for (int round = 0; round < kRounds; ++round) {
        std::vector<cv::Vec3d> sum(clusters.size(), cv::Vec3d::all(0));
        std::vector<double> weight(clusters.size(), 0), spread(clusters.size(), 0);
        for (auto& s : samples) {
            auto [k, d] = nearest(s.place);
            sum[k] += s.weight * s.place;
            weight[k] += s.weight;
            spread[k] += s.weight * d;
        }
        for (std::size_t k = 0; k < clusters.size(); ++k) {
            if (weight[k] == 0) continue;
            clusters[k] = {sum[k] / weight[k], std::max(kNarrow, std::sqrt(spread[k] / weight[k] / 3))};
        }
    }
    return clusters;
}

}  // namespace

std::uint16_t codeOf(std::uint8_t r, std::uint8_t g, std::uint8_t b) {
    cv::Mat hsv;
    cv::cvtColor(cv::Mat(1, 1, CV_8UC3, cv::Scalar(r, g, b)), hsv, cv::COLOR_RGB2HSV_FULL);
    return code(hsv.ptr());
}

void ColourTable::classify(const cv::Mat& rgb, cv::Mat& colours, cv::Mat& hsv) const {
    cv::cvtColor(rgb, hsv, cv::COLOR_RGB2HSV_FULL);
    colours.create(rgb.size(), CV_8U);
    for (int y = 0; y < rgb.rows; ++y) {
        const std::uint8_t* from = hsv.ptr(y);
        std::uint8_t* to = colours.ptr(y);
        for (int x = 0; x < rgb.cols; ++x) to[x] = colours_[code(from + 3 * x)];
    }
}

void ColourTable::save(const std::string& file, const std::string& origin) const {
    std::ofstream out(file, std::ios::binary);
    out << kMagic << origin << '\n';
    out.write(reinterpret_cast<const char*>(colours_.data()), std::streamsize(colours_.size()));
    out.close();
    if (!out) throw std::runtime_error("cannot write " + file + ": " + std::strerror(errno));
}

ColourTable ColourTable::load(const std::string& file, std::string& origin) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error("cannot read " + file + ": " + std::strerror(errno));
    std::string head;
    ColourTable t;
    if (!std::getline(in, head) || !head.starts_with(kMagic))
        throw std::runtime_error(file + " is no table of colours of version 1: it must begin with \"" + kMagic + "\"");
    in.read(reinterpret_cast<char*>(t.colours_.data()), std::streamsize(kCodes));
    if (in.gcount() != std::streamsize(kCodes) || in.peek() != std::ifstream::traits_type::eof())
        throw std::runtime_error(file + " is damaged: after its first line there must be 65536 bytes");
    for (auto c : t.colours_)
        if (c >= kColours) throw std::runtime_error(file + " is damaged: it has a colour " + std::to_string(c) + ", there are 0 to 3");
    origin = head.substr(std::strlen(kMagic));
    return t;
}

void Training::add(const cv::Mat& rgb, const cv::Mat& labels) {
    cv::Mat hsv, low, high;
    cv::cvtColor(rgb, hsv, cv::COLOR_RGB2HSV_FULL);
    const cv::Mat around = cv::Mat::ones(3, 3, CV_8U);
    cv::erode(labels, low, around);
    cv::dilate(labels, high, around);
    for (int y = 0; y < rgb.rows; ++y)
        for (int x = 0; x < rgb.cols; ++x) {
            std::uint8_t label = labels.at<std::uint8_t>(y, x);
            if (label >= kColours || low.at<std::uint8_t>(y, x) != label || high.at<std::uint8_t>(y, x) != label) continue;
            ++counts_[label][code(hsv.ptr(y, x))];
            ++total_[label];
        }
    ++pictures_;
}

ColourTable Training::table() const {
    std::array<std::vector<Cluster>, kColours> clusters;
    clusters_ = 0;
    for (std::size_t c = 0; c < kColours; ++c) {
        clusters[c] = clustersOf(counts_[c], c == background ? kMostOfBackground : kMostOfColour);
        clusters_ += clusters[c].size();
    }
    ColourTable t;
    for (std::size_t code = 0; code < kCodes; ++code) {
        cv::Vec3d at = placeOf(code);
        double best = kFaint;
        for (std::size_t c = 0; c < kColours; ++c)
            for (auto& k : clusters[c])
                if (double d = squared(at - k.centre) / (2 * k.width * k.width); d < best) best = d, t.colours_[code] = std::uint8_t(c);
    }
    return t;
}

}  // namespace vision
