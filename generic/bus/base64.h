// base64.h -- bytes as text, and back: RFC 4648, with padding, without line ends.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace sorma {

void appendBase64(std::string& out, const unsigned char* data, std::size_t size);
// Append the bytes. False: malformed, and out is as before. Each block of bytes has one text: bits that stand for nothing must be 0.
bool parseBase64(std::string_view text, std::vector<unsigned char>& out);

}  // namespace sorma
