#include "draughts/moves.h"

#include <algorithm>

namespace draughts {
namespace {


// The squares next to each other in the direction's sense: is the first one met the lowest bit, or the highest?
template <Direction D> inline Bits nearest(Bits b) {
    return D == downLeft || D == downRight ? lowest(b) : highest(b);
}

// How many in two sets. Native: by the processor's own instruction, in functions that may use it.
template <bool Native> [[gnu::always_inline]] inline int number(Bits a, Bits b) {
    if constexpr (Native) return __builtin_popcountll(a) + __builtin_popcountll(b);
    else return countOf(a, b);
}

// Captures of one position. S: side to move.
template <const Rules& R, Side S> class Captures {
    using B = Board<R.width>;

public:
    Captures(const Position& p, MoveList& out)
        : out_(out), kings_(p.kings), own_(S == Side::white ? p.white : p.black), prey_(S == Side::white ? p.black : p.white),
          empty_(B::all & ~p.white & ~p.black) {}

    static bool any(const Position& p) {
        Bits own = S == Side::white ? p.white : p.black, prey = S == Side::white ? p.black : p.white;
        Bits empty = B::all & ~own & ~prey;
        Bits jumpers = R.menCaptureBack ? own : 0;
        if constexpr (!R.flying) jumpers = R.menCaptureBack ? own : own & p.kings;
        Bits forward = own;
        Bits found = 0;
        if constexpr (S == Side::white) {
            found = jump<upLeft>(forward, prey, empty) | jump<upRight>(forward, prey, empty);
            found |= jump<downLeft>(jumpers, prey, empty) | jump<downRight>(jumpers, prey, empty);
        } else {
            found = jump<downLeft>(forward, prey, empty) | jump<downRight>(forward, prey, empty);
            found |= jump<upLeft>(jumpers, prey, empty) | jump<upRight>(jumpers, prey, empty);
        }
        if (found) return true;
        if constexpr (R.flying)
            for (Bits k = own & p.kings; k; k &= k - 1) {
                auto& rays = B::rays[indexOf(k)];
                if (flies<upLeft>(rays, prey, empty) || flies<upRight>(rays, prey, empty) || flies<downLeft>(rays, prey, empty) ||
                    flies<downRight>(rays, prey, empty))
                    return true;
            }
        return false;
    }

    // Number of captures when only men can capture, and none of them twice; else -1. No capture, or no list, costs less.
    template <bool Native> [[gnu::always_inline]] static int countSingle(const Position& p) {
        Bits own = S == Side::white ? p.white : p.black, prey = S == Side::white ? p.black : p.white;
        if (own & p.kings) return -1;
        Bits empty = B::all & ~own & ~prey, ul = 0, ur = 0, dl = 0, dr = 0, more = 0;
        if constexpr (S == Side::white || R.menCaptureBack) ul = jump<upLeft>(own, prey, empty), ur = jump<upRight>(own, prey, empty);
        if constexpr (S == Side::black || R.menCaptureBack) dl = jump<downLeft>(own, prey, empty), dr = jump<downRight>(own, prey, empty);
        // Straight on or around a corner; never back over the same victim.
        if constexpr (S == Side::white || R.menCaptureBack)
            more |= jump<upLeft>(ul | ur | dl, prey, empty) | jump<upRight>(ul | ur | dr, prey, empty);
        if constexpr (S == Side::black || R.menCaptureBack)
            more |= jump<downLeft>(ul | dl | dr, prey, empty) | jump<downRight>(ur | dl | dr, prey, empty);
        return more ? -1 : number<Native>(ul, ur) + number<Native>(dl, dr);
    }

    // Fills the list; leaves it empty when nothing can be captured.
    void all() {
        Bits men = own_ & ~kings_;
        if constexpr (S == Side::white || R.menCaptureBack) menFrom<upLeft>(men), menFrom<upRight>(men);
        if constexpr (S == Side::black || R.menCaptureBack) menFrom<downLeft>(men), menFrom<downRight>(men);
        for (Bits k = own_ & kings_; k; k &= k - 1) {
            begin(lowest(k));
            if constexpr (R.flying) fly(lowest(k), 15, 0, 0);
            else jumpOn<true>(lowest(k), 0, 0);
        }
    }

private:
    template <Direction D> static Bits jump(Bits from, Bits prey, Bits empty) {
        return B::template step<D>(B::template step<D>(from) & prey) & empty;
    }
    template <Direction D> static bool flies(const std::array<Bits, 4>& rays, Bits prey, Bits empty) {
        Bits met = rays[D] & ~empty;
        return met && (B::template step<D>(nearest<D>(met) & prey) & empty);
    }

    void begin(Bits from) {
        origin_ = from;
        free_ = empty_ | from;      // it may pass and visit the square that it has left
    }

    template <Direction D> void menFrom(Bits men) {
        Bits landing = jump<D>(men, prey_, empty_);
        for (; landing; landing &= landing - 1) {
            Bits to = lowest(landing), victim = B::template step<opposite(D)>(to), from = B::template step<opposite(D)>(victim);
            begin(from);
            land<false>(to, victim, 0, 0);
        }
    }

    template <bool King> void land(Bits to, Bits victim, Bits captured, int n) {
        captured |= victim;
        if (!King && R.crowningEnds && (to & B::crowning(S))) return add(to, captured, n + 1);
        if (!jumpOn<King>(to, captured, n + 1)) add(to, captured, n + 1);
    }
    template <bool King, Direction D> bool jumpTo(Bits at, Bits captured, int n) {
        Bits victim = B::template step<D>(at) & prey_ & ~captured, to = B::template step<D>(victim) & free_;
        if (!to) return false;
        land<King>(to, victim, captured, n);
        return true;
    }
    // A man, or a king that does not fly. False: it cannot capture from there.
    template <bool King> bool jumpOn(Bits at, Bits captured, int n) {
        bool any = false;
        if constexpr (King || R.menCaptureBack || S == Side::white) {
            any |= jumpTo<King, upLeft>(at, captured, n);
            any |= jumpTo<King, upRight>(at, captured, n);
        }
        if constexpr (King || R.menCaptureBack || S == Side::black) {
            any |= jumpTo<King, downLeft>(at, captured, n);
            any |= jumpTo<King, downRight>(at, captured, n);
        }
        return any;
    }

    // A flying king. directions: a set of bits 1 << Direction. Straight on is tried from the nearest landing square alone: from
    // the others the next victim is the same.
    bool fly(Bits at, unsigned directions, Bits captured, int n) {
        bool any = false;
        if (directions & 1 << upLeft) any |= flyTo<upLeft>(at, captured, n);
        if (directions & 1 << upRight) any |= flyTo<upRight>(at, captured, n);
        if (directions & 1 << downLeft) any |= flyTo<downLeft>(at, captured, n);
        if (directions & 1 << downRight) any |= flyTo<downRight>(at, captured, n);
        return any;
    }
    template <Direction D> bool flyTo(Bits at, Bits captured, int n) {
        Bits met = B::rays[indexOf(at)][D] & ~free_;
        if (!met) return false;
        Bits victim = nearest<D>(met) & prey_ & ~captured;
        Bits to = B::template step<D>(victim) & free_;
        if (!to) return false;
        captured |= victim;
        constexpr unsigned kTurns = D == upLeft || D == downRight ? 1 << upRight | 1 << downLeft : 1 << upLeft | 1 << downRight;
        bool further = fly(to, kTurns | 1 << D, captured, n + 1);
        for (Bits t = B::template step<D>(to) & free_; t; t = B::template step<D>(t) & free_) further |= fly(t, kTurns, captured, n + 1);
        if (!further)
            for (Bits t = to; t; t = B::template step<D>(t) & free_) add(t, captured, n + 1);
        return true;
    }

    void add(Bits to, Bits captured, int n) {
        if constexpr (R.majority) {
            if (n < most_) return;
            if (n > most_) out_.clear(), most_ = n;
        }
        Move m{captured, std::uint8_t(indexOf(origin_)), std::uint8_t(indexOf(to))};
        // Two victims cannot be taken in two orders with the same end.
        if (n >= 3 && out_.has(m)) return;
        out_.push(m);
    }

    MoveList& out_;
    const Bits kings_, own_, prey_, empty_;
    Bits origin_ = 0, free_ = 0;
    int most_ = 0;
};

template <const Rules& R, Side S> struct Quiet {
    using B = Board<R.width>;
    static constexpr Direction left = S == Side::white ? upLeft : downLeft, right = S == Side::white ? upRight : downRight;

    template <Direction D> static void men(Bits from, Bits empty, MoveList& out) {
        for (Bits to = B::template step<D>(from) & empty; to; to &= to - 1)
            out.push({0, std::uint8_t(indexOf(B::template step<opposite(D)>(lowest(to)))), std::uint8_t(indexOf(to))});
    }
    template <Direction D> static Bits reach(int at, Bits empty) {
        if constexpr (!R.flying) return B::template step<D>(Bits(1) << at) & empty;
        Bits ray = B::rays[at][D], met = ray & ~empty;
        if (!met) return ray;
        Bits end = nearest<D>(met);
        return ray & (D == downLeft || D == downRight ? end - 1 : ~(end | (end - 1)));
    }
    static Bits king(int at, Bits empty) {
        return reach<upLeft>(at, empty) | reach<upRight>(at, empty) | reach<downLeft>(at, empty) | reach<downRight>(at, empty);
    }
    static void all(const Position& p, MoveList& out) {
        Bits own = S == Side::white ? p.white : p.black, empty = B::all & ~p.white & ~p.black;
        men<left>(own & ~p.kings, empty, out);
        men<right>(own & ~p.kings, empty, out);
        for (Bits k = own & p.kings; k; k &= k - 1)
            for (Bits to = king(indexOf(k), empty); to; to &= to - 1)
                out.push({0, std::uint8_t(indexOf(k)), std::uint8_t(indexOf(to))});
    }
    template <bool Native> [[gnu::always_inline]] static int count(const Position& p) {
        Bits own = S == Side::white ? p.white : p.black, empty = B::all & ~p.white & ~p.black;
        Bits movers = own & ~p.kings;
        int n = number<Native>(B::template step<left>(movers) & empty, B::template step<right>(movers) & empty);
        for (Bits k = own & p.kings; k; k &= k - 1) n += number<Native>(king(indexOf(k), empty), 0);
        return n;
    }
};

template <const Rules& R, Side S> inline void generateFor(const Position& p, MoveList& out) {
    out.clear();
    if (Captures<R, S>::any(p)) Captures<R, S>(p, out).all();
    else Quiet<R, S>::all(p, out);
}
template <const Rules& R, Side S> [[gnu::noinline]] int countList(const Position& p) {
    MoveList list;
    Captures<R, S>(p, list).all();
    return list.size();
}
template <const Rules& R, Side S, bool Native> [[gnu::always_inline]] inline int countFor(const Position& p) {
    int n = Captures<R, S>::template countSingle<Native>(p);
    if (n > 0) return n;
    if (n == 0 || !Captures<R, S>::any(p)) return Quiet<R, S>::template count<Native>(p);
    return countList<R, S>(p);
}

template <const Rules& R, Side S> std::uint64_t perftFor(const Position& p, int depth) {
    if (depth == 1) return std::uint64_t(countFor<R, S, false>(p));
    MoveList list;
    generateFor<R, S>(p, list);
    std::uint64_t n = 0;
    for (auto& m : list) n += perftFor<R, other(S)>(after<R>(p, m), depth - 1);
    return n;
}

#ifdef __x86_64__
// The same for processors that count bits by themselves: a third faster.
template <const Rules& R, Side S> [[gnu::target("popcnt")]] std::uint64_t perftNative(const Position& p, int depth) {
    if (depth == 1) return std::uint64_t(countFor<R, S, true>(p));
    MoveList list;
    generateFor<R, S>(p, list);
    std::uint64_t n = 0;
    for (auto& m : list) n += perftNative<R, other(S)>(after<R>(p, m), depth - 1);
    return n;
}
#endif

}  // namespace

template <const Rules& R> void generate(const Position& p, MoveList& out) {
    p.side == Side::white ? generateFor<R, Side::white>(p, out) : generateFor<R, Side::black>(p, out);
}
template <const Rules& R> bool canCapture(const Position& p, Side side) {
    return side == Side::white ? Captures<R, Side::white>::any(p) : Captures<R, Side::black>::any(p);
}
template <const Rules& R> bool canCapture(const Position& p) { return canCapture<R>(p, p.side); }
template <const Rules& R> int countMoves(const Position& p) {
    return p.side == Side::white ? countFor<R, Side::white, false>(p) : countFor<R, Side::black, false>(p);
}

#define DRAUGHTS_GAME(R)                                          \
    template void generate<R>(const Position&, MoveList&);        \
    template bool canCapture<R>(const Position&);                 \
    template bool canCapture<R>(const Position&, Side);           \
    template int countMoves<R>(const Position&);
DRAUGHTS_GAME(kIntl)
DRAUGHTS_GAME(kBraz)
DRAUGHTS_GAME(kEngl)
#undef DRAUGHTS_GAME

void generate(const Rules& rules, const Position& p, MoveList& out) {
    forGame(rules, [&](auto g) { generate<decltype(g)::rules>(p, out); });
}
bool canCapture(const Rules& rules, const Position& p) {
    return forGame(rules, [&](auto g) { return canCapture<decltype(g)::rules>(p); });
}

std::uint64_t perft(const Rules& rules, const Position& p, int depth) {
    if (depth <= 0) return 1;
    return forGame(rules, [&](auto g) {
        constexpr const Rules& R = decltype(g)::rules;
#ifdef __x86_64__
        static const bool native = __builtin_cpu_supports("popcnt");
        if (native) return p.side == Side::white ? perftNative<R, Side::white>(p, depth) : perftNative<R, Side::black>(p, depth);
#endif
        return p.side == Side::white ? perftFor<R, Side::white>(p, depth) : perftFor<R, Side::black>(p, depth);
    });
}

Position after(const Rules& rules, const Position& p, const Move& m) {
    return forGame(rules, [&](auto g) { return after<decltype(g)::rules>(p, m); });
}

Position startPosition(const Rules& rules) {
    Position p;
    int men = rules.menRows * rules.half();
    for (int s = 1; s <= men; ++s) {
        p.black |= bitOf(rules, s);
        p.white |= bitOf(rules, rules.squares() + 1 - s);
    }
    p.side = rules.blackBegins ? Side::black : Side::white;
    return p;
}

namespace {

// Looks for a way through all victims, one jump at a time.
struct PathFinder {
    const Rules& rules;
    Bits free, prey, target, from;
    bool king, white;
    MoveRoute path;

    Bits step(Bits b, Direction d) const {
        Bits all = rules.width == 10 ? Board<10>::all : Board<8>::all;
        return (rules.width == 10 ? Board<10>::step(b, d) : Board<8>::step(b, d)) & all;
    }
    bool allowed(Direction d) const {
        bool up = d == upLeft || d == upRight;
        return king || rules.menCaptureBack || up == white;
    }
    bool search(Bits at, Bits left) {
        if (!left) return at == target;
        for (Direction d : {upLeft, upRight, downLeft, downRight}) {
            if (!allowed(d)) continue;
            Bits v = step(at, d);
            if (king && rules.flying)
                while (v & free) v = step(v, d);
            if (!(v & left)) continue;
            for (Bits to = step(v, d); to & free; to = step(to, d)) {
                path.squares.push_back(squareOf(rules, indexOf(to)));
                path.victims.push_back(squareOf(rules, indexOf(v)));
                if (search(to, left & ~v)) return true;
                path.squares.pop_back();
                path.victims.pop_back();
                if (!king || !rules.flying) break;
            }
        }
        return false;
    }
};

}  // namespace

MoveRoute routeOf(const Rules& rules, const Position& p, const Move& m) {
    MoveList list;
    generate(rules, p, list);
    if (!list.has(m)) return {};
    Bits all = rules.width == 10 ? Board<10>::all : Board<8>::all, from = Bits(1) << m.from, to = Bits(1) << m.to;
    PathFinder f{rules, all & ~(p.occupied() & ~from), p.opponent(), to, from, bool(p.kings & from), p.side == Side::white, {}};
    f.path.squares.push_back(squareOf(rules, m.from));
    if (!m.captured) f.path.squares.push_back(squareOf(rules, m.to));
    else f.search(from, m.captured);
    return f.path;
}

}  // namespace draughts
