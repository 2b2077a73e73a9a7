#include "draughts/notation.h"

#include <algorithm>
#include <charconv>
#include <utility>

namespace draughts {
namespace {

std::string quoted(std::string_view text) {
    std::string out = "\"";
    for (char c : text.substr(0, 40)) out += c >= ' ' && c < 127 ? c : '?';
    return out + (text.size() > 40 ? "...\"" : "\"");
}
const char* sideName(Side s) { return s == Side::white ? "White" : "Black"; }

struct Reader {
    std::string_view text;
    std::size_t at = 0;
    const char* symbol;

    [[noreturn]] void fail(const std::string& expected) const {
        std::string_view rest = text.substr(std::min(at, text.size()));
        throw Bad(symbol, "expected " + expected + ", got " + (rest.empty() ? "the end" : quoted(rest)) + " at character " +
                              std::to_string(at + 1) + " of " + quoted(text));
    }
    void blanks() {
        while (at < text.size() && (text[at] == ' ' || text[at] == '\t' || text[at] == '\n' || text[at] == '\r')) ++at;
    }
    char peek() {
        blanks();
        return at < text.size() ? text[at] : '\0';
    }
    bool take(char c) {
        if (peek() != c) return false;
        ++at;
        return true;
    }
    int square(const Rules& rules) {
        blanks();
        std::size_t end = at;
        while (end < text.size() && ((text[end] >= '0' && text[end] <= '9') || (text[end] >= 'a' && text[end] <= 'j'))) ++end;
        int s = parseSquare(rules, text.substr(at, end - at));
        if (!s) fail("a playing square 1 to " + std::to_string(rules.squares()));
        at = end;
        return s;
    }
};

}  // namespace

std::string squareName(const Rules& rules, int square) {
    int r = (square - 1) / rules.half(), i = (square - 1) % rules.half();
    return std::string(1, char('a' + 2 * i + (r % 2 == 0 ? 1 : 0))) + std::to_string(rules.width - r);
}

int parseSquare(const Rules& rules, std::string_view text) {
    if (text.empty() || text.size() > 3) return 0;
    bool letter = text[0] >= 'a' && text[0] <= 'j';
    int n = 0;
    auto digits = text.substr(letter);
    auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), n);
    if (error != std::errc() || end != digits.data() + digits.size() || digits[0] == '-') return 0;
    if (!letter) return n >= 1 && n <= rules.squares() ? n : 0;
    int column = text[0] - 'a', row = rules.width - n;
    if (column >= rules.width || n < 1 || row < 0 || (column + row) % 2 == 0) return 0;
    return row * rules.half() + column / 2 + 1;
}

std::string toFen(const Rules& rules, const Position& p) {
    std::string out = p.side == Side::white ? "W" : "B";
    for (Side side : {Side::white, Side::black}) {
        out += side == Side::white ? ":W" : ":B";
        bool more = false;
        for (Bits b = side == Side::white ? p.white : p.black; b; b &= b - 1) {
            if (std::exchange(more, true)) out += ',';
            if (p.kings & lowest(b)) out += 'K';
            out += std::to_string(squareOf(rules, indexOf(b)));
        }
    }
    return out;
}

Position parseFen(const Rules& rules, std::string_view text) {
    Reader in{text, 0, "FEN"};
    Position p;
    auto side = [&] {
        if (in.take('W')) return Side::white;
        if (in.take('B')) return Side::black;
        in.fail("W or B");
    };
    p.side = side();
    bool seen[2] = {};
    for (int i = 0; i < 2; ++i) {
        if (!in.take(':')) in.fail("a colon and the squares of a colour");
        Side s = side();
        if (std::exchange(seen[int(s)], true)) in.fail("the other colour");
        Bits& own = s == Side::white ? p.white : p.black;
        char next = in.peek();
        if (next == ':' || next == '\0' || next == '.') continue;
        do {
            bool king = in.take('K');
            int first = in.square(rules), last = in.take('-') ? in.square(rules) : first;
            if (last < first) in.fail("a range from a lower to a higher square");
            for (int q = first; q <= last; ++q) {
                Bits b = bitOf(rules, q);
                if (p.occupied() & b) throw Bad("FEN", "square " + std::to_string(q) + " is occupied twice in " + quoted(text));
                own |= b;
                if (king) p.kings |= b;
            }
        } while (in.take(','));
    }
    in.take('.');
    if (in.peek()) in.fail("the end");
    return p;
}

std::string toHub(const Rules& rules, const Position& p) {
    std::string out = p.side == Side::white ? "W" : "B";
    for (int s = 1; s <= rules.squares(); ++s) {
        Bits b = bitOf(rules, s);
        bool king = p.kings & b;
        out += p.white & b ? (king ? 'W' : 'w') : p.black & b ? (king ? 'B' : 'b') : 'e';
    }
    return out;
}

Position parseHub(const Rules& rules, std::string_view text) {
    Position p;
    std::size_t wanted = std::size_t(rules.squares()) + 1;
    if (text.size() != wanted)
        throw Bad("POSITION", "a position of " + std::string(rules.name) + " has " + std::to_string(wanted) + " characters, got " +
                                  std::to_string(text.size()) + " in " + quoted(text));
    if (text[0] != 'W' && text[0] != 'B') throw Bad("POSITION", "a position begins with W or B, the side to move; got " + quoted(text));
    p.side = text[0] == 'W' ? Side::white : Side::black;
    for (int s = 1; s <= rules.squares(); ++s) {
        Bits b = bitOf(rules, s);
        char c = text[std::size_t(s)];
        if (c == 'w' || c == 'W') p.white |= b;
        else if (c == 'b' || c == 'B') p.black |= b;
        else if (c != 'e')
            throw Bad("POSITION", "square " + std::to_string(s) + " of a position must be w, b, W, B, or e; got " + quoted({&c, 1}));
        if (c == 'W' || c == 'B') p.kings |= b;
    }
    return p;
}

std::string toPicture(const Rules& rules, const Position& p) {
    std::string out, hub = toHub(rules, p);
    for (int row = 0; row < rules.width; ++row) {
        out += (rules.width - row < 10 ? " " : "") + std::to_string(rules.width - row) + " ";
        for (int column = 0; column < rules.width; ++column) {
            bool dark = (column + row) % 2;
            char c = dark ? hub[std::size_t(row * rules.half() + column / 2 + 1)] : ' ';
            out += ' ';
            out += c == 'e' ? '.' : c;
        }
        out += '\n';
    }
    out += "   ";
    for (int column = 0; column < rules.width; ++column) out += std::string(" ") + char('a' + column);
    return out;
}

std::string hubMove(const Rules& rules, const Move& m) {
    std::string out = std::to_string(squareOf(rules, m.from)) + (m.captured ? "x" : "-") + std::to_string(squareOf(rules, m.to));
    for (Bits b = m.captured; b; b &= b - 1) out += "x" + std::to_string(squareOf(rules, indexOf(b)));
    return out;
}

std::string pdnMove(const Rules& rules, const Position& p, const Move& m, bool algebraic) {
    MoveList list;
    generate(rules, p, list);
    int same = 0;
    for (auto& o : list) same += o.from == m.from && o.to == m.to;
    std::vector<int> squares{squareOf(rules, m.from), squareOf(rules, m.to)};
    if (same > 1) squares = routeOf(rules, p, m).squares;
    // Two sets of victims on the same squares do not exist: between two stops there is one victim.
    std::string out;
    for (int s : squares) {
        if (!out.empty()) out += m.captured ? "x" : "-";
        out += algebraic ? squareName(rules, s) : std::to_string(s);
    }
    return out;
}

std::string whyNot(const Rules& rules, const Position& p, int from, int to) {
    auto name = [&](int s) { return std::to_string(s) + " (" + squareName(rules, s) + ")"; };
    Bits f = bitOf(rules, from), t = bitOf(rules, to);
    if (p.opponent() & f) return "the piece on " + name(from) + " is not of " + sideName(p.side) + ", who is to move";
    if (!(p.own() & f)) return "there is no piece on " + name(from);
    if (from != to && p.occupied() & t) return "square " + name(to) + " is occupied";
    MoveList list;
    generate(rules, p, list);
    if (!list.size()) return std::string(sideName(p.side)) + " has no legal move: the game is over";
    bool king = p.kings & f;
    std::string piece = std::string(king ? "the king on " : "the man on ") + name(from);
    int row = (from - 1) / rules.half(), target = (to - 1) / rules.half();
    bool forward = p.side == Side::white ? target < row : target > row;
    auto pieces = [](int n) { return std::to_string(n) + (n == 1 ? " piece" : " pieces"); };
    if (list[0].captured) {
        bool others = std::none_of(list.begin(), list.end(), [&](auto& m) { return squareOf(rules, m.from) == from; });
        std::string could = "for example " + pdnMove(rules, p, list[0]);
        // What could the piece do without the rules about captures?
        if (others && rules.majority)
            return piece + " may not move: capturing the greatest number is compulsory, " + pieces(countOf(list[0].captured)) + ", " + could;
        if (others) return piece + " may not move: another piece can capture, and must, " + could;
        return piece + " must capture " + (rules.majority ? "the greatest number, " + pieces(countOf(list[0].captured)) + ", " : "") + could +
               "; it cannot do so by going to " + name(to);
    }
    int rows = std::abs(target - row);
    auto column = [&](int s) { return 2 * ((s - 1) % rules.half()) + ((s - 1) / rules.half() % 2 == 0 ? 1 : 0); };
    int columns = std::abs(column(to) - column(from));
    if (rows != columns || rows == 0) return piece + " cannot reach " + name(to) + ": pieces move along diagonals";
    if (!king && !forward) return piece + " cannot move backwards: men move forward only";
    if (rows > 1 && (!king || !rules.flying))
        return piece + " cannot go " + std::to_string(rows) + " squares: there is nothing to capture, and " + (king ? "a king" : "a man") +
               " moves one square";
    return piece + " cannot reach " + name(to) + ": a piece stands between";
}

Move parseMove(const Rules& rules, const Position& p, std::string_view text) {
    std::vector<int> squares;
    bool capture = false;
    std::size_t at = 0;
    for (;;) {
        std::size_t end = std::min(text.find_first_of("-x:", at), text.size());
        int s = parseSquare(rules, text.substr(at, end - at));
        if (!s || squares.size() > 60)
            throw Bad("MOVE", "expected a move such as 32-28, 28x19 or c3-d4 on squares 1 to " + std::to_string(rules.squares()) + ", got " +
                                  quoted(text));
        squares.push_back(s);
        if (end == text.size()) break;
        capture = capture || text[end] != '-';
        at = end + 1;
    }
    if (squares.size() < 2)
        throw Bad("MOVE", "expected a move such as 32-28, 28x19 or c3-d4, with origin and target, got " + quoted(text));

    // origin, target, then victims (Hub); or origin, stops, target (books).
    MoveList list;
    generate(rules, p, list);
    std::vector<Move> fits;
    auto from = [&](const Move& m) { return squareOf(rules, m.from) == squares[0]; };
    for (auto& m : list) {
        if (!from(m) || (!m.captured && squares.size() > 2)) continue;
        Bits rest = 0;
        for (std::size_t i = 2; i < squares.size(); ++i) rest |= bitOf(rules, squares[i]);
        bool exact = squareOf(rules, m.to) == squares[1] && (squares.size() == 2 || rest == m.captured);
        bool victims = squares.size() > 2 && squareOf(rules, m.to) == squares.back();
        if (victims && !exact) {
            // Stops on the way: there must be a path through them, in this order; victims among them are as good.
            MoveRoute path = routeOf(rules, p, m);
            Bits between = 0, passed = m.captured;
            for (std::size_t i = 1; i + 1 < squares.size(); ++i) between |= bitOf(rules, squares[i]);
            for (int s : path.squares) passed |= bitOf(rules, s);
            victims = (between & ~passed) == 0;
        }
        if (exact || victims) fits.push_back(m);
    }
    if (fits.size() > 1)
        // The whole set of victims said, or the whole path, decides.
        for (auto& m : fits) {
            MoveRoute path = routeOf(rules, p, m);
            Bits rest = 0;
            for (std::size_t i = 2; i < squares.size(); ++i) rest |= bitOf(rules, squares[i]);
            if (path.squares == squares || (squareOf(rules, m.to) == squares[1] && rest == m.captured)) return m;
        }
    if (fits.size() > 1) {
        std::string which;
        for (auto& m : fits) which += (which.empty() ? "" : ", ") + hubMove(rules, m);
        throw Bad("AMBIGUOUS", "move " + quoted(text) + " may be any of " + which);
    }
    if (fits.empty()) {
        int to = capture && squares.size() > 2 ? squares.back() : squares[1];
        throw Bad("MOVE", "move " + quoted(text) + " is not legal: " + whyNot(rules, p, squares[0], to));
    }
    return fits[0];
}

}  // namespace draughts
