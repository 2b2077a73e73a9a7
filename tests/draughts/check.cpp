// check.cpp -- the draughts engine against tables of facts, and against garbage.
//
//     draughtsCheck perft FILE LEAVES         all lines, each as deep as that many leaves allow; moves of each position
//     draughtsCheck endgames FILE [FOLDER]    all lines; then the file of the tables: kept, damaged, cut, of another version
//     draughtsCheck turned GAME NUMBER        evaluation and moves of random positions, seen from both sides
//     draughtsCheck garbage NUMBER SEED       FEN, PDN, moves, Hub positions and Hub lines, half right and wholly wrong
//     draughtsCheck speed GAME DEPTH THREADS  nodes and time of a search from the start
// Prints what was done; every failure is a line beginning "wrong:", and exit code 1.
#include <unistd.h>

#include <chrono>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <random>
#include <set>
#include <sstream>

#include "draughts/camera.h"
#include "draughts/endgames.h"
#include "draughts/evaluate.h"
#include "draughts/game.h"
#include "draughts/hub.h"

using namespace draughts;

namespace {

int failures = 0;
[[gnu::format(printf, 1, 2)]] void wrong(const char* format, ...) {
    std::printf("wrong: ");
    va_list args;
    va_start(args, format);
    std::vprintf(format, args);
    va_end(args);
    std::printf("\n");
    ++failures;
}
double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::vector<std::string> split(const std::string& text, char by) {
    std::vector<std::string> out;
    std::istringstream in(text);
    for (std::string part; std::getline(in, part, by);) out.push_back(part);
    return out;
}

int checkPerft(const char* file, std::uint64_t most) {
    std::ifstream in(file);
    std::uint64_t leaves = 0, cases = 0;
    double begin = now(), seconds = 0;
    for (std::string line; std::getline(in, line);) {
        if (line.empty() || line[0] == '#') continue;
        auto column = split(line, '\t');
        const Rules& rules = *findGame(column[0]);
        Position p = parseFen(rules, column[2]);
        if (parseFen(rules, toFen(rules, p)) != p || parseHub(rules, toHub(rules, p)) != p) wrong("%s: not read back", column[2].c_str());
        int depth = 0;
        for (auto& text : split(column[3], ',')) {
            ++depth;
            std::uint64_t expected = std::strtoull(text.c_str(), nullptr, 10);
            if (expected > most) break;
            double since = now();
            std::uint64_t got = perft(rules, p, depth);
            seconds += now() - since;
            leaves += got;
            ++cases;
            if (got != expected) wrong("%s %s depth %d: %llu", column[0].c_str(), column[1].c_str(), depth, (unsigned long long)got);
        }
        MoveList list;
        generate(rules, p, list);
        std::set<std::string> found;
        for (auto& m : list) {
            found.insert(hubMove(rules, m));
            if (parseMove(rules, p, hubMove(rules, m)) != m) wrong("%s: not read back", hubMove(rules, m).c_str());
            MoveRoute path = routeOf(rules, p, m);
            if (path.squares.empty() || path.squares.front() != squareOf(rules, m.from) || path.squares.back() != squareOf(rules, m.to) ||
                int(path.victims.size()) != countOf(m.captured))
                wrong("%s: no path", hubMove(rules, m).c_str());
            for (bool algebraic : {false, true})
                if (parseMove(rules, p, pdnMove(rules, p, m, algebraic)) != m) wrong("%s: not read back", pdnMove(rules, p, m, algebraic).c_str());
        }
        auto words = split(column[6], ' ');
        if (found != std::set<std::string>(words.begin(), words.end())) wrong("%s %s: moves differ", column[0].c_str(), column[1].c_str());
    }
    std::printf("perft: %llu cases, %llu leaves, %.1f M leaves/s, %.1f s in all\n", (unsigned long long)cases, (unsigned long long)leaves,
                seconds > 0 ? double(leaves) / seconds / 1e6 : 0, now() - begin);
    return 0;
}

void checkFile(const Rules& rules, const Endgames& made, const std::string& folder) {
    std::string file = folder + "/draughts-" + rules.name + ".egt", why;
    if (!made.save(file, why)) wrong("save: %s", why.c_str());
    if (!Endgames::load(rules, file, why)) wrong("load: %s", why.c_str());
    auto refused = [&](const char* what) {
        why.clear();
        if (Endgames::load(rules, file, why) || why.empty()) wrong("%s: taken", what);
        else std::printf("refused, %s: %s\n", what, why.substr(why.find(": ") + 2).c_str());
    };
    auto damage = [&](long at) {
        std::FILE* f = std::fopen(file.c_str(), "r+b");
        std::fseek(f, at, at < 0 ? SEEK_END : SEEK_SET);
        int c = std::fgetc(f);
        std::fseek(f, -1, SEEK_CUR);
        std::fputc(c ^ 1, f);
        std::fclose(f);
    };
    damage(5000000);
    refused("damaged");
    damage(5000000);
    if (!Endgames::load(rules, file, why)) wrong("repaired: %s", why.c_str());
    damage(24);
    refused("of another version");
    damage(24);
    if (truncate(file.c_str(), 1000000)) wrong("truncate");
    refused("cut");
    std::string note;
    auto again = Endgames::provide(rules, file, nullptr, note);
    if (!again || note.empty()) wrong("not computed again: %s", note.c_str());
    unlink(file.c_str());
    refused("missing");
    why.clear();
    if (made.save("/proc/nowhere/x.egt", why)) wrong("saved where nobody can write");
    else std::printf("refused: %s\n", why.c_str());
}

int checkEndgames(const char* file, const char* folder) {
    for (auto* rules : {&kBraz, &kEngl}) {
        double begin = now();
        auto tables = Endgames::compute(*rules, nullptr);
        std::printf("%s: computed in %.1f s\n", rules->name, now() - begin);
        std::ifstream in(file);
        int slices = 0, positions = 0;
        for (std::string line; std::getline(in, line);) {
            auto column = split(line, '\t');
            if (line.empty() || line[0] == '#' || column[1] != rules->name) continue;
            if (column[0] == "slice") {
                ++slices;
                int counts[4];
                for (int i = 0; i < 4; ++i) counts[i] = column[2][std::size_t(i)] - '0';
                long got[4] = {};
                Endgames::eachPosition(*rules, counts, column[3] == "W" ? Side::white : Side::black, [&](const Position& p) {
                    Outcome o;
                    if (!tables->find(p, o)) wrong("not found");
                    ++got[0];
                    ++got[2 - o.value];
                });
                for (int i = 0; i < 4; ++i)
                    if (got[i] != std::atol(column[std::size_t(4 + i)].c_str())) wrong("%s: got %ld", line.c_str(), got[i]);
            } else {
                ++positions;
                Outcome o;
                Position p = parseFen(*rules, column[2]);
                if (!tables->find(p, o) || o.value != (column[3] == "win" ? 1 : column[3] == "loss" ? -1 : 0)) wrong("%s", line.c_str());
                // The distance goes down by one with the best move, down to a loser who cannot move.
                for (int rest = o.distance; o.value && rest > 0; --rest) {
                    MoveList list;
                    generate(*rules, p, list);
                    bool found = false;
                    Position best;
                    for (auto& m : list) {
                        Position n = after(*rules, p, m);
                        Outcome r;
                        if (!n.own()) r = {-1, 0};
                        else tables->find(n, r);
                        if (r.value == -o.value && r.distance == rest - 1) found = true, best = n;
                    }
                    if (!found) {
                        wrong("%s: no way on %d moves before the end", line.c_str(), rest);
                        break;
                    }
                    p = best;
                    o.value = -o.value;
                }
            }
        }
        std::printf("%s: %d slices, %d positions\n", rules->name, slices, positions);
        if (folder) checkFile(*rules, *tables, folder);
    }
    return 0;
}

template <const Rules& R> void checkTurned(int number) {
    std::mt19937_64 random(7);
    int games = 0;
    Position p = startPosition(R);
    for (int i = 0; i < number; ++i) {
        MoveList list, other;
        generate<R>(p, list);
        Position t = turned<R>(p);
        generate<R>(t, other);
        if (turned<R>(t) != p) wrong("%s: turned twice", toFen(R, p).c_str());
        if (list.size() != other.size() || countMoves<R>(p) != list.size()) wrong("%s: moves differ when turned", toFen(R, p).c_str());
        for (bool plain : {false, true}) {
            auto& w = weightsOf(R, plain);
            if (evaluate<R>(w, p) != evaluate<R>(w, t)) wrong("%s: %d, turned %d", toFen(R, p).c_str(), evaluate<R>(w, p), evaluate<R>(w, t));
        }
        bool over = !list.size() || random() % 200 == 0;
        games += over;
        p = over ? startPosition(R) : after<R>(p, list[int(random() % unsigned(list.size()))]);
    }
    std::printf("%s: %d positions of %d games\n", R.name, number, games);
}

// Text that is nearly right: pieces of right texts, with a little damage.
int checkGarbage(long number, unsigned seed) {
    std::mt19937_64 random(seed);
    auto below = [&](std::size_t n) { return std::size_t(random() % n); };
    const char* grains[] = {"W:W31-50:B1-20", "B:WK1,2:BK30,31,32", "W:Wa1,Kc3:Bb8", "[FEN \"W:W31:B5\"]", "[White \"a\\\"b\"]", "[GameType \"26\"]",
                            "1. 32-28 19-23 2. 28x19", "{a comment}", "(1. 11-15)", "$12", "; rest\n", "1/2-1/2", "1-0", "32x21x10", "c3-d4",
                            "11-15", "22-18", "21-17", "0-1", "99-1", "K", ":", "W", "B", ",", "-", "x", ".", "..", "[", "]", "{", "}", "(", ")", "\"",
                            "Wbbbbbbbbbbbbbbbbbbbbeeeeeeeeeewwwwwwwwwwwwwwwwwwww", "Wbbbbbbbbbbbbeeeeeeeewwwwwwwwwwww", "9223372036854775808", "\xff", "\n", " "};
    std::size_t taken = 0;
    for (long i = 0; i < number; ++i) {
        std::string text;
        for (std::size_t n = 1 + below(5); n > 0; --n) {
            text += grains[below(std::size(grains))];
            if (below(3) == 0) text += ' ';
        }
        for (std::size_t n = below(3); n > 0 && !text.empty(); --n) {
            std::size_t at = below(text.size());
            switch (below(3)) {
                case 0: text[at] = char(below(256)); break;
                case 1: text.erase(at, 1 + below(4)); break;
                default: text.insert(at, text.substr(below(text.size()), below(12)));
            }
        }
        const Rules& rules = *kGames[i % 3];
        auto attempt = [&](auto&& work) {
            try {
                work();
                ++taken;
            } catch (const Bad&) {
            } catch (const std::exception& e) {
                wrong("%s threw %s", text.c_str(), e.what());
            }
        };
        attempt([&] {
            Position p = parseFen(rules, text);
            if (parseFen(rules, toFen(rules, p)) != p) wrong("%s: FEN not read back", text.c_str());
            MoveList list;
            generate(rules, p, list);
        });
        attempt([&] {
            Game g = Game::fromPdn(rules, text);
            Game again = Game::fromPdn(rules, g.toPdn());
            if (again.moves() != g.moves() || again.position() != g.position()) wrong("%s: PDN not read back", text.c_str());
        });
        attempt([&] { parseHub(rules, text); });
        attempt([&] { parseMove(rules, startPosition(rules), text); });
        if (i % 16 == 0) attempt([&] { explain(rules, startPosition(rules), text, 'w', 'b'); });
    }
    // Hub lines; a search among them is short.
    std::size_t said = 0;
    Hub hub([&](const std::string&) { ++said; });
    const char* commands[] = {"hub", "init", "new-game", "pos", "level nodes=50", "go think", "go", "stop", "ping", "ponder-hit", "go ponder",
                              "set-param name=variant value=engl", "set-param name=endgames value=false", "set-param name=hash value=1",
                              "pos pos=", "level depth=99 nodes=", "level time=-1", "level nodes=9223372036854775808", "set-param", "moves=\"32-28\""};
    hub.line("hub");
    hub.line("set-param name=endgames value=false");
    hub.line("set-param name=hash value=1");
    for (long i = 0; i < number / 100; ++i) {
        std::string text = commands[below(std::size(commands))];
        if (below(3) == 0) text += grains[below(std::size(grains))];
        if (below(4) == 0) text[below(text.size())] = char(' ' + below(95));
        if (text.find("set-param") == 0 && (text.find("endgames") != text.npos || text.find("threads") != text.npos)) continue;
        hub.line(text);
        if (below(3) == 0) hub.finish();
    }
    hub.finish();
    std::printf("garbage: %ld inputs, %zu taken; Hub: %ld lines, %zu said\n", number, taken, number / 100, said);
    return 0;
}

int measure(const Rules& rules, int depth, int threads) {
    Transpositions table(128 << 20);
    Search search(rules, table);
    std::clock_t begin = std::clock();      // of all threads together: a busy machine does not count
    Progress p = search.run({startPosition(rules)}, {.depth = depth}, {.threads = threads});
    double busy = double(std::clock() - begin) / CLOCKS_PER_SEC;
    std::printf("%s depth %d threads %d: %llu nodes, %.2f s, %.2f M nodes/s; of processors %.2f s, %.2f M nodes/s; score %d\n", rules.name,
                p.depth, threads, (unsigned long long)p.nodes, p.time, double(p.nodes) / p.time / 1e6, busy, double(p.nodes) / busy / 1e6,
                p.score);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    std::string what = argc > 1 ? argv[1] : "";
    if (what == "perft" && argc == 4) checkPerft(argv[2], std::strtoull(argv[3], nullptr, 10));
    else if (what == "endgames" && argc >= 3) checkEndgames(argv[2], argc > 3 ? argv[3] : nullptr);
    else if (what == "turned" && argc == 4 && findGame(argv[2])) {
        forGame(*findGame(argv[2]), [&](auto g) { checkTurned<decltype(g)::rules>(std::atoi(argv[3])); });
    } else if (what == "garbage" && argc == 4) checkGarbage(std::atol(argv[2]), unsigned(std::atoi(argv[3])));
    else if (what == "speed" && argc == 5 && findGame(argv[2])) measure(*findGame(argv[2]), std::atoi(argv[3]), std::atoi(argv[4]));
    else return std::fprintf(stderr, "see tests/draughts/check.cpp\n"), 2;
    return failures ? 1 : 0;
}
