// main.cpp -- bench: how fast each way of calling is, beside the least that it could cost.
//
//     bench ?--json? ?--rounds N? ?--rows GLOB ...?
//     bench --client ADDRESS nop|rec
//
// doc/benchmark.md says what is measured and how.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "rows.h"

#include "tcl/tclShim.h"

namespace {

using namespace bench;

const char* const kUsage =
    "usage: bench ?--json? ?--rounds N? ?--rows GLOB ...?\n"
    "       bench --client ADDRESS nop|rec\n";
const char* const kHelp =
    "  --json          an array of objects instead of the table\n"
    "  --rounds N      how often each row is measured, default 9\n"
    "  --rows GLOB ... only these rows, as 'P_*' STREAM or P_unix,STREAM; doc/benchmark.md lists them\n"
    "  --client        20 000 calls of one daemon: p50 and p99 in us, calls/s\n";

// BENCH_CXXFLAGS: as this program and the libraries were compiled. The last -O counts.
bool optimized(std::string_view flags) {
    auto at = flags.rfind("-O");
    return at != flags.npos && (flags.substr(at, 3) == "-O2" || flags.substr(at, 3) == "-O3");
}

// Words, and parts of words between commas.
void addPatterns(std::string_view word, std::vector<std::string>& out) {
    while (!word.empty()) {
        auto end = std::min(word.find(','), word.size());
        if (end > 0) out.emplace_back(word.substr(0, end));
        word.remove_prefix(std::min(end + 1, word.size()));
    }
}

void (*const kGroups[])(Table&) = {byReference, tclCommand, textDispatch, protectedCall,
#ifdef HAVE_OPENSSL
                                    secureCall,
#endif
                                    asynchronous, snapshot, recording, cycle, circuit,
#ifdef HAVE_EIGEN
                                    laboratory,
#endif
#ifdef HAVE_VISION
                                    vision,
#endif
                                    model, windows, growth};

int table(std::vector<std::string> patterns, int rounds, bool json) {
    if (!optimized(BENCH_CXXFLAGS))
        std::fprintf(stderr, "bench: built with \"%s\", not with -O2: \"NO\" in the column target means nothing\n", BENCH_CXXFLAGS);
    catchSignals();
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    pin(0, cpus().first);
    Table rows(std::move(patterns), rounds, json);
    bool failed = false;
    for (auto* group : kGroups) {
        try {
            group(rows);
        } catch (const Interrupted&) {
            rows.finish();              // those that are finished
            std::fputs("bench: interrupted\n", stderr);
            return 130;
        } catch (const std::exception& e) {
            std::fprintf(stderr, "bench: %s\n", e.what());
            failed = true;
        }
    }
    const auto unknown = rows.unmatched();
    const bool whole = (rows.empty() && !unknown.empty()) || rows.finish();
    if (!unknown.empty() && !failed) {
        for (auto& pattern : unknown) std::fprintf(stderr, "bench: no row is named \"%s\"; doc/benchmark.md lists them\n", pattern.c_str());
        return 2;
    }
    return whole && !failed ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    Tcl_FindExecutable(argv[0]);
    std::vector<std::string> patterns;
    int rounds = 9;
    bool json = false;
    for (int i = 1; i < argc; ++i) {
        std::string word = argv[i];
        if (word == "--client" && i == 1 && argc == 4) return client(argv[2], argv[3]);
        if (word == "--json") {
            json = true;
        } else if (word == "--rounds" && i + 1 < argc && std::atoi(argv[i + 1]) > 0) {
            rounds = std::atoi(argv[++i]);
        } else if (word == "--rows" && i + 1 < argc) {
            while (i + 1 < argc && std::string_view(argv[i + 1]).substr(0, 2) != "--") addPatterns(argv[++i], patterns);
        } else if (word == "--help" && argc == 2) {
            std::printf("%s%s", kUsage, kHelp);
            return 0;
        } else {
            std::fputs(kUsage, stderr);
            return 2;
        }
    }
    if (patterns.empty()) patterns.push_back("*");
    return table(std::move(patterns), rounds, json);
}
