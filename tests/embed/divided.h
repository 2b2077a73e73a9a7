// divided.h -- divides a stream into its records, as a daemon does.
#pragma once

#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "comm/record.h"
#include "comm/xdr.h"

// The records of a stream that comes in parts of this size. A piece of N bytes, more than most, becomes "refused N". Bytes that are left
// stand in rest.
inline std::vector<std::string> divided(std::string_view stream, std::size_t part, std::size_t most, sorma::record::Assembler& pieces, sorma::Buffer& rest) {
    using namespace sorma;
    std::vector<std::string> found;
    for (std::size_t at = 0; at < stream.size(); at += part) {
        const auto more = stream.substr(at, part);
        rest.append(more.data(), more.size());
        const char *from = rest.data(), *const end = from + rest.size();
        for (;;) {
            pieces.drop(from, end);
            const record::Piece piece = record::front(from, end);
            if (!piece.known) break;
            if (piece.length > most) {
                from += record::kMarkSize;
                pieces.refuse(piece.length);
                found.push_back("refused " + std::to_string(piece.length));
                continue;
            }
            if (!piece.whole) break;
            from += piece.size();
            Buffer own;
            std::string_view record;
            if (pieces.add(piece, own, record)) found.emplace_back(record);
        }
        rest.drop(std::size_t(from - rest.data()));
        if (rest.size() >= record::kMarkSize + most) std::abort();      // it should have come out
    }
    return found;
}
