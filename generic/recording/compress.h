// compress.h -- bytes made fewer by zstd, where configure has found it.
//
// Threads: any; each has a context of its own.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sorma::recording::compress {

bool available();
bool pack(std::string_view plain, std::string& out);        // false: it is not available, or there is no memory
// So many bytes must come out of it. False: it is broken, or not available; out has what came before.
bool unpack(std::string_view packed, std::size_t plain, std::string& out);

}  // namespace sorma::recording::compress
