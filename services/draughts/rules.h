// rules.h -- the rules of the three games as data. No other code depends on the name of a game.
//
// Source: FMJD annex 1 (international, 64), WCDF (English).
#pragma once

#include <cstdint>
#include <string_view>

namespace draughts {

enum class Side : std::uint8_t { white, black };
constexpr Side other(Side s) { return s == Side::white ? Side::black : Side::white; }

// Moves of each side until a game is drawn; 0: the rule does not exist. See game.h.
struct DrawLimits {
    int kingMoves;          // only kings move, nothing is captured
    int oneAgainstThree;    // one king against three pieces, at least one of them a king
    int threeAreKings;      // 1: all three of them
    int longDiagonal;       // the same, the lone king on the long diagonal
    int oneAgainstTwo;      // one king against one or two pieces, at least one of them a king
    int twoAgainstTwo;      // two kings against two kings, or against a king and a man
};

struct Rules {
    int width;              // of the board: 8 or 10
    bool flying;            // kings go and capture over any distance
    bool menCaptureBack;
    bool majority;          // the largest capture is compulsory
    bool crowningEnds;      // a man that captures into the last row is crowned and stops; else it goes on as a man
    bool blackBegins;
    int menRows;            // rows of men of each side at the beginning
    DrawLimits draws;
    int gameType;           // of PDN
    char name[5];           // "intl"
    char pdn[20];           // value of the PDN tag GameType
    char book[28];          // whose draw rules these are

    constexpr int half() const { return width / 2; }
    constexpr int squares() const { return width * half(); }
};

inline constexpr Rules kIntl{10, true, true, true, false, false, 4, {25, 16, 0, 0, 5, 0}, 20, "intl", "20,W,10,10,N2,0", "FMJD"};
inline constexpr Rules kBraz{8, true, true, true, false, false, 3, {20, 15, 1, 5, 5, 5}, 26, "braz", "26,W,8,8,A0,0",
                             "Brazilian federation"};
inline constexpr Rules kEngl{8, false, false, false, true, true, 3, {40, 0, 0, 0, 0, 0}, 21, "engl", "21,B,8,8,N1,0", "WCDF"};
inline constexpr const Rules* kGames[] = {&kIntl, &kBraz, &kEngl};

// Null: there is no such game.
constexpr const Rules* findGame(std::string_view name) {
    for (auto* g : kGames)
        if (name == g->name) return g;
    return nullptr;
}

// Call a function template for the game that the rules are: work(TheGame<R>()).
template <const Rules& R> struct TheGame {
    static constexpr const Rules& rules = R;
};
template <class F> decltype(auto) forGame(const Rules& rules, F&& work) {
    if (&rules == &kIntl) return work(TheGame<kIntl>());
    if (&rules == &kBraz) return work(TheGame<kBraz>());
    return work(TheGame<kEngl>());
}

}  // namespace draughts
