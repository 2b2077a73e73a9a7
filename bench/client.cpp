// client.cpp -- bench --client ADDRESS nop|rec: one line "p50_us p99_us calls_per_s", for comparisons with others.
//
// CALLS (20000) blocking calls in one thread, each timed, after WARMUP (3000) untimed ones; then for WINDOW_MS (1000)
// milliseconds OUTSTANDING (64) calls in flight, whose rate is the third figure; WINDOW_MS=0 leaves it out: "-".
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "remote.h"
#include "rows.h"

namespace bench {

namespace {

long setting(const char* name, long otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atol(text) : otherwise;
}

}  // namespace

int client(const std::string& address, const std::string& payload) {
    if (payload != "nop" && payload != "rec") return std::fprintf(stderr, "bench: the payload is nop or rec\n"), 2;
    long calls = std::max(1L, setting("CALLS", 20'000)), warmUp = setting("WARMUP", 3000);
    long inFlight = setting("OUTSTANDING", 64), window = setting("WINDOW_MS", 1000);
    try {
        Bus bus;
        Remote remote(bus, address, payload == "rec");
        for (long i = 0; i < warmUp; ++i) remote.call();
        std::vector<double> times(static_cast<std::size_t>(calls));
        std::int64_t before = now();
        for (auto& t : times) {
            remote.call();
            std::int64_t after = now();
            t = double(after - before) / 1e3;
            before = after;
        }
        double p50 = quantile(times, 0.5), p99 = quantile(times, 0.99);
        if (window <= 0 || inFlight <= 0) return std::printf("%.2f %.2f -\n", p50, p99), 0;

        std::int64_t start = now(), end = start + window * 1'000'000, last = start;
        std::size_t done = 0;
        remote.pipeline(static_cast<std::size_t>(inFlight), [&](std::size_t came) {
            done += came;
            last = now();
            return last < end;
        });
        std::printf("%.2f %.2f %.0f\n", p50, p99, double(done) * 1e9 / double(last - start));
    } catch (const std::exception& e) {
        std::fprintf(stderr, "bench: %s\n", e.what());
        return 1;
    }
    return 0;
}

}  // namespace bench
