// moves.h -- the legal moves of a position, exactly; how a piece travels; perft.
#pragma once

#include <cstdlib>
#include <cstring>
#include <new>
#include <vector>

#include "draughts/position.h"

namespace draughts {

// Grows onto the heap only for positions that no game has: kings by the dozen.
class MoveList {
public:
    MoveList() = default;
    MoveList(const MoveList&) = delete;
    MoveList& operator=(const MoveList&) = delete;
    ~MoveList() {
        if (!isHere()) std::free(data_);
    }
    void push(const Move& m) {
        if (size_ == room_) [[unlikely]] grow();
        data_[size_++] = m;
    }
    void clear() { size_ = 0; }
    int size() const { return size_; }
    Move& operator[](int i) { return data_[i]; }
    const Move& operator[](int i) const { return data_[i]; }
    Move* begin() { return data_; }
    Move* end() { return data_ + size_; }
    const Move* begin() const { return data_; }
    const Move* end() const { return data_ + size_; }
    bool has(const Move& m) const {
        for (auto& o : *this)
            if (o == m) return true;
        return false;
    }

private:
    static constexpr int kHere = 96;
    bool isHere() const { return static_cast<const void*>(data_) == here_; }
    void grow() {
        Move* more = static_cast<Move*>(std::malloc(sizeof(Move) * std::size_t(room_) * 2));
        if (!more) throw std::bad_alloc();
        std::memcpy(static_cast<void*>(more), data_, sizeof(Move) * std::size_t(size_));
        if (!isHere()) std::free(data_);
        data_ = more;
        room_ *= 2;
    }
    int size_ = 0, room_ = kHere;
    Move* data_ = reinterpret_cast<Move*>(here_);
    alignas(Move) unsigned char here_[kHere * sizeof(Move)];     // not zeroed: that would cost more than the moves
};

// All legal moves, each once. Captures are all or nothing: when there is one, the list holds captures alone.
template <const Rules& R> void generate(const Position& p, MoveList& out);
// Can the side to move capture? Costs a tenth of generate.
template <const Rules& R> bool canCapture(const Position& p);
// The same if it were that side's turn.
template <const Rules& R> bool canCapture(const Position& p, Side side);
// Number of legal moves.
template <const Rules& R> int countMoves(const Position& p);

void generate(const Rules& rules, const Position& p, MoveList& out);
bool canCapture(const Rules& rules, const Position& p);

// One way to make the move: the squares on which the piece stops, origin and target included, and the victims in the order in
// which it passes them. An arm follows the squares, then clears the victims, then crowns.
struct MoveRoute {
    std::vector<int> squares, victims;      // numbers of squares, 1 ..
};
// Empty squares: the move is not legal in this position.
MoveRoute routeOf(const Rules& rules, const Position& p, const Move& m);

// Number of move sequences of that length; the last move is counted, not made. No draw rule ends a line.
std::uint64_t perft(const Rules& rules, const Position& p, int depth);

}  // namespace draughts
