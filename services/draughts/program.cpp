// sorma-draughts -- the engine for other draughts programs: Hub protocol on standard input and output; and perft.
#include <charconv>
#include <cstdio>
#include <cstring>
#include <iostream>

#include "draughts/hub.h"

using namespace draughts;

namespace {

int usage(FILE* to = stderr) {
    std::fputs("usage: sorma-draughts                              speaks the Hub protocol, version 2\n"
               "       sorma-draughts perft VARIANT DEPTH ?FEN?    VARIANT: intl, braz, or engl\n", to);
    return to == stderr ? 2 : 0;
}

int runPerft(int argc, char** argv) {
    const Rules* rules = findGame(argv[2]);
    int depth = 0;
    auto [end, error] = std::from_chars(argv[3], argv[3] + std::strlen(argv[3]), depth);
    if (!rules || error != std::errc() || *end || depth < 0 || depth > 99) {
        std::fprintf(stderr, "sorma-draughts: expected intl, braz or engl and a depth 0 .. 99, got %s %s\n", argv[2], argv[3]);
        return usage();
    }
    try {
        Position p = argc == 5 ? parseFen(*rules, argv[4]) : startPosition(*rules);
        std::printf("%llu\n", static_cast<unsigned long long>(perft(*rules, p, depth)));
    } catch (const std::exception& e) {
        std::fprintf(stderr, "sorma-draughts: %s\n", e.what());
        return 1;
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 1 && std::strcmp(argv[1], "perft") == 0 && (argc == 4 || argc == 5)) return runPerft(argc, argv);
    if (argc == 2 && std::strcmp(argv[1], "--help") == 0) return usage(stdout);
    if (argc > 1) return usage();
    Hub hub([](const std::string& line) {
        std::fputs((line + "\n").c_str(), stdout);
        std::fflush(stdout);
    });
    std::string line;
    while (std::getline(std::cin, line))
        if (!hub.line(line)) return 0;
    hub.finish();       // end of input is quit
    return 0;
}
