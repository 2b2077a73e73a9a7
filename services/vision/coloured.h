// coloured.h -- the common part of the module's classes: pictures in messages, and tables of colours from files.
//
// A picture is a record as camera.image has it: floats time, width, height ...; any: red, green, blue, 8 bits each, top row first.
#pragma once

#include <memory>
#include <string>

#include <sorma.h>

#include "colourTable.h"

namespace vision {

extern const sorma::Prototype kNoPicture, kPicture, kNoTable, kTable;

// A picture of a message, without a copy: it lives as long as the message. It must have so many bytes
// (planes) for each pixel.   type: of OpenCV, of the first of them;   whose: where it comes from. Fails with VISION PICTURE.
cv::Mat pictureOf(const std::string& who, const std::string& whose, sorma::Message& m, std::size_t planes = 3, int type = CV_8UC3);

using TablePointer = std::shared_ptr<ColourTable>;

// Base of classes that read a table of colours from a file.
class Coloured : public sorma::Service {
protected:
    // Null: there is no file. Fails with VISION TABLE.
    using TableFile = sorma::Named<sorma::Kind::file>;
    TablePointer load(const TableFile& file, std::string* origin = nullptr) const;
};

}  // namespace vision
