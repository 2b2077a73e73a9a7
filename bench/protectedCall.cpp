// protectedCall.cpp -- calls into another process: a blocking C++ client, or a script, and sormad.
#include "rows.h"

#include <unistd.h>

#include <cstring>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "interpreter.h"
#include "process.h"
#include "remote.h"

namespace bench {

namespace {

constexpr int kInFlight = 64, kBig = 200'000, kRounds = 4;      // kRounds: windows in one operation
constexpr std::int64_t kBatch = 1'000'000;
constexpr const char* kRaw = "raw ping-pong of as many bytes, blocking";
constexpr const char* kRawMany = "raw sockets, 64 in flight";
constexpr const char* kRawBig = "raw transfer and byte swap";
constexpr const char* kCopies = "memcpy of them, four times";
constexpr const char* kRawPieces = "raw sockets, as many bytes, 4 in flight";
constexpr std::size_t kPiece = 256 << 10;      // [bytes] of a stream

const std::vector<Case> kPairs = {
    {"P_unix", "call, empty; one CPU", kRaw, 1.25, 0, 0, 1, kBatch},
    {"P_tcp", "call, empty; one CPU", kRaw, 1.25, 0, 0, 1, kBatch},
    {"P10_unix", "call, text and 10 floats; one CPU", kRaw, 1.4, 0, 0, 1, kBatch},
    {"P10_tcp", "call, text and 10 floats; one CPU", kRaw, 1.4, 0, 0, 1, kBatch},
    {"P_unix_2cpu", "call, empty; two CPUs", kRaw, 1.25, 0, 0, 1, kBatch},
    {"P_tcp_2cpu", "call, empty; two CPUs", kRaw, 1.25, 0, 0, 1, kBatch},
    {"P10_unix_2cpu", "call, text and 10 floats; two CPUs", kRaw, 1.4, 0, 0, 1, kBatch},
    {"P10_tcp_2cpu", "call, text and 10 floats; two CPUs", kRaw, 1.4, 0, 0, 1, kBatch},
};
constexpr std::int64_t kTailBatch = 20'000'000;        // [ns]: 1000 calls and more, of which ten are later than the figure
// By memory that both share. Where each has a CPU, the targets are times.
const std::vector<Case> kShared = {
    {"P_shm", "call by memory, empty; one CPU", kRaw, 0.9, 0, 0, 1, kBatch},
    {"P_shm_2cpu", "call by memory, empty; two CPUs", kRaw, 0, 1000, 0, 1, kBatch},
    {"P10_shm_2cpu", "call by memory, text and 10 floats; two CPUs", kRaw, 0, 1600, 0, 1, kBatch},
    {"P99_shm_2cpu", "99th percentile of calls by memory; two CPUs", "that of raw ping-pong", 0, 3000, 0, 1, kTailBatch, 30},
};
const std::vector<Case> kSharedPipes = {
    {"PIPE_shm", "64 calls by memory in flight, empty; two CPUs", kRawMany, 0, 250, 0, kInFlight * kRounds, kBatch},
    {"PIPE10_shm", "64 by memory in flight, text and 10 floats; two CPUs", kRawMany, 0, 400, 0, kInFlight * kRounds, kBatch},
};
constexpr int kLearning = 2000;                 // calls after the daemon has another processor
const Case kSharedScript = {"PT_shm", "Tcl script by memory: nop@robot EXEC; two CPUs", "P_shm_2cpu", 0, 2500, 0, Interpreter::kUnrolled, kBatch};
const Case kSharedBig = {"BIG_shm", "200 000 floats there and back by memory; two CPUs", kCopies, 1.2, 0, 0, 1, kBatch, 20};
const Case kIdle = {"P_unix_idle", "call, empty, after 5 ms of silence; one CPU", kRaw, 0, 0, 0, 1, kBatch, 20};
const std::vector<Case> kTails = {
    {"P99_unix", "99th percentile of empty calls; one CPU", "that of raw ping-pong", 1.3, 0, 0, 1, kTailBatch, 30},
    {"P99_tcp", "99th percentile of empty calls; one CPU", "that of raw ping-pong", 1.3, 0, 0, 1, kTailBatch, 30},
};
const std::vector<Case> kPipes = {
    {"PIPE_unix", "64 calls in flight, empty; one CPU", kRawMany, 0, 0, 0, kInFlight * kRounds, kBatch},
    {"PIPE_tcp", "64 calls in flight, empty; one CPU", kRawMany, 0, 0, 0, kInFlight * kRounds, kBatch},
    {"PIPE10_unix", "64 in flight, text and 10 floats; one CPU", kRawMany, 0, 0, 0, kInFlight * kRounds, kBatch},
    {"PIPE10_tcp", "64 in flight, text and 10 floats; one CPU", kRawMany, 0, 0, 0, kInFlight * kRounds, kBatch},
};
const std::vector<Case> kScripts = {
    {"PT_unix", "Tcl script: nop@robot EXEC; one CPU", "P_unix", 0, 0, 1000, Interpreter::kUnrolled, kBatch},
    {"PT10_unix", "Tcl script: echo@robot EXEC TMSG .. FMSG 10 ..", "P10_unix", 0, 0, 0, Interpreter::kUnrolled, kBatch},
};
const Case kSteps = {"PT_pipe", "Tcl script: sorma::pipe of three steps, empty", "PT_unix: one call", 1.3, 0, 0, Interpreter::kUnrolled, kBatch};
const std::vector<Case> kBigs = {
    {"BIG_unix", "200 000 floats there and back; one CPU", kRawBig, 1.5, 0, 0, 1, kBatch, 20},
    {"BIG_tcp", "200 000 floats there and back; one CPU", kRawBig, 1.5, 0, 0, 1, kBatch, 20},
};

// Long batches: the first pieces of each have come while the floor was measured.
constexpr std::int64_t kPiecesBatch = 30 * kBatch;
const std::vector<Case> kPieces = {
    {"PIECES_unix", "a piece of a stream, 256 kB; one CPU", kRawPieces, 0, 0, 0, 1, kPiecesBatch, 10},
    {"PIECES_tcp", "a piece of a stream, 256 kB; one CPU", kRawPieces, 0, 0, 0, 1, kPiecesBatch, 10},
};

std::vector<Case> allCases() {
    std::vector<Case> all = kPairs;
    all.push_back(kIdle);
    all.push_back(kSteps);
    all.push_back(kSharedScript);
    all.push_back(kSharedBig);
    for (auto* more : {&kShared, &kSharedPipes, &kTails, &kPipes, &kScripts, &kBigs, &kPieces}) all.insert(all.end(), more->begin(), more->end());
    return all;
}

Body afterSilence(std::function<void()> call) {
    return [call](std::int64_t count) {
        std::int64_t spent = 0;
        for (; count > 0; --count) {
            usleep(5000);
            std::int64_t start = now();
            call();
            spent += now() - start;
        }
        return spent;
    };
}

// Its time is that of as many calls which all take as long as the 99th percentile.
Body tail(std::function<void()> call) {
    return [call, times = std::vector<double>()](std::int64_t count) mutable {
        times.clear();
        for (std::int64_t n = 0, last = now(); n < count; ++n) {
            call();
            std::int64_t after = now();
            times.push_back(double(after - std::exchange(last, after)));
        }
        return std::int64_t(quantile(times, 0.99) * double(count));
    };
}

// A loop of calls in a script.
Body scripted(Interpreter& interpreter, const std::string& call) {
    return [&interpreter, loop = interpreter.loop(call)](std::int64_t count) {
        const std::int64_t start = now();
        interpreter.run(loop, count);
        return now() - start;
    };
}

// As many calls by a C++ client.
Body manyCalls(Remote& remote, int per) {
    return [&remote, per](std::int64_t count) {
        const std::int64_t start = now();
        for (std::int64_t n = count * per; n > 0; --n) remote.call();
        return now() - start;
    };
}

void calls(Table& table, Bus& bus, const Daemon& daemon, const std::vector<Case>& cases) {
    for (auto& c : cases) {
        if (!table.wants(c.row)) continue;
        bool tcp = named(c, "tcp"), two = named(c, "2cpu"), idle = named(c, "idle");
        int cpu = two ? cpus().second : cpus().first;
        pin(daemon.process(), cpu);
        Remote remote(bus, tcp ? daemon.tcpAddress() : daemon.unixAddress(), named(c, "P10"));
        RawServer raw(tcp ? Kind::tcp : Kind::unixSocket, cpu, remote.requestSize(), remote.replySize());
        // Both ends learn anew whether it pays to look before they sleep (comm/spinner.h).
        for (int n = 0; n < kLearning; ++n) remote.call();
        if (named(c, "P99"))
            table.measure(c, tail([&] { remote.call(); }), tail([&] { raw.call(); }));
        else if (idle)
            table.measure(c, afterSilence([&] { remote.call(); }), afterSilence([&] { raw.call(); }));
        else
            table.measure(c, repeat([&] { remote.call(); }), repeat([&] { raw.call(); }));
        pin(daemon.process(), cpus().first);
    }
}

void pipelines(Table& table, Bus& bus, const Daemon& daemon, const std::vector<Case>& cases) {
    for (auto& c : cases) {
        if (!table.wants(c.row)) continue;
        const bool tcp = named(c, "tcp");
        const int cpu = named(c, "shm") ? cpus().second : cpus().first;
        pin(daemon.process(), cpu);
        Remote remote(bus, tcp ? daemon.tcpAddress() : daemon.unixAddress(), named(c, "PIPE10"));
        RawServer raw(tcp ? Kind::tcp : Kind::unixSocket, cpu, remote.requestSize(), remote.replySize());
        // A batch is one stream of calls: the window fills once, and empties once.
        auto row = [&](std::int64_t count) {
            std::int64_t start = now(), left = count * c.per - kInFlight;
            remote.pipeline(kInFlight, [&](std::size_t came) {
                bool go = left > 0;
                if (go) left -= std::int64_t(came);
                return go;
            });
            return now() - start;
        };
        auto floor = [&](std::int64_t count) {
            std::int64_t start = now();
            raw.pipeline(count * c.per, kInFlight);
            return now() - start;
        };
        table.measure(c, row, floor);
        pin(daemon.process(), cpus().first);
    }
}

void scripts(Table& table, Bus& bus, const Daemon& daemon) {
    Interpreter interpreter;
    interpreter.eval("sorma::configure -transport unix");
    auto measure = [&](const Case& c, const std::string& call, bool record) {
        if (!table.wants(c.row)) return;
        Remote remote(bus, daemon.name(), record);
        table.measure(c, scripted(interpreter, call), manyCalls(remote, c.per));
    };
    measure(kScripts[0], "nop@" + daemon.name() + " EXEC", false);
    std::string ten = "echo@" + daemon.name() + " EXEC TMSG {sixteen letters!} FMSG 10";
    for (int i = 0; i < 10; ++i) ten += " [expr {1 / (" + std::to_string(i) + " + 3.0)}]";
    measure(kScripts[1], interpreter.eval("return [subst {" + ten + "}]"), true);
    if (!table.wants(kSteps.row)) return;
    const std::string call = "nop@" + daemon.name() + " EXEC", step = " {" + call + "}";
    table.measure(kSteps, scripted(interpreter, "sorma::pipe" + step + step + step), scripted(interpreter, call));
}

// The numbers copied as often as they have to be on their way there and back: into shared memory and out of it, twice.
Body copies(const std::vector<double>& values) {
    std::vector<std::vector<double>> at(4, std::vector<double>(values.size()));
    return repeat([&values, at = std::move(at)]() mutable {
        const double* from = values.data();
        for (auto& to : at) {
            std::memcpy(to.data(), from, values.size() * sizeof(double));
            from = to.data();
            asm volatile("" : : "r"(from) : "memory");      // it is needed
        }
    });
}

void bigOnes(Table& table, Bus& bus, const Daemon& daemon, const std::vector<Case>& cases) {
    for (auto& c : cases) {
        if (!table.wants(c.row)) continue;
        bool tcp = named(c, "tcp");
        auto echo = bus.sorm.get("echo@" + (tcp ? daemon.tcpAddress() : daemon.unixAddress()));
        sorma::Message m;
        for (int i = 0; i < kBig; ++i) m.floats.push_back(i + 1 / 3.0);
        std::vector<double> expected = m.floats, values = m.floats;
        if (std::string_view(c.row) == kSharedBig.row) {
            table.measure(c, repeat([&] { echo.exec(m); }), copies(values));
            continue;
        }
        RawServer raw(tcp ? Kind::tcp : Kind::unixSocket, cpus().first, std::size_t(kBig));
        table.measure(c, repeat([&] { echo.exec(m); }), repeat([&] { raw.echo(values); }));
        if (m.floats != expected || values != expected) throw std::runtime_error("BIG: not the numbers that were sent");
    }
}

void pieces(Table& table, Bus& bus, const Daemon& daemon) {
    for (auto& c : kPieces) {
        if (!table.wants(c.row)) continue;
        const bool tcp = named(c, "tcp");
        auto echo = bus.sorm.get("echo.pieces@" + (tcp ? daemon.tcpAddress() : daemon.unixAddress()));
        sorma::Message options, request, piece;
        options.words = {"-times", "1000000000000"};
        echo->invoke(sorma::Method::ctrl, options);
        request.any.resize(kPiece);
        sorma::Reading reading(echo, request);
        RawServer raw(tcp ? Kind::tcp : Kind::unixSocket, cpus().first, 120, kPiece + 160);
        table.measure(c,
                      repeat([&] {
                          if (!reading.next(piece) || piece.any.size() != kPiece) throw std::runtime_error("PIECES: not a whole piece");
                      }),
                      [&](std::int64_t count) {
                          const std::int64_t start = now();
                          raw.pipeline(count, 4);
                          return now() - start;
                      });
    }
}

// The client and the daemon share memory.
void byMemory(Table& table, const Daemon& daemon) {
    if (!table.wantsAny(kShared) && !table.wantsAny(kSharedPipes) && !table.wants(kSharedScript.row) && !table.wants(kSharedBig.row)) return;
    Bus bus;
    bus.comm.settings.sharing = sorma::Sharing::always;
    calls(table, bus, daemon, kShared);
    pipelines(table, bus, daemon, kSharedPipes);
    pin(daemon.process(), cpus().second);
    bigOnes(table, bus, daemon, {kSharedBig});
    if (table.wants(kSharedScript.row)) {
        Interpreter interpreter;
        interpreter.eval("sorma::configure -transport shm");
        Remote remote(bus, daemon.unixAddress(), false);
        table.measure(kSharedScript, scripted(interpreter, "nop@" + daemon.name() + " EXEC"), manyCalls(remote, kSharedScript.per));
    }
    pin(daemon.process(), cpus().first);
}

}  // namespace

void protectedCall(Table& table) {
    std::vector<Case> all = allCases();
    if (!table.wantsAny(all)) return;
    try {
        Folder folder;
        Daemon daemon("bench", cpus().first);
        Bus bus;
        calls(table, bus, daemon, kPairs);
        calls(table, bus, daemon, {kIdle});
        calls(table, bus, daemon, kTails);
        pipelines(table, bus, daemon, kPipes);
        if (table.wantsAny(kScripts) || table.wants(kSteps.row)) scripts(table, bus, daemon);
        bigOnes(table, bus, daemon, kBigs);
        pieces(table, bus, daemon);
        byMemory(table, daemon);
    } catch (const Interrupted&) {
        throw;
    } catch (const std::exception& e) {
        table.failed(all, e.what());
    }
}

}  // namespace bench
