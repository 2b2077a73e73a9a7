// train.cpp -- learns the weights of the evaluation from games of the engine with itself. See README.md, and learn.sh.
//
//     train play GAME SECONDS SEED NODES FILE     play games for that long, append their quiet positions and results to FILE
//     train fit GAME FILE >weights                logistic regression: what result follows from a position?
//     train match GAME A B GAMES SEED             strength: A and B are nodes a move; with a p before it, p20000, plain
//                                             alpha-beta with material and advance; with an o, the same with table and history
//
// FILE: 32 bytes a position, as this processor has them in memory: white, black, kings, then side (bit 0) and White's result (2, 1
// or 0 half points, bits 1 and 2).
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "draughts/endgames.h"
#include "draughts/search.h"

using namespace draughts;

namespace {

struct Sample {
    Bits white, black, kings, rest;
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

template <const Rules& R> int play(double seconds, unsigned seed, std::uint64_t nodes, const char* file) {
    FILE* out = std::fopen(file, "ab");
    if (!out) return std::perror(file), 1;
    std::mt19937_64 random(seed);
    Transpositions table(4 << 20);
    Search search(R, table);
    Limits limits;
    limits.nodes = nodes;
    auto endgames = R.width == 8 ? Endgames::compute(R, nullptr) : nullptr;
    SearchSettings settings;
    settings.endgames = endgames.get();
    long games = 0, positions = 0, points[3] = {};
    for (double end = now() + seconds; now() < end; ++games) {
        Position p = startPosition(R);
        std::vector<Position> since{p};
        std::vector<Sample> samples;
        int opening = 3 + int(random() % (R.width == 10 ? 9 : 7)), result = 1;
        for (int ply = 0; ply < 180; ++ply) {
            MoveList list;
            generate<R>(p, list);
            if (list.size() == 0) {
                result = p.side == Side::white ? 0 : 2;
                break;
            }
            Move m = list[int(random() % unsigned(list.size()))];
            // Now and then something unexpected, so that the weights learn what follows from it; what was before, does not.
            bool surprise = ply < 60 && random() % 24 == 0;
            if (surprise) samples.clear();
            if (ply >= opening && !surprise && list.size() > 1) {
                search.prepare();
                Progress best = search.run(since, limits, settings);
                m = best.line[0];
                if (std::abs(best.score) > kSurelyWon) {
                    result = (best.score > 0) == (p.side == Side::white) ? 2 : 0;
                    break;
                }
            }
            if (ply >= opening && !surprise && !canCapture<R>(p) && !canCapture<R>(p, other(p.side)))
                samples.push_back({p.white, p.black, p.kings, Bits(p.side)});
            if (m.captured || !(p.kings >> m.from & 1)) since.clear();
            p = after<R>(p, m);
            Outcome known;
            if (endgames && endgames->find(p, known) && known.value == 0) break;
            if (std::count(since.begin(), since.end(), p) >= 2 || int(since.size()) >= 2 * R.draws.kingMoves) break;
            since.push_back(p);
        }
        for (auto& s : samples) s.rest |= Bits(result) << 1;
        std::fwrite(samples.data(), sizeof(Sample), samples.size(), out);
        positions += long(samples.size());
        ++points[result];
    }
    std::fclose(out);
    std::fprintf(stderr, "%s: %ld games (white won %ld, drawn %ld, black won %ld), %ld positions, seed %u, %lu nodes a move\n", R.name,
                 games, points[2], points[1], points[0], positions, seed, (unsigned long)nodes);
    return 0;
}

template <const Rules& R> struct Model {
    static constexpr int kStored = Fields<R>::stored, kCountWeights = 2 * kCounts;
    std::vector<float> weight = std::vector<float>(kCountWeights + 2 * kStored * kFieldSize), square = std::vector<float>(weight.size(), 0.5f);
    std::vector<int> turnedTable = std::vector<int>(kFieldSize);
    Model() {
        for (int i = 0; i < kFieldSize; ++i) turnedTable[i] = turnedIndex(i);
    }
    // Weight number and sign of entry index of field f; sign 0: it is 0 for reasons of symmetry.
    std::pair<int, float> find(int f, int index) const {
        int partner = Fields<R>::count - 1 - f, t = turnedTable[index];
        if (partner == f) return {kCountWeights + f * kFieldSize + std::min(index, t), index < t ? 1.f : index > t ? -1.f : 0.f};
        if (f < partner) return {kCountWeights + f * kFieldSize + index, 1.f};
        return {kCountWeights + partner * kFieldSize + t, -1.f};
    }
};

template <const Rules& R> int fit(const char* file, const char* how) {
    FILE* in = std::fopen(file, "rb");
    if (!in) return std::perror(file), 1;
    std::vector<Sample> samples;
    Sample s;
    while (std::fread(&s, sizeof s, 1, in) == 1) samples.push_back(s);
    std::fclose(in);
    std::mt19937_64 random(1);
    std::shuffle(samples.begin(), samples.end(), random);
    std::size_t test = samples.size() / 20;

    Model<R> m;
    constexpr int kMost = 2 * R.menRows * R.half();
    const int kEpochs = 12;
    for (int epoch = 0; epoch < kEpochs; ++epoch) {
        double loss = 0, tested = 0;
        float rate = 0.05f * float(kEpochs - epoch) / kEpochs;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            auto& a = samples[k];
            Position p{a.white, a.black, a.kings, a.rest & 1 ? Side::black : Side::white};
            float target = float(a.rest >> 1 & 3) / 2;
            Features f = featuresOf<R>(p);
            float few = float(kMost - std::min(f.pieces, kMost)) / kMost;
            std::pair<int, float> at[32 + 2 * kCounts];
            int n = 0;
            for (int c = 0; c < kCounts; ++c) {
                if (!f.counts[c] || (!R.flying && (c == firstKing || c == longDiagonal))) continue;
                float x = float(f.counts[c]) * (c == advance ? 0.2f : 1);
                float late = R.flying || c != kings ? few : 0.5f;
                at[n++] = {2 * c, x * (1 - late)};
                at[n++] = {2 * c + 1, x * late};
            }
            for (int i = 0; i < Fields<R>::count; ++i) {
                // Both phases alike: told apart they foretell better, and play worse.
                auto [w, sign] = m.find(i, f.fields[i]);
                at[n++] = {w, sign * 0.5f};
                at[n++] = {w + Model<R>::kStored * kFieldSize, sign * 0.5f};
            }
            float sum = 0;
            for (int i = 0; i < n; ++i) sum += m.weight[at[i].first] * at[i].second;
            float guess = 1 / (1 + std::exp(-sum)), error = target - guess;
            if (k < test) {
                tested -= target * std::log(guess + 1e-9) + (1 - target) * std::log(1 - guess + 1e-9);
                continue;
            }
            loss -= target * std::log(guess + 1e-9) + (1 - target) * std::log(1 - guess + 1e-9);
            for (int i = 0; i < n; ++i) {
                auto [w, x] = at[i];
                float pull = w >= m.kCountWeights ? 2e-4f : 0, g = error * x - pull * m.weight[w];
                m.square[w] += g * g;
                m.weight[w] += rate * g / std::sqrt(m.square[w] + 1e-3f);
            }
        }
        std::fprintf(stderr, "epoch %d: loss %.5f, of unseen positions %.5f\n", epoch + 1, loss / double(samples.size() - test),
                     tested / double(test));
    }
    // A man is 100 points, half way through the game.
    float man = (m.weight[2 * men] + m.weight[2 * men + 1]) / 2, scale = 100 / man;
    // Drawn games of kings hide that a king that does not fly is worth more than a man.
    if (!R.flying) m.weight[2 * kings] = m.weight[2 * kings + 1] = 1.3f * man;
    std::printf("R\"weights(");
    for (int c = 0; c < m.kCountWeights; ++c)
        std::printf("%s%d", c ? " " : "", int(std::lround(m.weight[c] * scale * 10 * (c / 2 == advance ? 0.2f : 1))));
    std::printf(";\n");
    int zeros = 0, column = 0;
    auto put = [&](const std::string& text) {
        if (column + int(text.size()) > 120) std::putchar('\n'), column = 0;
        std::fputs(text.c_str(), stdout);
        column += int(text.size());
    };
    auto flush = [&] {
        if (zeros > 3) put("~" + std::to_string(zeros) + ";");
        else if (zeros) put(std::string(std::size_t(zeros), 'O'));
        zeros = 0;
    };
    for (int f = 0; f < 2 * m.kStored; ++f)
        for (int i = 0; i < kFieldSize; ++i) {
            auto [w, sign] = m.find(f % m.kStored, i);
            if (f >= m.kStored) w += m.kStored * kFieldSize;
            int value = std::clamp(int(std::lround(m.weight[w] * sign * scale)), -46, 46);
            if (value == 0) ++zeros;
            else flush(), put(std::string(1, char('O' + value)));
        }
    flush();
    std::printf("\n)weights\"\n// %s: %zu positions. %s One man: %.2f of the logarithm of the odds.\n", R.name, samples.size(), how, man);
    return 0;
}

struct Player {
    Limits limits;
    SearchSettings settings;
    Transpositions table{16 << 20};
};

// From openings of random moves that a search thinks level, each played with both colours.
template <const Rules& R> int match(const char* a, const char* b, int games, unsigned seed) {
    std::mt19937_64 random(seed);
    auto endgames = R.width == 8 ? Endgames::compute(R, nullptr) : nullptr;
    Player players[2];
    for (int i = 0; i < 2; ++i) {
        const char* text = i ? b : a;
        players[i].settings.plain = *text == 'p' ? 1 : *text == 'o' ? 2 : 0;
        players[i].limits.nodes = std::strtoull(text + (players[i].settings.plain != 0), nullptr, 10);
        if (!players[i].settings.plain) players[i].settings.endgames = endgames.get();
    }
    auto opening = [&] {
        Player judge;
        judge.limits.nodes = 30000;
        for (;;) {
            Position p = startPosition(R);
            MoveList list;
            for (int ply = 0; ply < (R.width == 10 ? 10 : 8); ++ply) {
                generate<R>(p, list);
                if (!list.size()) break;
                p = after<R>(p, list[int(random() % unsigned(list.size()))]);
            }
            generate<R>(p, list);
            if (!list.size()) continue;
            Search search(R, judge.table);
            if (std::abs(search.run({p}, judge.limits, judge.settings).score) < 40) return p;
        }
    };
    // Half points of the first player. first: the colour that he has.
    auto game = [&](Position p, Side first) {
        std::vector<Position> since{p};
        for (auto& player : players) player.table.clear();
        for (int ply = 0; ply < 400; ++ply) {
            MoveList list;
            generate<R>(p, list);
            if (!list.size()) return p.side == first ? 0 : 2;
            Outcome known;
            if (endgames && endgames->find(p, known) && !canCapture<R>(p)) {
                if (known.value == 0) return 1;
                return (known.value > 0) == (p.side == first) ? 2 : 0;
            }
            Player& player = players[p.side == first ? 0 : 1];
            Move m = list[0];
            if (list.size() > 1) {
                Search search(R, player.table);
                m = search.run(since, player.limits, player.settings).line[0];
            }
            if (m.captured || !(p.kings >> m.from & 1)) since.clear();
            p = after<R>(p, m);
            if (std::count(since.begin(), since.end(), p) >= 2 || int(since.size()) >= 2 * R.draws.kingMoves) return 1;
            // A flying king against three pieces or less, without the tables: drawn but for accidents.
            if (R.width == 10 && p.kings && countOf(p.white) <= 3 && countOf(p.black) <= 3 && (p.kings & p.white) && (p.kings & p.black))
                return 1;
            since.push_back(p);
        }
        return 1;
    };
    int points[3] = {};
    double sum = 0, squares = 0;
    for (int pair = 0; pair < games / 2; ++pair) {
        Position p = opening();
        int one = game(p, Side::white), two = game(p, Side::black);
        ++points[one], ++points[two];
        double score = (one + two) / 4.0;
        sum += score, squares += score * score;
    }
    double n = games / 2, mean = sum / n, error = 1.96 * std::sqrt(std::max(squares / n - mean * mean, 0.25 / n) / n);
    auto elo = [](double x) { return -400 * std::log10(1 / std::clamp(x, 0.001, 0.999) - 1); };
    std::printf("%s %s %s games %d won %d drawn %d lost %d Elo %+.0f (%+.0f .. %+.0f)\n", R.name, a, b, games / 2 * 2, points[2], points[1],
                points[0], elo(mean), elo(mean - error), elo(mean + error));
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const Rules* rules = argc > 2 ? findGame(argv[2]) : nullptr;
    std::string what = argc > 1 ? argv[1] : "";
    if (rules && what == "play" && argc == 7)
        return forGame(*rules, [&](auto g) {
            return play<decltype(g)::rules>(std::atof(argv[3]), unsigned(std::atoi(argv[4])), std::strtoull(argv[5], nullptr, 10), argv[6]);
        });
    if (rules && what == "fit" && (argc == 4 || argc == 5))
        return forGame(*rules, [&](auto g) { return fit<decltype(g)::rules>(argv[3], argc == 5 ? argv[4] : ""); });
    if (rules && what == "match" && argc == 7)
        return forGame(*rules, [&](auto g) {
            return match<decltype(g)::rules>(argv[3], argv[4], std::atoi(argv[5]), unsigned(std::atoi(argv[6])));
        });
    std::fprintf(stderr, "usage: train play intl|braz|engl SECONDS SEED NODES FILE\n       train fit intl|braz|engl FILE ?NOTE?\n"
                         "       train match intl|braz|engl ?p|o?NODES ?p|o?NODES GAMES SEED\n");
    return 2;
}
