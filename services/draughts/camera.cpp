#include "draughts/camera.h"

namespace draughts {
namespace {

struct Seen {
    Bits white = 0, black = 0, unknown = 0;
    bool fits(const Position& p) const {
        return ((p.white ^ white) & ~unknown) == 0 && ((p.black ^ black) & ~unknown) == 0;
    }
};

// The dark squares of a picture.   strays: gets the light ones on which pieces stand.
Seen readBoard(const Rules& rules, std::string_view text, char white, char black, std::string& strays) {
    std::string board;
    for (char c : text)
        if (c != '\n' && c != ' ') board += c;
    std::size_t wanted = std::size_t(rules.width * rules.width);
    if (board.size() != wanted)
        throw Bad("SIGHT", "expected " + std::to_string(wanted) + " characters, row by row from Black's side, got " + std::to_string(board.size()));
    Seen seen;
    for (int row = 0; row < rules.width; ++row)
        for (int column = 0; column < rules.width; ++column) {
            char c = board[std::size_t(row * rules.width + column)];
            std::string at = std::string(1, char('a' + column)) + std::to_string(rules.width - row);
            if (c != white && c != black && c != '.' && c != '?')
                throw Bad("SIGHT", "square " + at + ": must be " + white + ", " + black + ", . or ?, got \"" + (c > ' ' && c < 127 ? c : '?') + "\"");
            if ((column + row) % 2 == 0) {
                if (c == white || c == black) strays += (strays.empty() ? "" : ", ") + at;
                continue;
            }
            Bits b = bitOf(rules, row * rules.half() + column / 2 + 1);
            if (c == white) seen.white |= b;
            else if (c == black) seen.black |= b;
            else if (c == '?') seen.unknown |= b;
        }
    return seen;
}

// Why no legal move leads from a position to what is seen.   list: the legal moves.
std::string whyNoMove(const Rules& rules, const Position& p, const Seen& seen, const MoveList& list) {
    auto name = [&](int s) { return squareName(rules, s) + " (" + std::to_string(s) + ")"; };
    // The squares that have changed, for each colour.
    std::vector<int> left, come, taken, others;
    for (int s = 1; s <= rules.squares(); ++s) {
        Bits b = bitOf(rules, s);
        if (seen.unknown & b) continue;
        bool white = p.side == Side::white;
        bool own = p.own() & b, nowOwn = (white ? seen.white : seen.black) & b;
        bool prey = p.opponent() & b, nowPrey = (white ? seen.black : seen.white) & b;
        if (own && !nowOwn) left.push_back(s);
        if (!own && nowOwn) come.push_back(s);
        if (prey && !nowPrey) taken.push_back(s);
        if (!prey && nowPrey) others.push_back(s);
    }
    const char* opponent = p.side == Side::white ? "Black" : "White";
    auto names = [&](const std::vector<int>& squares) {
        std::string all;
        for (int s : squares) all += (all.empty() ? "" : ", ") + name(s);
        return all;
    };
    if (!others.empty()) return std::string("a piece of ") + opponent + " has come to " + names(others) + ", but " + opponent + " is not to move";
    if (left.size() > 1) return "more than one piece has left its place: " + names(left);
    if (come.size() > 1) return "more pieces have come than one: to " + names(come);
    if (left.size() == 1 && come.empty()) {
        Bits from = bitOf(rules, left[0]);
        // A king may end its capture where it began, and then it has not left.
        return (p.kings & from ? "the king on " : "the man on ") + name(left[0]) + " has gone, and stands nowhere else";
    }
    if (left.empty() && come.size() == 1) return "a piece too many has come to " + name(come[0]);
    if (left.empty()) return std::string("pieces of ") + opponent + " have gone from " + names(taken) + ", but no piece has captured them";
    // One piece has moved: with the right victims the move would be legal, or there is a reason why not.
    const Move* same = nullptr;
    for (auto& m : list)
        if (squareOf(rules, m.from) == left[0] && squareOf(rules, m.to) == come[0]) same = &m;
    if (!same) return whyNot(rules, p, left[0], come[0]);
    std::vector<int> still, much;
    for (int s = 1; s <= rules.squares(); ++s) {
        Bits b = bitOf(rules, s);
        bool gone = false;
        for (int t : taken) gone = gone || t == s;
        if ((same->captured & b) && !gone && !(seen.unknown & b)) still.push_back(s);
        if (!(same->captured & b) && gone) much.push_back(s);
    }
    if (!still.empty()) return "move " + pdnMove(rules, p, *same) + " captures " + names(still) + ", which still stands there";
    return "move " + pdnMove(rules, p, *same) + " does not capture " + names(much) + ", which has gone";
}

}  // namespace

Sight explain(const Rules& rules, const Position& p, std::string_view text, char white, char black) {
    std::string strays;
    const Seen seen = readBoard(rules, text, white, black, strays);
    Sight out;
    if (!strays.empty()) {
        out.wrong = "a piece stands on " + strays + ", where no piece may stand: only the dark squares are played on";
        return out;
    }
    out.unchanged = seen.fits(p);
    MoveList list;
    generate(rules, p, list);
    for (auto& m : list)
        if (seen.fits(after(rules, p, m))) out.moves.push_back(m);
    if (out.moves.empty() && !out.unchanged) out.wrong = whyNoMove(rules, p, seen, list);
    return out;
}

}  // namespace draughts
