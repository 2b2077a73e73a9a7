#include "draughts/evaluate.h"

#include <cmath>

namespace draughts {
namespace {

// Two rows of the board as bits -> for each group of two columns the ternary number of its four squares, 16 bits each.
template <int Width> struct Codes {
    static constexpr int half = Width / 2, groups = half - 1;
    static constexpr std::array<std::uint64_t, (1 << Width)> make() {
        std::array<std::uint64_t, (1 << Width)> out{};
        for (int bits = 0; bits < 1 << Width; ++bits)
            for (int g = 0; g < groups; ++g) {
                int n = 0;
                for (int row = 0; row < 2; ++row)
                    for (int c = g; c < g + 2; ++c) n = n * 3 + (bits >> (row * half + c) & 1);
                out[bits] |= std::uint64_t(n) << (16 * g);
            }
        return out;
    }
    static constexpr std::array<std::uint64_t, (1 << Width)> table = make();
};

// Two rows of the board as bits -> how many squares, and, times 16, how many of them in the lower row.
template <int Width> struct Heads {
    static constexpr std::array<std::uint8_t, (1 << Width)> make() {
        std::array<std::uint8_t, (1 << Width)> out{};
        for (unsigned bits = 0; bits < 1u << Width; ++bits)
            out[bits] = std::uint8_t(std::popcount(bits) | std::popcount(bits >> (Width / 2)) << 4);
        return out;
    }
    static constexpr std::array<std::uint8_t, (1 << Width)> table = make();
};

// take(field, index), in the order of the fields.
template <const Rules& R, class F> inline void eachField(const Position& p, F&& take) {
    using L = Fields<R>;
    constexpr Bits kPair = (Bits(1) << R.width) - 1;
    Bits white = p.white & ~p.kings, black = p.black & ~p.kings;
    std::array<std::uint64_t, R.half()> codes;
    for (int pair = 0; pair < R.half(); ++pair) {
        int shift = pair * (R.width + 1);
        codes[pair] = Codes<R.width>::table[white >> shift & kPair] * 2 + Codes<R.width>::table[black >> shift & kPair];
    }
    int f = 0;
    for (int b = 0; b < L::bands; ++b) {
        std::uint64_t index = codes[b] * 81 + codes[b + 1];
        for (int g = 0; g < L::groups; ++g) take(f++, index >> (16 * g) & 0xffff);
    }
    for (int r = 0; r < L::rows; ++r) take(f++, (codes[r] & 0xffff) * 81 + (codes[r] >> 32 & 0xffff));
}

template <const Rules& R> struct Sets {
    using B = Board<R.width>;
    static constexpr Bits makeCentre() {
        Bits b = 0;
        for (int r = R.width / 2 - 2; r < R.width / 2 + 2; ++r)
            for (int i = 1; i < R.half() - 1; ++i) b |= B::bit(r * R.half() + i + 1);
        return b;
    }
    static constexpr Bits makeDiagonal() {
        Bits b = B::bit(R.squares() - R.half() + 1);
        for (Bits s = b; s; s = B::template step<upRight>(s) & B::all) b |= s;
        return b;
    }
    static constexpr Bits makeEven() {
        Bits b = 0;
        for (int r = 0; r < R.width; r += 2) b |= B::row(r);
        return b;
    }
    static constexpr Bits centre = makeCentre(), diagonal = makeDiagonal(), even = makeEven();
};

template <const Rules& R> inline void count(const Position& p, std::array<int, kCounts>& c) {
    Bits wm = p.white & ~p.kings, bm = p.black & ~p.kings, wk = p.white & p.kings, bk = p.black & p.kings;
    int rows = 0, count = 0;
    for (int pair = 0; pair < R.half(); ++pair) {
        constexpr Bits kPair = (Bits(1) << R.width) - 1;
        int w = Heads<R.width>::table[wm >> (pair * (R.width + 1)) & kPair], b = Heads<R.width>::table[bm >> (pair * (R.width + 1)) & kPair];
        count += (w & 15) - (b & 15);
        rows += (R.width - 1 - 2 * pair) * (w & 15) - (w >> 4) - 2 * pair * (b & 15) - (b >> 4);
    }
    c[men] = count;
    c[advance] = rows;
    c[centre] = countOf(wm & Sets<R>::centre) - countOf(bm & Sets<R>::centre);
    c[kings] = c[firstKing] = c[longDiagonal] = 0;
    if (p.kings) {
        c[kings] = countOf(wk) - countOf(bk);
        c[firstKing] = int(wk != 0) - int(bk != 0);
        c[longDiagonal] = int((wk & Sets<R>::diagonal) != 0) - int((bk & Sets<R>::diagonal) != 0);
    }
    c[turn] = p.side == Side::white ? 1 : -1;
    // Who is to move when all have met decides who must give way: the parity of the pieces on every other row tells.
    c[opposition] = countOf(p.white) != countOf(p.black) ? 0 : countOf(p.occupied() & Sets<R>::even) & 1 ? c[turn] : -c[turn];
}

}  // namespace

template <const Rules& R> Features featuresOf(const Position& p) {
    Features f{};
    count<R>(p, f.counts);
    f.pieces = countOf(p.occupied());
    eachField<R>(p, [&](int field, std::uint64_t index) { f.fields[field] = std::uint16_t(index); });
    return f;
}

int turnedIndex(int index) {
    int out = 0;
    for (int k = 0; k < 8; ++k) {
        int digit = index % 3;
        out = out * 3 + (digit == 0 ? 0 : 3 - digit);
        index /= 3;
    }
    return out;
}

template <const Rules& R> int evaluate(const Weights& w, const Position& p) {
    std::array<int, kCounts> c;
    count<R>(p, c);
    constexpr int kMost = 2 * R.menRows * R.half();
    int pieces = countOf(p.occupied());
    float few = float(kMost - std::min(pieces, kMost)) / kMost, sum = 0;
    for (int i = 0; i < kCounts; ++i) sum += float(c[i]) * (w.counts[i][0] + (w.counts[i][1] - w.counts[i][0]) * few);
    std::int32_t fields = 0;
    const std::int32_t* table = w.fields.data();
    eachField<R>(p, [&](int field, std::uint64_t index) { fields += table[field * kFieldSize + int(index)]; });
    for (Bits k = p.kings & p.white; k; k &= k - 1) fields += w.kings[indexOf(k)];
    for (Bits k = p.kings & p.black; k; k &= k - 1) fields -= w.kings[Board<R.width>::last - indexOf(k)];
    int many = std::int16_t(fields & 0xffff), last = (fields - many) >> 16;
    int score = int(sum + float(many) + float(last - many) * few);
    // One flying king holds out against three pieces nearly always, two against four.
    if (R.flying && p.kings) {
        Bits weak = score > 0 ? p.black : p.white, strong = score > 0 ? p.white : p.black;
        if ((weak & p.kings) && countOf(strong) <= 2 + countOf(weak & p.kings)) score /= 8;
    }
    return p.side == Side::white ? score : -score;
}

#define DRAUGHTS_GAME(R)                                    \
    template Features featuresOf<R>(const Position&);       \
    template int evaluate<R>(const Weights&, const Position&);
DRAUGHTS_GAME(kIntl)
DRAUGHTS_GAME(kBraz)
DRAUGHTS_GAME(kEngl)

}  // namespace draughts
