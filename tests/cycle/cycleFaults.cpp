// cycleFaults.cpp FOLDER COUNT -- which command is in the buffer at the end of a tick in which something went wrong?
//
// FOLDER has the modules cycle and shmem. Steps of a cycle hang, fail and take too long, COUNT times in all. Each fault comes
// at each place of several orders, before and after the command is written, by a step of its own or inside of a larger one. The
// first step of the next tick looks at the snapshot buffer: after such a tick the safe command must be there. Meanwhile the
// SORM's thread asks the steps, and gives the cycle new plans.
//
// Prints "ok" and how many of each there were, or what went wrong. CI runs it under ThreadSanitizer, too.
#include <dlfcn.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "comm/comm.h"
#include "shmem/ring.h"
#include "sorma.h"

using namespace sorma;

namespace {

constexpr double kPeriod = 0.001, kWatchdog = 0.003;    // [s]
constexpr double kTooLong = 0.0013, kHang = 0.0045;
constexpr double kSafe = 0;

enum Kind { kThrow, kOverrun, kHanging, kKinds };
const char* const kNames[kKinds] = {"throws", "overruns", "hangs"};

const Prototype kFailed{Severity::error, "TEST FAILED", 1, "{}: failed as it was told to"};

// The fault of this tick, told by the witness; touched in ticks alone, and while the cycle stands still.
struct Injection {
    Kind kind = kThrow;
    std::string step;                   // who does it; empty: nobody
    bool before = false;                // its own work is done
    bool done = false;
} injection;

std::vector<std::string> places;        // steps of the present order
std::uint64_t number = 0;               // of injections, from which all is chosen
std::atomic<int> counts[kKinds];
std::atomic<int> wrong{0};
std::atomic<double> wrongCommand{0};
std::optional<shmem::Reader> buffer;

void pause(double seconds) {
    timespec t{time_t(seconds), long((seconds - double(time_t(seconds))) * 1e9)};
    nanosleep(&t, nullptr);
}

void inject(const std::string& name, bool before) {
    if (injection.done || injection.step != name || injection.before != before) return;
    injection.done = true;
    ++counts[injection.kind];
    if (injection.kind == kThrow) fail(kFailed, name);
    pause(injection.kind == kHanging ? kHang : kTooLong);
}

class Witness : public Service {
public:
    static Class describe() { return Class::of<Witness>("witness", "looks at the end of the last tick").realtime(); }
    void exec(Message&) override {
        double command = kSafe;
        shmem::Stamp stamp;
        if (injection.done && buffer->latest(&command, nullptr, stamp) == shmem::Outcome::read && command != kSafe) {
            ++wrong;
            wrongCommand = command;
        }
        bool quiet = injection.done || !injection.step.empty();     // one tick without between two with
        injection.done = false;
        injection.step.clear();
        if (quiet || places.empty()) return;
        std::uint64_t n = number++;
        injection.kind = Kind(n % kKinds);
        injection.before = n / kKinds % 2;
        injection.step = places[n / kKinds / 2 % places.size()];
        inject(name(), true);
        inject(name(), false);
    }
};

// A step of its own.
class Work : public Service {
public:
    static Class describe() { return Class::of<Work>("work", "goes wrong").integer("-value", &Work::value_, {}).realtime(); }
    void exec(Message&) override {
        inject(name(), true);
        inject(name(), false);
    }
    std::int64_t value_ = 0;
};

// A step that has the writer of the buffer inside, as a circuit has.
class Outer : public Service {
public:
    static Class describe() {
        return Class::of<Outer>("outer", "writes a command, and goes wrong").service("-writer", &Outer::writer_, {}).realtime();
    }
    void exec(Message& m) override {
        inject(name(), true);
        m.clear();
        m.floats.assign(1, 7);
        writer_.step(m, RealtimeOwner::current());
        inject(name(), false);
    }

private:
    Reference writer_;
};

void load(const std::string& folder, const std::string& name, void* key) {
    std::string path = folder + "/" + name + ".so";
    void* module = dlopen(path.c_str(), RTLD_NOW);
    if (!module) return std::printf("%s\n", dlerror()), std::exit(1);
    std::string init = name + "_Init";
    init[0] = char(init[0] - 'a' + 'A');
    auto* call = reinterpret_cast<int (*)(void*)>(dlsym(module, init.c_str()));
    if (!call || call(key) != 0) std::printf("cannot load %s\n", path.c_str()), std::exit(1);
}

void must(Sorm& sorm, const std::string& request) {
    std::string reply;
    sorm.dispatch(request, reply);
    if (reply.find(" RET 0") != std::string::npos || reply.find(" RET 1") != std::string::npos) return;
    std::printf("%s: %s\n", request.c_str(), reply.c_str());
    std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) return std::fprintf(stderr, "usage: cycleFaults FOLDER COUNT\n"), 2;
    int key = 0;
    Sorm sorm;
    sorm.bindTo(&key);
    Comm comm(sorm);
    for (auto& type : {Witness::describe(), Work::describe(), Outer::describe()}) sorm.add(type);
    load(argv[1], "cycle", &key);
    load(argv[1], "shmem", &key);
    const std::uint64_t total = std::strtoull(argv[2], nullptr, 10);

    std::string segment = "cycleFaults" + std::to_string(getpid()), writer = "shmem_w." + segment;
    must(sorm, "sorm CTRL -create " + writer + " -floats 1");
    buffer.emplace(segment);
    must(sorm, "outer.o CTRL -writer " + writer);
    const std::string live = "'" + writer + " EXEC FMSG 1 7'", safe = "'" + writer + " EXEC FMSG 1 0'";
    struct Order {
        std::string steps;
        std::vector<std::string> places;
    };
    const std::vector<Order> orders = {
        {"witness work.a " + live + " work.b", {"witness", "work.a", "work.b"}},
        {"witness " + live + " work.a work.b", {"witness", "work.a", "work.b"}},
        {"witness work.a work.b " + live, {"witness", "work.a", "work.b"}},
        {"witness outer.o work.a", {"witness", "outer.o", "work.a"}},
        {"witness work.a outer.o", {"witness", "work.a", "outer.o"}},
        {"witness " + live + " outer.o work.a " + live, {"witness", "outer.o", "work.a"}},
    };
    for (std::size_t i = 0; i < orders.size(); ++i) {
        injection = {};
        places = orders[i].places;
        number = 0;
        const std::uint64_t end = total * (i + 1) / orders.size();
        auto done = [&] { return std::uint64_t(counts[kThrow] + counts[kOverrun] + counts[kHanging]); };
        must(sorm, "cycle.x CTRL -period " + std::to_string(kPeriod) + " -watchdog " + std::to_string(kWatchdog) +
                       " -overrun fault -afterFault continue -priority 0 -lockMemory 0 -onfault " + "\"" + writer +
                       " EXEC FMSG 1 0\" -steps \"" + orders[i].steps + "\"");
        must(sorm, "cycle.x CTRL -start");
        std::string reply;
        for (int turn = 0; done() < end; ++turn) {
            sorm.turn(Deadline::in(1));
            // Whether one is refused because a step hangs is not the question here.
            if (turn % 3 == 0) sorm.dispatch("work.a CTRL -value " + std::to_string(turn), reply);
            if (turn % 7 == 0) sorm.dispatch("outer.o DBX -why -writer", reply);
            if (turn % 50 == 0) sorm.dispatch("cycle.x CTRL -afterFault continue", reply);
        }
        must(sorm, "cycle.x CTRL -stop");
    }
    buffer.reset();
    if (wrong > 0) std::printf("%d times another command at the end of the tick, such as %g\n", wrong.load(), wrongCommand.load());
    std::printf(wrong ? "failed" : "ok");
    for (int k = 0; k < kKinds; ++k) std::printf(", %d %s", counts[k].load(), kNames[k]);
    std::printf("\n");
    return wrong ? 1 : 0;
}
