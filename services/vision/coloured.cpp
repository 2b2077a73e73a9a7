#include "coloured.h"

#include <stdexcept>

namespace vision {

using sorma::Severity;

const sorma::Prototype kNoPicture{Severity::error, "VISION PICTURE", 1,
                                  "{}: there is no picture: set -picture to an object that answers one, or give one to EXEC"};
const sorma::Prototype kPicture{Severity::error, "VISION PICTURE", 1,
                                "{}: {} is no picture: {}; it must be floats time, width, height, and {} byte{} for each pixel"};
const sorma::Prototype kNoTable{Severity::error, "VISION TABLE", 1,
                                "{}: it knows no colours: set -table to a file that hsvtable has written"};
const sorma::Prototype kTable{Severity::error, "VISION TABLE", 1, "{}: {}"};

namespace {
constexpr double kMostSide = 8192;          // [pixels]
}

cv::Mat pictureOf(const std::string& who, const std::string& whose, sorma::Message& m, std::size_t planes, int type) {
    auto wrong = [&](const std::string& why) { sorma::fail(kPicture, who, whose, why, CV_MAT_CN(type), CV_MAT_CN(type) == 1 ? "" : "s"); };
    if (m.floats.size() < 3) wrong("it has " + std::to_string(m.floats.size()) + " floats");
    const double w = m.floats[1], h = m.floats[2];
    if (!(w >= 1 && w <= kMostSide && h >= 1 && h <= kMostSide)) wrong("its size is " + sorma::numberText(w) + " x " + sorma::numberText(h));
    const auto width = std::size_t(w), height = std::size_t(h);
    if (m.any.size() < planes * width * height)
        wrong("its size is " + std::to_string(width) + " x " + std::to_string(height) + ", and it has " + std::to_string(m.any.size()) + " bytes");
    return cv::Mat(int(height), int(width), type, m.any.data());
}

TablePointer Coloured::load(const TableFile& file, std::string* origin) const {
    if (file.empty()) return nullptr;
    const std::string& name = file.use(*this);
    try {
        std::string line;
        return std::make_shared<ColourTable>(ColourTable::load(name, origin ? *origin : line));
    } catch (const std::runtime_error& e) {
        fail(kTable, this->name(), e.what());
    }
}

}  // namespace vision
