// train.cpp -- learns the weights of the evaluation from games of the engine with itself. See README.md, and learn.sh.
//
//     train play GAME SECONDS SEED NODES FILE     play games for that long, append their quiet positions and results to FILE
//     train fit GAME FILE >weights                logistic regression: what result follows from a position?
//     train match GAME A B GAMES SEED             strength: A and B are nodes a move; with a p before it, p20000, plain
//                                             alpha-beta with material and advance; with an o, the same with table and history
//
// FILE: 32 bytes a position, as this processor has them in memory: four words of 64 bits, white, black, kings and the rest. Bit 0 of
// the rest is the side. Bits 1 and 2 are White's result: 2, 1 or 0 half points; 3 is unknown, since a random move came later. The upper
// 16 bits are the search's score for White, in hundredths of a man.
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
constexpr Bits kUnknown = 3;

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
            // Now and then comes an unexpected move, so that the weights learn its consequences. Positions before it do not count.
            bool surprise = ply < 60 && random() % 24 == 0;
            if (surprise)
                for (auto& s : samples) s.rest |= kUnknown << 1;
            if (ply >= opening && !surprise && list.size() > 1) {
                search.prepare();
                Progress best = search.run(since, limits, settings);
                m = best.line[0];
                int score = p.side == Side::white ? best.score : -best.score;
                if (std::abs(score) > kSurelyWon) {
                    result = score > 0 ? 2 : 0;
                    break;
                }
                if (!canCapture<R>(p)) samples.push_back({p.white, p.black, p.kings, Bits(p.side) | Bits(std::int64_t(score)) << 48});
            }
            if (m.captured || !(p.kings >> m.from & 1)) since.clear();
            p = after<R>(p, m);
            Outcome known;
            if (endgames && endgames->find(p, known) && known.value == 0) break;
            if (std::count(since.begin(), since.end(), p) >= 2 || int(since.size()) >= 2 * R.draws.kingMoves) break;
            since.push_back(p);
        }
        for (auto& s : samples)
            if ((s.rest >> 1 & kUnknown) != kUnknown) s.rest |= Bits(result) << 1;
        std::fwrite(samples.data(), sizeof(Sample), samples.size(), out);
        positions += long(samples.size());
        ++points[result];
    }
    std::fclose(out);
    std::fprintf(stderr, "%s: %ld games (white won %ld, drawn %ld, black won %ld), %ld positions, seed %u, %lu nodes a move\n", R.name,
                 games, points[2], points[1], points[0], positions, seed, (unsigned long)nodes);
    return 0;
}

// The weights while they are learned, numbered: two phases of each count, then for each phase all tables and the squares of kings.
template <const Rules& R> struct Model {
    using L = Fields<R>;
    static constexpr int kCountWeights = 2 * kCounts, kMostActive = 2 * (kCounts + 16 + R.squares());
    std::vector<float> weight = std::vector<float>(kCountWeights + 2 * L::weights);
    std::vector<float> square = std::vector<float>(weight.size(), 0.5f);      // of the slopes so far, for the step of each weight
    std::vector<int> turnedTable = std::vector<int>(kFieldSize);
    Model() {
        for (int i = 0; i < kFieldSize; ++i) turnedTable[i] = turnedIndex(i);
    }
    // Number of the weight with many pieces, and sign, of entry index of field f; sign 0: it is 0 for reasons of symmetry.
    std::pair<int, float> find(int f, int index) const {
        int partner = L::partner(f), t = turnedTable[index];
        int first = kCountWeights + L::table(std::min(f, partner)) * kFieldSize;
        if (partner == f) return {first + std::min(index, t), index < t ? 1.f : index > t ? -1.f : 0.f};
        return f < partner ? std::pair{first + index, 1.f} : std::pair{first + t, -1.f};
    }
    // take(number, factor) for each weight that counts in a position.
    template <class F> void each(const Position& p, F&& take) const {
        constexpr int kMost = 2 * R.menRows * R.half();
        Features f = featuresOf<R>(p);
        float few = float(kMost - std::min(f.pieces, kMost)) / kMost;
        for (int c = 0; c < kCounts; ++c) {
            if (!f.counts[c] || (!R.flying && (c == firstKing || c == longDiagonal))) continue;
            float x = float(f.counts[c]) * (c == advance ? 0.2f : 1);
            take(2 * c, x * (1 - few));
            take(2 * c + 1, x * few);
        }
        auto both = [&](int w, float x) {
            if (x == 0) return;
            take(w, x * (1 - few));
            take(w + L::weights, x * few);
        };
        for (int i = 0; i < L::count; ++i) {
            auto [w, sign] = find(i, f.fields[i]);
            both(w, sign);
        }
        constexpr int kSquares = kCountWeights + L::stored * kFieldSize;
        for (Bits k = p.kings & p.white; k; k &= k - 1) both(kSquares + indexOf(k), 1);
        for (Bits k = p.kings & p.black; k; k &= k - 1) both(kSquares + Board<R.width>::last - indexOf(k), -1);
    }
};

float logistic(float x) { return 1 / (1 + std::exp(-x)); }

// Empty: they cannot be read, as has been told. In random order.
std::vector<Sample> readSamples(const char* file) {
    std::vector<Sample> samples;
    FILE* in = std::fopen(file, "rb");
    if (!in) return std::perror(file), samples;
    Sample s;
    while (std::fread(&s, sizeof s, 1, in) == 1) samples.push_back(s);
    std::fclose(in);
    if (samples.empty()) std::fprintf(stderr, "%s holds no positions: expected what train play writes\n", file);
    std::mt19937_64 random(1);
    std::shuffle(samples.begin(), samples.end(), random);
    return samples;
}

float scoreOf(const Sample& a) { return float(std::int16_t(a.rest >> 48)) / 100; }
auto resultOf(const Sample& a) { return a.rest >> 1 & kUnknown; }

// How well the searches of the old player foretold the results: how much a man was worth to him.
float worthOfMan(const std::vector<Sample>& samples) {
    float slope = 1;
    for (int step = 0; step < 20; ++step) {
        double up = 0, down = 0;
        for (std::size_t k = 0; k < samples.size(); k += 16) {
            auto& a = samples[k];
            if (resultOf(a) == kUnknown) continue;
            float x = scoreOf(a), guess = logistic(slope * x);
            up += x * (float(resultOf(a)) / 2 - guess), down += x * x * guess * (1 - guess);
        }
        slope += float(up / (down + 1));
    }
    std::fprintf(stderr, "%zu positions; one man was %.3f\n", samples.size(), slope);
    return slope;
}

// The search's own score has less noise than the result; the result knows what the search does not. Three to one: measured.
template <const Rules& R> void learn(Model<R>& m, const std::vector<Sample>& samples, float slope) {
    const std::size_t test = samples.size() / 20;           // these are not learnt, but show how good the others make it
    const float kResult = 0.25f, kPull = 2e-4f;
    const int kEpochs = 12;
    for (int epoch = 0; epoch < kEpochs; ++epoch) {
        double loss = 0, tested = 0;
        float rate = 0.05f * float(kEpochs - epoch) / kEpochs;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            auto& a = samples[k];
            Position p{a.white, a.black, a.kings, a.rest & 1 ? Side::black : Side::white};
            float searched = logistic(slope * scoreOf(a));
            float target = resultOf(a) == kUnknown ? searched : searched * (1 - kResult) + kResult * float(resultOf(a)) / 2;
            std::pair<int, float> at[Model<R>::kMostActive];
            int n = 0;
            m.each(p, [&](int w, float x) { at[n++] = {w, x}; });
            float sum = 0;
            for (int i = 0; i < n; ++i) sum += m.weight[at[i].first] * at[i].second;
            float guess = logistic(sum), error = target - guess;
            (k < test ? tested : loss) -= target * std::log(guess + 1e-9) + (1 - target) * std::log(1 - guess + 1e-9);
            if (k < test) continue;
            for (int i = 0; i < n; ++i) {
                auto [w, x] = at[i];
                float pull = w >= m.kCountWeights ? kPull : 0, g = error * x - pull * m.weight[w];
                m.square[w] += g * g;
                m.weight[w] += rate * g / std::sqrt(m.square[w] + 1e-3f);
            }
        }
        std::fprintf(stderr, "epoch %d: loss %.5f, of unseen positions %.5f\n", epoch + 1, loss / double(samples.size() - test),
                     tested / double(test));
    }
}

// Print the weights as evaluate.cpp reads them. Returns the weight of a man.
template <const Rules& R> float printWeights(const Model<R>& m) {
    using L = Fields<R>;
    // A man is 100 points, half way through the game.
    float man = (m.weight[2 * men] + m.weight[2 * men + 1]) / 2, scale = 100 / man;
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
    for (int i = 0; i < 2 * L::weights; ++i) {
        int table = i % L::weights / kFieldSize, index = i % L::weights % kFieldSize, phase = i / L::weights;
        float value = m.weight[m.kCountWeights + i];
        if (table < L::stored && L::partner(L::field(table)) == L::field(table)) {
            auto [w, sign] = m.find(table, index);
            value = sign * m.weight[w + phase * L::weights];
        }
        int points = int(std::lround(value * scale));
        if (points == 0) {
            ++zeros;
            continue;
        }
        flush();
        std::string text;
        for (; points > 45; points -= 45) text += '}';
        for (; points < -45; points += 45) text += '!';
        put(text + char('O' + points));
    }
    flush();
    std::printf("\n)weights\"\n");
    return man;
}

template <const Rules& R> int fit(const char* file, const char* how) {
    const std::vector<Sample> samples = readSamples(file);
    if (samples.empty()) return 1;
    Model<R> m;
    learn(m, samples, worthOfMan(samples));
    const float man = printWeights(m);
    std::printf("// %s: %zu positions. %s One man: %.2f of the logarithm of the odds.\n", R.name, samples.size(), how, man);
    return 0;
}

struct Player {
    Limits limits;
    SearchSettings settings;
    Transpositions table{16 << 20};
};

// A position after some random moves, that is fair.
template <const Rules& R> Position opening(std::mt19937_64& random) {
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
}

// Half points of the first player.   first: the colour that he has;   endgames: null: without.
template <const Rules& R> int game(Player (&players)[2], const Endgames* endgames, Position p, Side first) {
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
}

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
    int points[3] = {};
    double sum = 0, squares = 0;
    for (int pair = 0; pair < games / 2; ++pair) {
        Position p = opening<R>(random);
        int one = game<R>(players, endgames.get(), p, Side::white), two = game<R>(players, endgames.get(), p, Side::black);
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
