#include "draughts/endgames.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>

#include "bus/fnv.h"
#include "draughts/moves.h"

namespace draughts {
namespace {

using B = Board<8>;
constexpr int kManSquares = 28, kSquares = 32;      // a man never stands on his crowning row

constexpr std::array<std::array<std::uint32_t, 6>, 33> makeBinomials() {
    std::array<std::array<std::uint32_t, 6>, 33> c{};
    for (int n = 0; n <= 32; ++n) {
        c[n][0] = 1;
        for (int k = 1; k <= 5; ++k) c[n][k] = n ? c[n - 1][k - 1] + c[n - 1][k] : 0;
    }
    return c;
}
constexpr auto kBinomial = makeBinomials();

// A set of squares as its number among all sets of that size. lowest: the first square that counts.
std::uint32_t rankOf(Bits set, int lowest) {
    std::uint32_t n = 0;
    for (int k = 1; set; set &= set - 1, ++k) n += kBinomial[B::square(indexOf(set)) - 1 - lowest][k];
    return n;
}
Bits setOf(std::uint32_t rank, int size, int lowest) {
    Bits set = 0;
    for (int k = size, s = kSquares - 1; k > 0; --k) {
        while (kBinomial[s][k] > rank) --s;
        rank -= kBinomial[s][k];
        set |= B::bit(s + 1 + lowest);
    }
    return set;
}

struct Radix {
    std::uint32_t n[4];
    explicit Radix(const int (&c)[4])
        : n{kBinomial[kManSquares][c[0]], kBinomial[kSquares][c[1]], kBinomial[kManSquares][c[2]], kBinomial[kSquares][c[3]]} {}
    std::uint32_t all() const { return n[0] * n[1] * n[2] * n[3]; }
};

// White's men begin at the second row, Black's at the first.
Position positionOf(const int (&c)[4], std::uint32_t index) {
    Radix r(c);
    Position p;
    Bits bk = setOf(index % r.n[3], c[3], 0);
    index /= r.n[3];
    Bits bm = setOf(index % r.n[2], c[2], 0);
    index /= r.n[2];
    Bits wk = setOf(index % r.n[1], c[1], 0);
    Bits wm = setOf(index / r.n[1], c[0], 4);
    p.white = wm | wk;
    p.black = bm | bk;
    p.kings = wk | bk;
    // Sets that overlap are numbers of nothing.
    if (countOf(wm) + countOf(wk) + countOf(bm) + countOf(bk) != countOf(wm | wk | bm | bk)) p = {};
    return p;
}

Position turnedBoard(const Position& p) { return turned<kBraz>(p); }

std::string heading(const Rules& rules, int pieces) {
    return std::string("SORMA draughts endgames 1 ") + rules.name + " " + std::to_string(pieces) + "\n";
}

}  // namespace

Endgames::Endgames(const Rules& rules) : rules_(rules) {
    std::memset(number_, -1, sizeof number_);
    // Each slice comes after those of its captures and crownings, and beside the one in which the other side moves.
    for (int all = 2; all <= kPieces; ++all)
        for (int men = 0; men <= all; ++men)
            for (int white = 1; white < all; ++white)
                for (int wm = 0; wm <= white; ++wm) {
                    int black = all - white, bm = men - wm;
                    if (bm < 0 || bm > black) continue;
                    number_[wm][white - wm][bm][black - bm] = int(slices_.size());
                    slices_.push_back({{wm, white - wm, bm, black - bm}, {}});
                }
}

std::uint64_t Endgames::indexOf(const Position& p, int& slice) const {
    Bits wm = p.white & ~p.kings, wk = p.white & p.kings, bm = p.black & ~p.kings, bk = p.black & p.kings;
    int c[4] = {countOf(wm), countOf(wk), countOf(bm), countOf(bk)};
    slice = number_[c[0]][c[1]][c[2]][c[3]];
    Radix r(c);
    return ((std::uint64_t(rankOf(wm, 4)) * r.n[1] + rankOf(wk, 0)) * r.n[2] + rankOf(bm, 0)) * r.n[3] + rankOf(bk, 0);
}

bool Endgames::find(const Position& given, Outcome& out) const {
    if (countOf(given.occupied()) > pieces_ || !given.white || !given.black) return false;
    Position p = given.side == Side::white ? given : turnedBoard(given);
    if ((p.white & ~p.kings & B::top) || (p.black & ~p.kings & B::bottom)) return false;
    int slice;
    std::uint64_t index = indexOf(p, slice);
    if (slices_[std::size_t(slice)].values.empty()) return false;
    int v = slices_[std::size_t(slice)].values[index];
    out.value = v == 0 ? 0 : v & 1 ? -1 : 1;
    out.distance = v ? v - 1 : 0;
    return true;
}

void Endgames::eachPosition(const Rules&, const int (&counts)[4], Side side, const std::function<void(const Position&)>& visit) {
    for (std::uint32_t i = 0, n = Radix(counts).all(); i < n; ++i) {
        Position p = positionOf(counts, i);
        if (!p.white) continue;
        p.side = side;
        visit(p);
    }
}

// Two slices, one for each side to move, solved together from the end backwards: distance by distance, what is decided there
// decides its predecessors.
class Endgames::Builder {
public:
    Builder(Endgames& e, int first, int second) : e_(e) {
        slice_[0] = first;
        slice_[1] = second;
        for (int w = 0; w < two(); ++w) {
            std::size_t n = Radix(slice(w).counts).all();
            slice(w).values.assign(n, 0);
            open_[w].assign(n, kCapture);
        }
    }
    void build() {
        for (int w = 0; w < two(); ++w)
            for (std::uint32_t i = 0; i < open_[w].size(); ++i) {
                Position p = positionOf(slice(w).counts, i);
                if (p.white) begin(w, i, p);
            }
        for (std::size_t d = 0; d < line_.size(); ++d) {
            auto now = std::move(line_[d]);
            for (auto [w, i] : now) {
                auto& value = slice(w).values[i];
                if (value) continue;
                value = std::uint8_t(d + 1);
                decided(w, positionOf(slice(w).counts, i), int(d));
            }
        }
    }

private:
    static constexpr std::uint8_t kCapture = 254, kNeverLost = 255;

    int two() const { return slice_[0] == slice_[1] ? 1 : 2; }
    Slice& slice(int w) const { return e_.slices_[std::size_t(slice_[w])]; }
    void put(int distance, int w, std::uint32_t i) {
        distance = std::min(distance, 254);
        if (line_.size() <= std::size_t(distance)) line_.resize(std::size_t(distance) + 1);
        line_[std::size_t(distance)].push_back({w, i});
    }
    bool crowns(const Position& p, const Move& m) const { return !(p.kings >> m.from & 1) && (Bits(1) << m.to & B::top); }

    // The result as far as moves into other slices decide it.   open: moves that stay.
    struct Outside {
        int open = 0, loss = -1, win = 1000;    // distances: the longest loss of ours, the shortest win
        bool draw = false;
    };
    Outside look(const Position& p, bool all, bool& capture) {
        MoveList list;
        generate(e_.rules_, p, list);
        Outside o;
        capture = list.size() && list[0].captured;
        for (auto& m : list) {
            if (!all && !m.captured && !crowns(p, m)) {
                ++o.open;
                continue;
            }
            Position next = after(e_.rules_, p, m);
            Outcome r;
            if (!next.black) r = {-1, 0};
            else e_.find(next, r);
            if (r.value < 0) o.win = std::min(o.win, r.distance + 1);
            else if (r.value > 0) o.loss = std::max(o.loss, r.distance + 1);
            else o.draw = true;
        }
        if (!list.size()) o.loss = 0;
        return o;
    }
    void begin(int w, std::uint32_t i, const Position& p) {
        bool capture;
        Outside o = look(p, false, capture);
        if (!capture) open_[w][i] = o.draw ? kNeverLost : std::uint8_t(o.open);
        if (o.win < 1000) put(o.win, w, i);
        else if (!o.open && !o.draw) put(o.loss, w, i);
    }
    // p, White to move, is decided: odd distances are wins. Black moved before.
    void decided(int w, const Position& p, int distance) {
        Bits empty = B::all & ~p.occupied();
        int before = two() == 1 ? 0 : 1 - w;
        auto undo = [&](Bits at, Bits from) {
            Position q = p;
            q.black = (p.black & ~at) | from;
            if (p.kings & at) q.kings = (p.kings & ~at) | from;
            q.side = Side::black;
            q = turnedBoard(q);
            int number;
            auto i = std::uint32_t(e_.indexOf(q, number));
            auto& open = open_[before][i];
            if (open == kCapture || slice(before).values[i]) return;
            if (distance % 2 == 0) return put(distance + 1, before, i);
            if (open == kNeverLost || --open) return;
            bool capture;
            Outside o = look(q, true, capture);
            if (o.win == 1000) put(o.loss, before, i);
        };
        for (Bits men = p.black & ~p.kings; men; men &= men - 1) {
            Bits at = lowest(men);
            for (Direction d : {upLeft, upRight})
                if (Bits from = B::step(at, d) & empty) undo(at, from);
        }
        for (Bits kings = p.black & p.kings; kings; kings &= kings - 1) {
            Bits at = lowest(kings);
            for (Direction d : {upLeft, upRight, downLeft, downRight})
                for (Bits from = B::step(at, d) & empty; from; from = B::step(from, d) & empty) {
                    undo(at, from);
                    if (!e_.rules_.flying) break;
                }
        }
    }

    Endgames& e_;
    int slice_[2];
    std::vector<std::uint8_t> open_[2];
    std::vector<std::vector<std::pair<int, std::uint32_t>>> line_;     // by distance: not decided before
};

std::unique_ptr<Endgames> Endgames::compute(const Rules& rules, const std::function<bool(double)>& progress, int pieces) {
    std::unique_ptr<Endgames> e(new Endgames(rules));
    e->pieces_ = pieces;
    double all = 0, done = 0;
    auto counted = [&](const Slice& s) { return s.counts[0] + s.counts[1] + s.counts[2] + s.counts[3] <= pieces; };
    for (auto& s : e->slices_)
        if (counted(s)) all += Radix(s.counts).all();
    for (std::size_t i = 0; i < e->slices_.size(); ++i) {
        Slice& s = e->slices_[i];
        if (!counted(s) || !s.values.empty()) continue;
        if (progress && !progress(done / all)) return nullptr;
        int partner = e->number_[s.counts[2]][s.counts[3]][s.counts[0]][s.counts[1]];
        Builder(*e, int(i), partner).build();
        done += double(s.values.size()) * (int(i) == partner ? 1 : 2);
    }
    if (progress && !progress(1)) return nullptr;
    return e;
}

std::string Endgames::defaultFile(const Rules& rules) {
    const char *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
    std::string folder = cache && *cache ? cache : std::string(home && *home ? home : "/tmp") + "/.cache";
    return folder + "/sorma/draughts-" + rules.name + ".egt";
}

std::unique_ptr<Endgames> Endgames::load(const Rules& rules, const std::string& file, std::string& why) {
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(file.c_str(), "rb"), std::fclose);
    if (!in) return why = file + ": " + std::strerror(errno), nullptr;
    std::unique_ptr<Endgames> e(new Endgames(rules));
    std::string expected = heading(rules, kPieces), found(expected.size(), '\0');
    if (std::fread(found.data(), 1, found.size(), in.get()) != found.size() || found != expected)
        return why = file + ": it does not begin with \"" + expected.substr(0, expected.size() - 1) + "\": of another game or version",
               nullptr;
    sorma::Fnv sum;
    std::uint64_t stored = 0;
    for (auto& s : e->slices_) {
        s.values.resize(Radix(s.counts).all());
        if (std::fread(s.values.data(), 1, s.values.size(), in.get()) != s.values.size()) return why = file + ": too short", nullptr;
        sum.add(s.values.data(), s.values.size());
    }
    if (std::fread(&stored, 1, sizeof stored, in.get()) != sizeof stored) return why = file + ": too short", nullptr;
    if (stored != sum.value()) return why = file + ": its check sum is wrong", nullptr;
    return e;
}

bool Endgames::save(const std::string& file, std::string& why) const {
    for (std::size_t slash = file.find('/', 1); slash != std::string::npos; slash = file.find('/', slash + 1))
        ::mkdir(file.substr(0, slash).c_str(), 0777);
    std::string fresh = file + "." + std::to_string(::getpid());
    std::FILE* out = std::fopen(fresh.c_str(), "wb");
    if (!out) return why = fresh + ": " + std::strerror(errno), false;
    sorma::Fnv sum;
    std::string head = heading(rules_, kPieces);
    bool good = std::fwrite(head.data(), 1, head.size(), out) == head.size();
    for (auto& s : slices_) {
        good = good && std::fwrite(s.values.data(), 1, s.values.size(), out) == s.values.size();
        sum.add(s.values.data(), s.values.size());
    }
    const std::uint64_t check = sum.value();
    good = good && std::fwrite(&check, 1, sizeof check, out) == sizeof check;
    good = std::fclose(out) == 0 && good;
    good = good && std::rename(fresh.c_str(), file.c_str()) == 0;
    if (!good) {
        why = fresh + ": " + std::strerror(errno);
        ::unlink(fresh.c_str());
    }
    return good;
}

std::shared_ptr<const Endgames> Endgames::provide(const Rules& rules, const std::string& file,
                                                  const std::function<bool(double)>& progress, std::string& note) {
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<const Endgames>> here;
    std::lock_guard lock(mutex);
    auto& known = here[std::string(rules.name) + " " + file];
    if (auto e = known.lock()) return e;
    std::shared_ptr<const Endgames> e = load(rules, file, note);
    if (!e) {
        struct stat there;
        if (::stat(file.c_str(), &there) != 0) note.clear();     // not yet made: nothing wrong with that
        e = compute(rules, progress);
        std::string why;
        if (e && !e->save(file, why)) note += (note.empty() ? "" : "; ") + why + ": not kept, computed again next time";
    }
    known = e;
    return e;
}

}  // namespace draughts
