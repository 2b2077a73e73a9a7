// colourTable.h -- the colour of a pixel: a table of 65536 codes, 6 bits of hue, 5 of saturation, 5 of brightness.
//
// It is trained from labelled pictures. Each class gets competitive clusters in the cone of colours, and each cluster a radial
// basis function. A code belongs to the class with the largest one.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace vision {

inline constexpr std::size_t kCodes = 65536;
enum Colour : std::uint8_t { background, red, yellow, violet };
inline constexpr std::size_t kColours = 4;
inline constexpr const char* kColourNames[kColours] = {"background", "red", "yellow", "violet"};

// One pixel, with the hue of OpenCV's COLOR_RGB2HSV_FULL.
std::uint16_t codeOf(std::uint8_t r, std::uint8_t g, std::uint8_t b);

class ColourTable {
public:
    ColourTable() : colours_(kCodes, background) {}

    Colour operator[](std::uint16_t code) const { return Colour(colours_[code]); }
    // The colour of each pixel of an RGB picture (CV_8UC3); colours becomes CV_8U of its size.   hsv: room that may be used again.
    void classify(const cv::Mat& rgb, cv::Mat& colours, cv::Mat& hsv) const;

    // One line that says where it comes from, then the codes. Errors are std::runtime_error, with the file's name.
    void save(const std::string& file, const std::string& origin) const;
    static ColourTable load(const std::string& file, std::string& origin);

private:
    friend class Training;
    std::vector<std::uint8_t> colours_;     // by code
};

// Labelled pictures, one after another, then the table.
class Training {
public:
    // labels: CV_8U, the Colour of each pixel; other numbers: not known. A pixel whose neighbours have another label is left
    // out.
    void add(const cv::Mat& rgb, const cv::Mat& labels);
    ColourTable table() const;              // of no samples: all is background

    std::size_t pictures() const { return pictures_; }
    std::size_t samples(Colour c) const { return total_[c]; }
    std::size_t clusters() const { return clusters_; }      // of the last table

private:
    std::array<std::vector<std::uint32_t>, kColours> counts_{std::vector<std::uint32_t>(kCodes), std::vector<std::uint32_t>(kCodes),
                                                             std::vector<std::uint32_t>(kCodes), std::vector<std::uint32_t>(kCodes)};
    std::array<std::size_t, kColours> total_{};
    std::size_t pictures_ = 0;
    mutable std::size_t clusters_ = 0;
};

}  // namespace vision
