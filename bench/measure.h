// measure.h -- how every row of the table is taken: a row and its floor side by side, in turns.
//
// A round takes many short batches: one of the row, one of the floor, one of the row, and so on. Its figure is the lower
// quartile of the batches, because other processes only make a batch longer, never shorter. The table shows the
// median over the rounds, and for the ratio also the smallest and the largest of them. Before each batch a sixteenth of
// it runs untimed, so that what the other side left in the caches is not charged.
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace bench {

std::int64_t now();             // [ns], monotonic

// Makes the compiler believe that v is read and changed here.
template <class T> inline void keep(T& v) { asm volatile("" : "+m"(v) : : "memory"); }

// Does so many operations and returns how long they took [ns].
using Body = std::function<std::int64_t(std::int64_t count)>;

// The body that repeats one operation.
template <class Operation> Body repeat(Operation operation) {
    return [operation](std::int64_t count) mutable {
        std::int64_t start = now();
        for (; count > 0; --count) operation();
        return now() - start;
    };
}

// A row as it stands in the table of cases at the top of each file.
struct Case {
    const char* row;                // its name, also for --rows and --json
    const char* what;
    const char* floor = nullptr;    // what it is held against
    double most = 0;                // target: times the floor, 0 = none
    double mostNs = 0;              // target: [ns], 0 = none
    double mostMore = 0;            // target: [ns] above the floor, 0 = none
    int per = 1;                    // calls in one operation of the bodies; the table shows one call
    std::int64_t batch = 200'000;   // [ns] that a batch should take
    int batches = 60;               // in a round
};
inline bool named(const Case& c, std::string_view part) { return std::string_view(c.row).find(part) != std::string_view::npos; }

struct Result {
    Case of;
    double ns = 0, floorNs = 0;             // 0: not measured
    double ratio = 0, low = 0, high = 0;    // median, least and largest of the rounds
    double bytes = 0;                       // rows that are a size, not a time
    double mostBytes = 0;
    std::string error;                      // why there is no figure

    bool met() const;               // every target that it has; true when it has none
    bool hasTarget() const { return of.most > 0 || of.mostNs > 0 || of.mostMore > 0 || mostBytes > 0; }
};

// Thrown out of the middle of a measurement by SIGINT and SIGTERM, so that everything that was started is ended.
struct Interrupted : std::runtime_error {
    Interrupted() : std::runtime_error("interrupted") {}
};

class Table {
public:
    // Rows whose name matches one of the glob patterns, so many rounds. json: collect, and print at the end.
    Table(std::vector<std::string> patterns, int rounds, bool json);

    bool wants(const char* row) const;
    bool wantsAny(const std::vector<Case>& cases) const;

    // Measure a row against its floor; an empty floor: the row alone.
    void measure(const Case& of, const Body& row, const Body& floor = {});
    // A row that is a size in bytes.
    void size(const Case& of, double bytes, double mostBytes);
    // Rows that cannot be measured, and why.
    void failed(const std::vector<Case>& cases, const std::string& why);

    bool empty() const { return results_.empty(); }     // no row was asked for
    std::vector<std::string> unmatched() const;         // the patterns that no row had; ask when all groups have been run
    // The end of the output. Returns false when a row failed.
    bool finish();

private:
    void add(Result result);

    std::vector<std::string> patterns_;
    mutable std::vector<bool> matched_;         // of each pattern: a row has asked for it
    int rounds_;
    bool json_, heading_ = false;
    std::vector<Result> results_;
};

// ---- where processes run ----

// The first two CPUs that this process may use, the same one twice when there is only one.
struct Cpus {
    int first, second;
};
const Cpus& cpus();
void pin(int process, int cpu);     // all threads of a process; 0: this one

double median(std::vector<double> values);
double quantile(std::vector<double> values, double q);

// SIGINT and SIGTERM make measure() throw.
void catchSignals();
void checkSignals();

}  // namespace bench
