#include "comm/record.h"

#include <algorithm>
#include <utility>

namespace sorma::record {

std::size_t count(const Buffer& bytes) {
    std::size_t n = 0;
    std::string_view record;
    for (Reader records(bytes); records.next(record);) ++n;
    return n;
}

std::size_t wholeBefore(const Buffer& bytes, std::size_t size) {
    Reader records(bytes.data(), std::min(size, bytes.size()), SIZE_MAX);
    std::string_view record;
    while (records.next(record)) {}
    return static_cast<std::size_t>(records.at() - bytes.data());
}

void Assembler::drop(const char*& at, const char* end) {
    const std::size_t n = std::min(dropping_, static_cast<std::size_t>(end - at));
    dropping_ -= n;
    at += n;
}

bool Assembler::add(const Piece& piece, Buffer& own, std::string_view& record) {
    if (piece.last && pieces_.empty()) [[likely]] {
        empties_ = 0;
        record = piece.text();
        return true;
    }
    pieces_.append(piece.body, piece.length);
    if (!piece.last) {
        if (piece.length == 0) ++empties_;
        return false;
    }
    empties_ = 0;
    own = std::exchange(pieces_, {});
    record = {own.data(), own.size()};
    return true;
}

}  // namespace sorma::record
