// evaluate.h -- the value of a quiet position.
//
// A sum of learned weights, each in two phases between which the number of pieces decides. There are weights for material and a few
// counts, for the square of each king, and for patterns. A pattern is one of 16 (9 on 8x8) overlapping fields of 2 x 4 squares, or on
// 8x8 also one of four pairs of rows. It looks its men up in a table, with 0 nobody, 1 black, 2 white in each square.
// A field that is good for White is bad for Black after a turn by 180 degrees, so half of the tables are stored.
//
// Source: logistic regression on games of the engine with itself, see train/README.md and Buro, ProbCut and evaluation by
// patterns (1995 ff.). Unit: a hundredth of a man.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "draughts/position.h"

namespace draughts {

inline constexpr int kFieldSize = 6561;     // 3^8

// Counts of a position, White's minus Black's; the order is that of the weights file.
enum Count : int { men, kings, firstKing, advance, centre, longDiagonal, turn, opposition, kCounts };

template <const Rules& R> struct Fields {
    static constexpr int groups = R.half() - 1, bands = R.half() - 1, blocks = groups * bands;
    static constexpr int rows = R.width == 8 ? R.half() : 0, count = blocks + rows;
    // Where field f is when the board is turned.
    static constexpr int partner(int f) { return f < blocks ? blocks - 1 - f : 2 * blocks + rows - 1 - f; }
    // Which of the stored tables field f has, for f <= partner(f); and the field that a stored table is for.
    static constexpr int table(int f) { return f < blocks ? f : f - blocks / 2; }
    static constexpr int field(int table) { return table < (blocks + 1) / 2 ? table : table + blocks / 2; }
    static constexpr int stored = (blocks + 1) / 2 + rows / 2;
    static constexpr int weights = stored * kFieldSize + 64;        // of one phase: the tables, then the squares of kings
};

struct Features {
    std::array<int, kCounts> counts;
    std::array<std::uint16_t, 16> fields;   // index into each field's table
    int pieces;
};
template <const Rules& R> Features featuresOf(const Position& p);

// Field f, index i, seen from the other side: field partner(f), this index.
int turnedIndex(int index);

struct Weights {
    std::array<std::array<float, 2>, kCounts> counts;           // with many pieces, with few
    // count * kFieldSize: with many pieces, plus 65536 times with few, so that one addition adds both.
    std::vector<std::int32_t> fields;
    std::array<std::int32_t, 64> kings;                         // in the same way: a white king, by the index of its square
};
// As they come with the program; made on first use. plain: material and advance alone, the yardstick of doc/draughts.man.
const Weights& weightsOf(const Rules& rules, bool plain = false);

// From the view of the side to move.
template <const Rules& R> int evaluate(const Weights& w, const Position& p);

}  // namespace draughts
