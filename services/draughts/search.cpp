#include "draughts/search.h"

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>
#include <system_error>
#include <thread>

#include "draughts/endgames.h"

namespace draughts {
namespace {

constexpr int kMaxPly = 120, kMaxDepth = 99, kInfinite = 32000;

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Data that the threads of one search share.
struct Shared {
    std::atomic<bool>& stop;
    std::atomic<double>& end;
    Transpositions& table;
    const Weights& weights;
    const Limits& limits;
    const SearchSettings& settings;
    double begin;
    std::atomic<std::uint64_t> otherNodes{0};   // of the helping threads, roughly
};

const std::array<std::array<std::uint8_t, 64>, 64>& reductions() {
    static const auto table = [] {
        std::array<std::array<std::uint8_t, 64>, 64> t{};
        for (int d = 1; d < 64; ++d)
            for (int i = 1; i < 64; ++i) t[d][i] = std::uint8_t(0.6 + std::log(d) * std::log(i + 0.5) / 1.7);
        return t;
    }();
    return table;
}

template <const Rules& R> class Worker {
public:
    Worker(Shared& shared, const std::vector<Position>& game, bool leads)
        : shared_(shared), table_(shared.table), weights_(shared.weights), leads_(leads), plain_(shared.settings.plain),
          reductions_(reductions()) {
        for (auto& p : game) keys_.push_back(p.key());
        first_ = int(keys_.size()) - 1;
        root_ = game.back();
        keys_.resize(keys_.size() + kMaxPly + 2);
        limit_ = leads && shared.limits.nodes ? shared.limits.nodes : UINT64_MAX;
    }

    // Deepens until a limit is reached. number: of the thread; others than 0 begin elsewhere.
    Progress deepen(int number, const std::function<void(const Progress&)>& report) {
        Progress best;
        MoveList list;
        generate<R>(root_, list);
        best.line.push_back(list[0]);
        int most = shared_.limits.depth > 0 ? std::min(shared_.limits.depth, kMaxDepth) : kMaxDepth;
        int score = 0;
        for (int depth = 1 + (number & 1); depth <= most; ++depth) {
            bool whole = false;
            try {
                score = aspire(depth, score);
                whole = true;
            } catch (Stopped) {
            }
            // An iteration that was cut short counts when it has found its first move: that is the best one of the last, or better.
            // Without the table, which puts it first, this does not hold.
            if (whole || (length_[0] > 0 && depth > 1 && plain_ != 1)) {
                best.depth = whole ? depth : depth - 1;
                if (whole) best.score = score;
                if (length_[0] > 0) best.line.assign(line_[0], line_[0] + length_[0]);
            }
            best.nodes = nodes_ + shared_.otherNodes.load(std::memory_order_relaxed);
            best.time = now() - shared_.begin;
            if (whole && report) report(best);
            if (!whole) break;
            if (!leads_ || shared_.limits.infinite) continue;
            if (shared_.limits.time > 0 && best.time > shared_.limits.time * 0.55) break;
            // Nothing to choose, or nothing left to find out.
            if (shared_.limits.time > 0 && list.size() == 1) break;
            if (std::abs(score) > kSurelyWon && depth > kWin - std::abs(score)) break;
        }
        return best;
    }
    std::uint64_t nodes() const { return nodes_; }

private:
    struct Stopped {};

    int aspire(int depth, int last) {
        int width = plain_ != 1 && depth >= 5 && std::abs(last) < kSurelyWon ? 25 : kInfinite;
        int low = std::max(last - width, -kInfinite), high = std::min(last + width, +kInfinite);
        for (;;) {
            length_[0] = 0;
            int score = visit<true>(root_, low, high, depth, 0);
            if (score > low && score < high) return score;
            width *= 4;
            if (width > 2000) width = kInfinite;
            if (score <= low) low = std::max(score - width, -kInfinite);
            else high = std::min(score + width, +kInfinite);
        }
    }

    void countNode() {
        ++nodes_;
        if (nodes_ >= limit_) throw Stopped();
        if ((nodes_ & 1023) == 0) {
            if (shared_.stop.load(std::memory_order_relaxed)) throw Stopped();
            if (!leads_) shared_.otherNodes.fetch_add(1024, std::memory_order_relaxed);
            else if (overdue()) throw Stopped();
        }
    }

    bool overdue() const {
        double end = shared_.end.load(std::memory_order_relaxed);
        if (shared_.limits.time <= 0 && end <= 0) return false;
        double t = now();
        return (end > 0 && t >= end) || (shared_.limits.time > 0 && t - shared_.begin >= shared_.limits.time);
    }

    // The same position was there before, with nothing but moves of kings since.
    bool repeats(std::uint64_t key, int ply, int reversible) const {
        for (int back = 4; back <= reversible; back += 2)
            if (first_ + ply - back >= 0 && keys_[std::size_t(first_ + ply - back)] == key) return true;
        return false;
    }

    int evaluated(const Position& p) {
        int score = evaluate<R>(weights_, p);
        if (int noise = shared_.settings.noise) [[unlikely]] {
            std::uint64_t r = (p.key() ^ shared_.settings.seed) * 0x9e3779b97f4a7c15u >> 40;
            score += int(std::int64_t(r * std::uint64_t(2 * noise + 1) >> 24) - noise);
        }
        return score;
    }

    int toTable(int score, int ply) const { return score > kSurelyWon ? score + ply : score < -kSurelyWon ? score - ply : score; }
    int fromTable(int score, int ply) const { return score > kSurelyWon ? score - ply : score < -kSurelyWon ? score + ply : score; }

    template <bool PV> int visit(const Position& p, int alpha, int beta, int depth, int ply) {
        countNode();
        if constexpr (PV) length_[ply] = ply;
        std::uint64_t key = p.key();
        keys_[std::size_t(first_ + ply)] = key;
        bool capture = canCapture<R>(p);

        // A leaf. To look what the opponent could capture costs more than it brings: measured.
        if (depth <= 0 && !capture) return leaf(p, ply);
        if (ply >= kMaxPly) return evaluated(p);

        Outcome outcome;
        if (ply > 0) {
            if (repeated(p, key, ply)) return 0;
            if (!capture && shared_.settings.endgames && shared_.settings.endgames->find(p, outcome))
                return outcome.value * (outcome.value ? kWin - ply - outcome.distance : 0);
            // The game lasts longer than that in any case.
            alpha = std::max(alpha, -kWin + ply);
            if (alpha >= beta) return alpha;
        }

        Known known;
        if (depth > 0) {
            if (plain_ != 1 && table_.find(key, known)) {
                int score = fromTable(known.score, ply);
                if (!PV && known.depth >= depth &&
                    (known.bound == Bound::exact || (known.bound == Bound::lower && score >= beta) ||
                     (known.bound == Bound::upper && score <= alpha)))
                    return score;
            }
            // ProbCut: a shallower search that is far above says enough.
            if (!PV && !plain_ && depth >= 6 && !capture && std::abs(beta) < kSurelyWon) {
                int margin = 30 + 6 * depth, high = beta + margin;
                int score = visit<false>(p, high - 1, high, depth - 3 - depth / 4, ply);
                if (score >= high) return beta;
            }
        }

        MoveList list;
        generate<R>(p, list);
        if (list.size() == 0) return -kWin + ply;
        if (ply == 0) length_[0] = 0;
        if (list.size() == 1 && ply > 0 && !plain_) {
            Position n = after<R>(p, list[0]);
            kept_[ply + 1] = keptAfter(p, list[0], ply);
            // No depth is lost, and at depth 0 only captures come here.
            int score = -visit<PV>(n, -beta, -alpha, depth, ply + 1);
            if constexpr (PV) extend(list[0], ply);
            return score;
        }
        int order[256];
        int n = std::min(list.size(), 256);
        if (n > 1 && plain_ != 1) sort(p, list, known.move, order, n);

        int best = -kInfinite, first = alpha;
        Move bestMove = list[0];
        for (int i = 0; i < n; ++i) {
            const Move m = list[i];
            Position next = after<R>(p, m);
            if (depth > 1) table_.prefetch(next.key());
            kept_[ply + 1] = keptAfter(p, m, ply);
            int left = depth - 1, score;
            if (depth <= 0) left = depth;
            if (plain_) {
                score = -visit<PV>(next, -beta, -std::max(alpha, best), left, ply + 1);
            } else if (i == 0) {
                score = -visit<PV>(next, -beta, -alpha, left, ply + 1);
            } else {
                int reduced = 0;
                if (depth >= 2 && !capture && i >= (PV ? 3 : 1)) {
                    reduced = reductions_[std::min(depth, 63)][std::min(i, 63)];
                    if (PV) reduced = reduced * 2 / 3;
                    reduced = std::min(reduced, depth - 1);
                }
                score = -visit<false>(next, -alpha - 1, -alpha, left - reduced, ply + 1);
                if (score > alpha && reduced) score = -visit<false>(next, -alpha - 1, -alpha, left, ply + 1);
                if (PV && score > alpha && score < beta) score = -visit<true>(next, -beta, -alpha, left, ply + 1);
            }
            if (score > best) {
                best = score;
                bestMove = m;
                if (score > alpha) {
                    alpha = score;
                    if constexpr (PV) extend(m, ply);
                }
                if (alpha >= beta) {
                    if (!capture && depth > 0) reward(p, list, i, depth);
                    break;
                }
            }
        }
        if (depth > 0 && plain_ != 1)
            table_.store(key, {best > first ? markOf(bestMove) : known.move, toTable(best, ply), depth,
                               best >= beta ? Bound::lower : best > first ? Bound::exact : Bound::upper});
        return best;
    }

    int leaf(const Position& p, int ply) {
        Outcome outcome;
        if (shared_.settings.endgames && shared_.settings.endgames->find(p, outcome))
            return outcome.value * (outcome.value ? kWin - ply - outcome.distance : 0);
        return evaluated(p);
    }

    // Moves since the last capture or move of a man, for repetitions and the counter.
    int keptAfter(const Position& p, const Move& m, int ply) const {
        return !m.captured && (p.kings >> m.from & 1) ? (ply == 0 ? first_ : kept_[ply]) + 1 : 0;
    }
    bool repeated(const Position&, std::uint64_t key, int ply) const {
        int kept = kept_[ply];
        return kept >= 4 && (repeats(key, ply, kept) || kept >= 2 * R.draws.kingMoves);
    }

    void extend(const Move& m, int ply) {
        line_[ply][ply] = m;
        int end = ply + 1 <= kMaxPly ? std::max(length_[ply + 1], ply + 1) : ply + 1;
        for (int i = ply + 1; i < end; ++i) line_[ply][i] = line_[ply + 1][i];
        length_[ply] = end;
    }

    // Moves that have caused cutoffs before come first: by kind of piece, from, to.
    int& history(const Position& p, const Move& m) {
        return history_[p.side == Side::white][p.kings >> m.from & 1][m.from][m.to];
    }
    void reward(const Position& p, const MoveList& list, int good, int depth) {
        int gain = std::min(depth * depth, 400);
        auto adjust = [&](const Move& m, int by) {
            int& h = history(p, m);
            h += by * 32 - h * std::abs(by) / 512;
        };
        adjust(list[good], gain);
        for (int i = 0; i < good; ++i) adjust(list[i], -gain);
    }

    void sort(const Position& p, MoveList& list, MoveMark first, int* order, int n) {
        for (int i = 0; i < n; ++i) {
            const Move& m = list[i];
            if (first && markOf(m) == first) order[i] = 1 << 30;
            else if (m.captured) order[i] = (1 << 20) + countOf(m.captured) * 16 + countOf(m.captured & p.kings);
            else order[i] = history(p, m);
        }
        for (int i = 1; i < n; ++i) {
            int o = order[i], j = i;
            Move m = list[i];
            for (; j > 0 && order[j - 1] < o; --j) order[j] = order[j - 1], list[j] = list[j - 1];
            order[j] = o;
            list[j] = m;
        }
    }

    Shared& shared_;
    Transpositions& table_;
    const Weights& weights_;
    const bool leads_;
    const int plain_;
    const std::array<std::array<std::uint8_t, 64>, 64>& reductions_;
    Position root_;
    int first_;                             // index of the root's key
    std::vector<std::uint64_t> keys_;
    std::uint64_t nodes_ = 0, limit_;
    int kept_[kMaxPly + 3] = {};
    int history_[2][2][64][64] = {};
    int length_[kMaxPly + 3] = {};
    Move line_[kMaxPly + 3][kMaxPly + 3];
};

template <const Rules& R>
Progress runFor(Shared& shared, const std::vector<Position>& game, const std::function<void(const Progress&)>& report) {
    if (shared.settings.idle) {
        // For this thread alone, and for those that it starts.
        sched_param parameter{};
        sched_setscheduler(0, SCHED_IDLE, &parameter);
    }
    std::vector<std::thread> helpers;
    auto lead = std::make_unique<Worker<R>>(shared, game, true);
    try {
        for (int i = 1; i < shared.settings.threads; ++i)
            helpers.emplace_back([&shared, &game, i] {
                try {
                    std::make_unique<Worker<R>>(shared, game, false)->deepen(i, nullptr);
                } catch (const std::bad_alloc&) {
                }
            });
    } catch (const std::system_error&) {        // with those that there are
    }
    Progress best = lead->deepen(0, report);
    shared.stop.store(true, std::memory_order_relaxed);
    for (auto& h : helpers) h.join();
    best.nodes = lead->nodes() + shared.otherNodes.load(std::memory_order_relaxed);
    best.time = now() - shared.begin;
    return best;
}

}  // namespace

void Search::endIn(double seconds) { end_.store(now() + seconds, std::memory_order_relaxed); }

Progress Search::run(const std::vector<Position>& game, const Limits& limits, const SearchSettings& settings,
                     const std::function<void(const Progress&)>& report) {
    table_.age();
    Shared shared{stop_, end_, table_, weightsOf(rules_, settings.plain), limits, settings, now(), 0};
    return forGame(rules_, [&](auto g) { return runFor<decltype(g)::rules>(shared, game, report); });
}

}  // namespace draughts
