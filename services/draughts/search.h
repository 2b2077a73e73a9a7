// search.h -- finds the best move: principal variation search with iterative deepening.
//
// Captures are played out before a position is evaluated; forced replies cost no depth; late moves are reduced; shallow searches
// foretell deep ones (ProbCut). No null move: zugzwang is everywhere.
// Threads share the transposition table and nothing else; with one thread and a limit of nodes a search repeats exactly.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "draughts/evaluate.h"
#include "draughts/moves.h"
#include "draughts/transposition.h"

namespace draughts {

class Endgames;

inline constexpr int kWin = 30000;          // minus the moves (of both sides) until it is won
inline constexpr int kSurelyWon = 29000;    // and above

struct Limits {
    int depth = 0;                  // 0: none of these
    std::uint64_t nodes = 0;
    double time = 0;                // [s]
    bool infinite = false;          // until stop(), also when the result is certain
};

struct Progress {
    int depth = 0, score = 0;       // side to move, hundredths of a man
    std::uint64_t nodes = 0;
    double time = 0;                // [s]
    std::vector<Move> line;         // the main line; its first move is the best
};

struct SearchSettings {
    const Endgames* endgames = nullptr;
    int threads = 1;
    // Yardsticks: 1 plain alpha-beta with material and advance; 2 the same with transposition table and history.
    int plain = 0;
    int noise = 0;                  // evaluations vary by that much, hundredths of a man: weak levels
    std::uint64_t seed = 0;         // of the noise
    bool idle = false;              // at the lowest priority of the operating system
};

class Search {
public:
    Search(const Rules& rules, Transpositions& table) : rules_(rules), table_(table) {}

    // game: all positions since the last capture or move of a man, oldest first, the present one last. It is not empty, and there is
    // a legal move.   report: called after each iteration, on this thread. Returns the last report.
    Progress run(const std::vector<Position>& game, const Limits& limits, const SearchSettings& settings,
                 const std::function<void(const Progress&)>& report = nullptr);

    // Any thread: end soon, with the best move so far.
    void stop() { stop_.store(true, std::memory_order_relaxed); }
    bool stopped() const { return stop_.load(std::memory_order_relaxed); }
    // Any thread: end after that time from now [s].
    void endIn(double seconds);
    // Call it before run(), in the thread that may call stop().
    void prepare() {
        stop_.store(false, std::memory_order_relaxed);
        end_.store(0, std::memory_order_relaxed);
    }

private:
    const Rules& rules_;
    Transpositions& table_;
    std::atomic<bool> stop_{false};     // no other data depends on these two
    std::atomic<double> end_{0};        // [s], steady clock; 0: none
};

}  // namespace draughts
