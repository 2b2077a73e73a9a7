// camera.h -- finds the legal move that explains what a camera has seen on the board.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "draughts/notation.h"

namespace draughts {

struct Sight {
    std::vector<Move> moves;        // that fit; one: it is that
    bool unchanged = false;         // what is seen fits the present position
    std::string wrong;              // when none fits: which piece, which rule
};

// seen: width x width characters, the farthest row (Black's) first, from the left as White sees it: the two colours' characters, a
// dot for nothing, ? for not known. A camera tells no king from a man. Fails with SIGHT when it is no such text.
Sight explain(const Rules& rules, const Position& p, std::string_view seen, char white, char black);

}  // namespace draughts
