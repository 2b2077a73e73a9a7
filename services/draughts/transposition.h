// transposition.h -- the transposition table of a search, shared by its threads.
//
// An entry is two words, the first the key combined with the second. If two threads write an entry at once, it matches no key, so
// no lock is needed. Four entries share a cache line; an old one is replaced first, then the one of least depth.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "draughts/position.h"

namespace draughts {

enum class Bound : std::uint8_t { none, upper, lower, exact };

// Enough of a move to find it again in the list of legal moves.
using MoveMark = std::uint32_t;
inline MoveMark markOf(const Move& m) {
    return MoveMark(m.from | m.to << 6 | (m.captured * 0x9e3779b97f4a7c15u >> 56) << 12);     // 20 bits
}

struct Known {
    MoveMark move = 0;
    int score = 0, depth = 0;
    Bound bound = Bound::none;
};

class Transpositions {
public:
    // Takes the largest power of two that fits. When there is not so much memory it takes half of it, and so on; size() tells.
    explicit Transpositions(std::size_t bytes);

    std::size_t size() const { return (mask_ + 1) * sizeof(Line); }     // [bytes]
    void clear();
    void age() { generation_ = (generation_ + 1) & 63; }

    bool find(std::uint64_t key, Known& known) const;
    void store(std::uint64_t key, const Known& known);
    void prefetch(std::uint64_t key) const { __builtin_prefetch(&lines_[key & mask_]); }

private:
    struct Entry {
        std::atomic<std::uint64_t> check{0}, data{0};       // relaxed: an entry that does not fit together is no entry
    };
    struct alignas(64) Line {
        Entry entries[4];
    };
    struct Free {
        void operator()(Line* l) const;
    };
    std::unique_ptr<Line[], Free> lines_;
    std::size_t mask_ = 0;
    unsigned generation_ = 0;
};

}  // namespace draughts
