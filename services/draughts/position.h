// position.h -- a position: the pieces, and the side to move. A value of 32 bytes: it is copied, and moves are never undone
// in it.
#pragma once

#include "draughts/board.h"

namespace draughts {

// One move: two with equal origin, target and victims are one, whatever the order of the victims.
struct Move {
    Bits captured = 0;
    std::uint8_t from = 0, to = 0;      // indices, see board.h
    bool operator==(const Move&) const = default;
    bool isNone() const { return from == to && !captured; }
};

struct Position {
    // Invariant: white and black are disjoint squares of the board, and kings are among them. No man stands on his crowning row,
    // unless a position like that was set up by hand.
    Bits white = 0, black = 0, kings = 0;
    Side side = Side::white;

    bool operator==(const Position&) const = default;
    Bits own() const { return side == Side::white ? white : black; }
    Bits opponent() const { return side == Side::white ? black : white; }
    Bits occupied() const { return white | black; }

    // Mixes all that counts; two positions of one game collide as two random numbers would.
    std::uint64_t key() const {
        std::uint64_t k = (white ^ 0x9e3779b97f4a7c15u) * 0xbf58476d1ce4e5b9u;
        std::uint64_t j = (black ^ 0xc2b2ae3d27d4eb4fu) * 0x94d049bb133111ebu;
        k ^= (k >> 29) ^ std::rotl(j, 31) ^ (kings * 0xd6e8feb86659fd93u) ^ (side == Side::white ? 0 : 0x5851f42d4c957f2du);
        k = (k ^ (k >> 32)) * 0xff51afd7ed558ccdu;
        return k ^ (k >> 29) ^ (j >> 32);
    }
};

template <const Rules& R> inline Position after(const Position& p, const Move& m) {
    using B = Board<R.width>;
    Bits from = Bits(1) << m.from, to = Bits(1) << m.to, gone = from | m.captured;
    bool king = p.kings & from;
    Position n;
    n.kings = p.kings & ~gone;
    n.white = p.white & ~gone;
    n.black = p.black & ~gone;
    (p.side == Side::white ? n.white : n.black) |= to;
    if (king || (to & B::crowning(p.side))) n.kings |= to;
    n.side = other(p.side);
    return n;
}

// The same position with colours and sides of the board exchanged.
template <const Rules& R> inline Position turned(const Position& p) {
    using B = Board<R.width>;
    return {B::turned(p.black), B::turned(p.white), B::turned(p.kings), other(p.side)};
}

Position startPosition(const Rules& rules);
Position after(const Rules& rules, const Position& p, const Move& m);

}  // namespace draughts
