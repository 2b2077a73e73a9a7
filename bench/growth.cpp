// growth.cpp -- costs that must not grow: each row beside itself with little around it.
#include "rows.h"

#include <memory>
#include <string>
#include <vector>

#include "interpreter.h"
#include "process.h"
#include "remote.h"

namespace bench {

namespace {

constexpr int kObjects = 100'000, kEntries = 10'000, kConnections = 1'000;
constexpr double kMostBytes = 20'000;           // of a daemon's memory for an idle connection
constexpr const char* kFew = "the same among 10 objects, no entries";
constexpr const char* kAlone = "the same without them";
constexpr std::int64_t kBatch = 1'000'000;

const std::vector<Case> kInside = {
    {"T_many", "nop EXEC among 100 000 objects, 10 000 dictionary entries", kFew, 1.2, 0, 0, Interpreter::kUnrolled},
    {"S_many", "text dispatch among 100 000 objects, 10 000 entries", kFew, 1.2},
};
const Case kProtected = {"P_unix_many", "call, 1000 idle connections and 100 000 objects; one CPU", kAlone, 1.2, 0, 0, 1, kBatch};
const Case kIdle = {"IDLE", "an idle connection, memory of the daemon"};

// Objects and entries that nobody calls.
const std::string kCrowd = "package require sorma\n"
                           "for {set i 0} {$i < " + std::to_string(kObjects) + "} {incr i} {sorma::create nop.crowd$i}\n"
                           "for {set i 0} {$i < " + std::to_string(kEntries) + "} {incr i} {\n"
                           "    sorma::so::dict CTRL -add foo.entry$i {-breakfast -where kitchen -tempo presto}\n"
                           "}\n";

void inside(Table& table) {
    if (!table.wantsAny(kInside)) return;
    Interpreter few, many;
    many.eval(kCrowd);
    std::string fewLoop = few.loop("nop EXEC"), manyLoop = many.loop("nop EXEC");
    auto running = [](Interpreter& i, const std::string& loop) -> Body {
        return [&i, loop](std::int64_t count) {
            std::int64_t start = now();
            i.run(loop, count);
            return now() - start;
        };
    };
    table.measure(kInside[0], running(many, manyLoop), running(few, fewLoop));
    std::string reply;
    auto dispatching = [&reply](Interpreter& i) {
        return repeat([&i, &reply] {
            i.sorm().dispatch("nop EXEC", reply);
            keep(reply);
        });
    };
    table.measure(kInside[1], dispatching(many), dispatching(few));
}

void outside(Table& table) {
    if (!table.wants(kProtected.row) && !table.wants(kIdle.row)) return;
    Folder folder;
    Daemon plain("plain", cpus().first);
    Daemon crowded("crowded", cpus().first, {"-script", folder.file("crowd.tcl", kCrowd)});
    Bus bus;
    Remote alone(bus, plain.unixAddress(), false), among(bus, crowded.unixAddress(), false);
    double before = crowded.residentBytes();
    struct Idle {
        Bus bus;
        Remote remote;
        explicit Idle(const std::string& address) : remote(bus, address, false) { remote.call(); }
    };
    std::vector<std::unique_ptr<Idle>> idle;
    for (int i = 0; i < kConnections; ++i) idle.push_back(std::make_unique<Idle>(crowded.unixAddress()));
    table.size(kIdle, (crowded.residentBytes() - before) / kConnections, kMostBytes);
    table.measure(kProtected, repeat([&] { among.call(); }), repeat([&] { alone.call(); }));
}

}  // namespace

void growth(Table& table) {
    inside(table);
    outside(table);
}

}  // namespace bench
