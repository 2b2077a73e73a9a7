// main.cpp -- bench: how fast each way of calling is, beside the least that it could cost.
//
//     bench ?--json? ?--rounds N? ?--rows GLOB?
//     bench --client ADDRESS nop|rec
//
// doc/benchmark.md says what is measured and how.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "rows.h"

#include "tcl/tclShim.h"

namespace {

using namespace bench;

const char* const kUsage =
    "usage: bench ?--json? ?--rounds N? ?--rows GLOB?\n"
    "       bench --client ADDRESS nop|rec\n";

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
                                    model, growth};

int table(const std::string& pattern, int rounds, bool json) {
    catchSignals();
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    pin(0, cpus().first);
    Table rows(pattern, rounds, json);
    bool failed = false;
    for (auto* group : kGroups) {
        try {
            group(rows);
        } catch (const Interrupted&) {
            return 130;
        } catch (const std::exception& e) {
            std::fprintf(stderr, "bench: %s\n", e.what());
            failed = true;
        }
    }
    if (rows.empty() && !failed) {
        std::fprintf(stderr, "bench: no row is named \"%s\"; doc/benchmark.md lists them\n", pattern.c_str());
        return 2;
    }
    return rows.finish() && !failed ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    Tcl_FindExecutable(argv[0]);
    std::string pattern = "*";
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
            pattern = argv[++i];
        } else {
            std::fputs(kUsage, stderr);
            return 2;
        }
    }
    return table(pattern, rounds, json);
}
