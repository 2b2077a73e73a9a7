// evaluate.h -- how good is a quiet position?
//
// A sum of learned weights, each in two phases between which the number of pieces decides: material and a few counts; and patterns:
// each of 16 (9 on 8x8) overlapping fields of 2 x 4 squares looks its men up in a table, 0 nobody, 1 black, 2 white in each square.
// What is good for White in a field is bad for Black in the field turned by 180 degrees, so half of the tables are stored.
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
enum Count : int { men, kings, firstKing, advance, centre, longDiagonal, turn, kCounts };

template <const Rules& R> struct Fields {
    static constexpr int groups = R.half() - 1, bands = R.half() - 1, count = groups * bands;
    static constexpr int stored = (count + 1) / 2;
};

struct Features {
    std::array<int, kCounts> counts;
    std::array<std::uint16_t, 16> fields;   // index into each field's table
    int pieces;
};
template <const Rules& R> Features featuresOf(const Position& p);

// Field f, index i, seen from the other side: field count - 1 - f, this index.
int turnedIndex(int index);

struct Weights {
    std::array<std::array<float, 2>, kCounts> counts;           // with many pieces, with few
    // count * kFieldSize: with many pieces, plus 65536 times with few, so that one addition adds both.
    std::vector<std::int32_t> fields;
};
// As they come with the program; made on first use. plain: material and advance alone, the yardstick of doc/draughts.man.
const Weights& weightsOf(const Rules& rules, bool plain = false);

// From the view of the side to move.
template <const Rules& R> int evaluate(const Weights& w, const Position& p);

}  // namespace draughts
