// endgames.h -- tables for 8x8 with up to four pieces: won, drawn or lost, and the number of moves.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "draughts/position.h"

namespace draughts {

struct Outcome {
    int value = 0;      // of the side to move: 1 won, 0 drawn, -1 lost
    int distance = 0;   // moves of both sides until the loser has none, both playing their best
};

class Endgames {
public:
    static constexpr int kPieces = 4;

    // Computes all tables. progress: called with the part that is done, 0 .. 1; returns false to cancel: then the result is
    // null.
    static std::unique_ptr<Endgames> compute(const Rules& rules, const std::function<bool(double)>& progress, int pieces = kPieces);
    // Reads them from a file, and checks it. Null: why says what is wrong with it.
    static std::unique_ptr<Endgames> load(const Rules& rules, const std::string& file, std::string& why);
    // Writes them, first under another name. False: why.
    bool save(const std::string& file, std::string& why) const;
    // Where they are kept: $XDG_CACHE_HOME/sorma or ~/.cache/sorma, draughts-GAME.egt.
    static std::string defaultFile(const Rules& rules);

    // Get the tables: from this process, else from the file, else compute and save them. They are valid in any case; the note says
    // what was wrong with the file, if it exists, or with saving it. Null: progress returned false. Any thread; a second
    // one waits.
    static std::shared_ptr<const Endgames> provide(const Rules& rules, const std::string& file,
                                                   const std::function<bool(double)>& progress, std::string& note);

    // False: the tables do not hold it: too many pieces, or a side has none.
    bool find(const Position& p, Outcome& out) const;

    // Every placement of a slice, one after another. counts: men and kings of White, of Black.
    static void eachPosition(const Rules& rules, const int (&counts)[4], Side side, const std::function<void(const Position&)>& visit);

private:
    struct Slice {
        int counts[4];
        std::vector<std::uint8_t> values;   // 0 drawn; n: decided in n - 1 moves, odd n lost, even n won. White to move.
    };
    explicit Endgames(const Rules& rules);
    std::uint64_t indexOf(const Position& p, int& slice) const;
    class Builder;

    const Rules& rules_;
    int pieces_ = kPieces;
    std::vector<Slice> slices_;
    int number_[5][5][5][5];                // of a slice, by its counts; -1
};

}  // namespace draughts
