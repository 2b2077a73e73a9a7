// notation.h -- positions and moves as text: FEN and PDN of all three games, and the form of the Hub protocol.
//
// The input is checked. An error tells the expected text, the text that came, and the place.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "draughts/moves.h"

namespace draughts {

// symbol: for programs, "FEN", "MOVE", "PDN", "POSITION".
struct Bad : std::runtime_error {
    Bad(std::string symbol, const std::string& text) : std::runtime_error(text), symbol(std::move(symbol)) {}
    std::string symbol;
};

// "W:W31,K32:B1,2": side to move, then each colour's squares. Ranges (31-50), algebraic squares (c3), either order of colours,
// spaces and a final dot are understood. Fails with FEN.
std::string toFen(const Rules& rules, const Position& p);
Position parseFen(const Rules& rules, std::string_view text);

// "Wbbbeew...": side, then a character for each square, w b W B e. Fails with POSITION.
std::string toHub(const Rules& rules, const Position& p);
Position parseHub(const Rules& rules, std::string_view text);

// A picture of n x n characters, White at the bottom, for people: . w b W B, and blanks for light squares.
std::string toPicture(const Rules& rules, const Position& p);

std::string squareName(const Rules& rules, int square);                 // 1 -> "b8"
int parseSquare(const Rules& rules, std::string_view text);             // "b8" or "1"; 0: it is none

std::string hubMove(const Rules& rules, const Move& m);                 // 32-28, 28x19x23: from, to, victims in rising order
// 32-28, 28x19; with all squares on the way when that is not enough. algebraic: c3-d4.
std::string pdnMove(const Rules& rules, const Position& p, const Move& m, bool algebraic = false);
// Any of these, also with ':' for a capture. Between origin and target may stand victims, or squares on the way.
// Fails with MOVE: no legal move, and why not; or more than one.
Move parseMove(const Rules& rules, const Position& p, std::string_view text);

// A sentence that says why the side to move cannot make that move; it names the piece and the rule.
std::string whyNot(const Rules& rules, const Position& p, int from, int to);

}  // namespace draughts
