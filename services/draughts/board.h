// board.h -- squares as bits of a word.
//
// Squares are numbered as in books: 1 at the left of Black's back row, along the rows. After each pair of rows one bit stays
// unused. So a step is a shift by half the width, or by one more, and a piece that leaves the board falls on an unused bit:
//
//     8x8   0  1  2  3        steps: up right -4, up left -5, down left +4, down right +5
//         4  5  6  7   (8)
//           9 10 11 12
//        13 14 15 16  (17) ...
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "draughts/rules.h"

namespace draughts {

using Bits = std::uint64_t;

constexpr Bits lowest(Bits b) { return b & (0 - b); }
constexpr Bits highest(Bits b) { return Bits(1) << (63 - std::countl_zero(b)); }
constexpr int indexOf(Bits b) { return std::countr_zero(b); }

// Without the processor's own instruction, which not every x86-64 has; the compiler knows the pattern and uses it where it may.
constexpr int countOf(Bits b) {
#ifdef __POPCNT__
    return std::popcount(b);
#else
    b = b - ((b >> 1) & 0x5555555555555555u);
    b = (b & 0x3333333333333333u) + ((b >> 2) & 0x3333333333333333u);
    return int((((b + (b >> 4)) & 0x0f0f0f0f0f0f0f0fu) * 0x0101010101010101u) >> 56);
#endif
}

// The sum of two, for less than two of them.
constexpr int countOf(Bits a, Bits b) {
#ifdef __POPCNT__
    return std::popcount(a) + std::popcount(b);
#else
    a = a - ((a >> 1) & 0x5555555555555555u);
    b = b - ((b >> 1) & 0x5555555555555555u);
    a = (a & 0x3333333333333333u) + ((a >> 2) & 0x3333333333333333u) + (b & 0x3333333333333333u) + ((b >> 2) & 0x3333333333333333u);
    return int((((a & 0x0f0f0f0f0f0f0f0fu) + ((a >> 4) & 0x0f0f0f0f0f0f0f0fu)) * 0x0101010101010101u) >> 56);
#endif
}

enum Direction { upLeft, upRight, downLeft, downRight };
constexpr Direction opposite(Direction d) { return Direction(3 - d); }

template <int Width> struct Board {
    static constexpr int half = Width / 2, squares = Width * half, last = squares - 1 + (squares - 1) / Width;

    // square: 1 .. squares
    static constexpr int index(int square) { return square - 1 + (square - 1) / Width; }
    static constexpr int square(int index) { return index + 1 - index / (Width + 1); }
    static constexpr Bits bit(int square) { return Bits(1) << index(square); }

    static constexpr Bits row(int r) {          // 0: Black's back row
        Bits b = 0;
        for (int i = 1; i <= half; ++i) b |= bit(r * half + i);
        return b;
    }
    static constexpr Bits makeAll() {
        Bits b = 0;
        for (int r = 0; r < Width; ++r) b |= row(r);
        return b;
    }
    static constexpr Bits all = makeAll(), top = row(0), bottom = row(Width - 1);
    // Where a man of that side is crowned.
    static constexpr Bits crowning(Side s) { return s == Side::white ? top : bottom; }

    template <Direction D> static constexpr Bits step(Bits b) {
        if constexpr (D == upLeft) return b >> (half + 1);
        else if constexpr (D == upRight) return b >> half;
        else if constexpr (D == downLeft) return b << half;
        else return b << (half + 1);
    }
    static constexpr Bits step(Bits b, Direction d) {
        return d == upLeft ? step<upLeft>(b) : d == upRight ? step<upRight>(b) : d == downLeft ? step<downLeft>(b) : step<downRight>(b);
    }

    // All squares from one, without it, to the edge.
    static constexpr std::array<std::array<Bits, 4>, 64> makeRays() {
        std::array<std::array<Bits, 4>, 64> out{};
        for (int s = 1; s <= squares; ++s)
            for (int d = 0; d < 4; ++d)
                for (Bits b = step(bit(s), Direction(d)) & all; b; b = step(b, Direction(d)) & all) out[index(s)][d] |= b;
        return out;
    }
    static constexpr std::array<std::array<Bits, 4>, 64> rays = makeRays();

    // The same position seen from the other side: square s becomes squares + 1 - s.
    static constexpr Bits turned(Bits b) {
        b = ((b >> 1) & 0x5555555555555555u) | ((b & 0x5555555555555555u) << 1);
        b = ((b >> 2) & 0x3333333333333333u) | ((b & 0x3333333333333333u) << 2);
        b = ((b >> 4) & 0x0f0f0f0f0f0f0f0fu) | ((b & 0x0f0f0f0f0f0f0f0fu) << 4);
        return __builtin_bswap64(b) >> (63 - last);
    }
};

inline int squareOf(const Rules& r, int index) { return index + 1 - index / (r.width + 1); }
inline int indexOfSquare(const Rules& r, int square) { return square - 1 + (square - 1) / r.width; }
inline Bits bitOf(const Rules& r, int square) { return Bits(1) << indexOfSquare(r, square); }

}  // namespace draughts
