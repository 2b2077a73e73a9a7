// game.h -- a game as it is played: positions, moves, the rules by which it is drawn, and its record as PDN.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "draughts/notation.h"

namespace draughts {

// The counters, see rules.h. In moves of both sides.
struct Status {
    bool over = false;
    std::string result = "*";           // 1-0, 0-1, 1/2-1/2
    std::string reason;                 // for people, when it is over
    int repeated = 1;                   // how often the present position has been there with the same side to move
    int kingMoves = 0, kingMovesLimit = 0;
    int small = 0, smallLimit = 0;      // since few pieces are left; limit 0: the rule does not apply
};

class Game {
public:
    explicit Game(const Rules& rules) : Game(rules, startPosition(rules)) {}
    Game(const Rules& rules, const Position& start) : rules_(&rules), positions_{start} {}

    const Rules& rules() const { return *rules_; }
    const Position& position() const { return positions_.back(); }
    const Position& positionAt(std::size_t ply) const { return positions_[ply]; }
    const std::vector<Move>& moves() const { return moves_; }

    // m must be legal. Nothing prevents to play on after a draw.
    void play(const Move& m);
    bool undo();                        // false: no move has been played
    Status status() const;
    // For a search: all positions since the last capture or move of a man, the present one last.
    std::vector<Position> reversible() const;

    // PDN tags besides Result, GameType, SetUp and FEN, which follow from the game.
    std::map<std::string, std::string> tags;
    std::string result = "*";           // as agreed; a result on the board comes first
    std::string toPdn() const;
    // The first game of the text. Comments, variations and annotations are skipped. Fails with PDN: where, and what is wrong.
    // GameType may be missing: then it is of these rules; one of another game is refused.
    static Game fromPdn(const Rules& rules, std::string_view text);

private:
    const Rules* rules_;
    std::vector<Position> positions_;   // one more than moves
    std::vector<Move> moves_;
};

}  // namespace draughts
