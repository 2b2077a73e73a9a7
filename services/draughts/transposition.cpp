#include "draughts/transposition.h"

#include <bit>
#include <cstdlib>
#include <cstring>
#include <new>

namespace draughts {

void Transpositions::Free::operator()(Line* l) const { std::free(l); }

Transpositions::Transpositions(std::size_t bytes) {
    std::size_t lines = std::bit_floor(bytes < sizeof(Line) ? std::size_t(1) : bytes / sizeof(Line));
    for (;; lines /= 2) {
        void* memory = std::aligned_alloc(alignof(Line), lines * sizeof(Line));
        if (memory) {
            lines_.reset(static_cast<Line*>(memory));
            break;
        }
        if (lines == 1) throw std::bad_alloc();
    }
    mask_ = lines - 1;
    clear();
}

void Transpositions::clear() {
    std::memset(static_cast<void*>(lines_.get()), 0, size());
    generation_ = 0;
}

// data: move 20 bits, score 16, depth 8, bound 2, generation 6.
bool Transpositions::find(std::uint64_t key, Known& known) const {
    for (auto& e : lines_[key & mask_].entries) {
        std::uint64_t data = e.data.load(std::memory_order_relaxed);
        if ((e.check.load(std::memory_order_relaxed) ^ data) != key || !data) continue;
        known.move = MoveMark(data & 0xfffff);
        known.score = std::int16_t(data >> 20 & 0xffff);
        known.depth = std::int8_t(data >> 36 & 0xff);
        known.bound = Bound(data >> 44 & 3);
        return true;
    }
    return false;
}

void Transpositions::store(std::uint64_t key, const Known& known) {
    Line& line = lines_[key & mask_];
    Entry* best = nullptr;
    int worst = 1 << 20;
    std::uint64_t move = known.move;
    for (auto& e : line.entries) {
        std::uint64_t data = e.data.load(std::memory_order_relaxed);
        if ((e.check.load(std::memory_order_relaxed) ^ data) == key) {
            if (!move) move = data & 0xfffff;
            best = &e;
            break;
        }
        int worth = std::int8_t(data >> 36 & 0xff) + ((data >> 46 & 63) == generation_ ? 256 : 0) + (data ? 1 : -512);
        if (worth < worst) worst = worth, best = &e;
    }
    std::uint64_t data = move | std::uint64_t(std::uint16_t(std::int16_t(known.score))) << 20 |
                         std::uint64_t(std::uint8_t(std::int8_t(known.depth))) << 36 | std::uint64_t(known.bound) << 44 |
                         std::uint64_t(generation_) << 46;
    best->data.store(data, std::memory_order_relaxed);
    best->check.store(key ^ data, std::memory_order_relaxed);
}

}  // namespace draughts
