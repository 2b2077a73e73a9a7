// cycle.cpp -- a cycle: how late its ticks are, what a step costs, how soon a request finds its gap.
#include "rows.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <time.h>

#include <algorithm>
#include <thread>

#include "interpreter.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {.row = "CYCLE_p50", .what = "lateness of a tick every ms, median", .floor = "clock_nanosleep in a thread", .most = 1.1,
     .batch = 8'000'000, .batches = 3},
    {.row = "CYCLE_p99", .what = "the same, 99th percentile", .floor = "clock_nanosleep in a thread", .most = 1.1,
     .batch = 15'000'000, .batches = 3},
    {.row = "CYCLE_step", .what = "a step, one of 100 in a tick", .floor = "the same calls in a loop", .mostMore = 10,
     .batch = 5'000, .batches = 5},
    {.row = "CYCLE_request", .what = "DBX of an object that a cycle runs", .batch = 5'000'000, .batches = 10},
};

constexpr std::int64_t kPeriod = 1'000'000;     // [ns]
constexpr int kSteps = 100;

// Remembers when it was called, and how late the tick was.
class Clock : public sorma::Service {
public:
    static sorma::Class describe() { return sorma::Class::of<Clock>("clock", "remembers when it was called").realtime(); }
    void exec(sorma::Message&) override {
        if (size_ == times.size()) return;
        times[size_] = sorma::monotonicNow();
        due[size_++] = sorma::Tick::current()->time;
    }
    void begin(std::size_t n) {
        times.assign(n, 0);
        due.assign(n, 0);
        size_ = 0;
    }
    std::vector<std::int64_t> times, due;

private:
    std::size_t size_ = 0;
};

std::int64_t quantileOf(std::vector<std::int64_t> values, double q) {
    auto at = values.begin() + std::ptrdiff_t(q * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

// Sleeps on after a signal: a thread that lets an exception out ends the program. The main thread calls checkSignals() afterwards.
void sleepUntil(std::int64_t when) {
    timespec t{time_t(when / 1'000'000'000), long(when % 1'000'000'000)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {}
}

// A program without a cycle: a thread of this priority sleeps until the next time, and works.
template <class Work> void bareLoop(std::int64_t count, Work work) {
    std::thread([&] {
        sched_param parameters{};
        parameters.sched_priority = 50;
        pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
        std::int64_t due = sorma::monotonicNow();
        for (; count > 0; --count) {
            due += kPeriod;
            sleepUntil(due);
            work(due);
        }
    }).join();
}

// Has a cycle make so many ticks.
void run(Interpreter& interpreter, const std::string& name, std::int64_t ticks) {
    interpreter.eval(name + " CTRL -start");
    sleepUntil(sorma::monotonicNow() + (ticks + 3) * kPeriod);
    interpreter.eval(name + " CTRL -stop");
}

}  // namespace

void cycle(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    auto& sorm = interpreter.sorm();
    sorm.add(Clock::describe());
    auto& first = static_cast<Clock&>(*sorm.get("clock.first"));
    auto& last = static_cast<Clock&>(*sorm.get("clock.last"));

    interpreter.eval("cycle.late CTRL -period 0.001 -steps clock.first");
    for (auto [row, q] : {std::pair(0, 0.5), std::pair(1, 0.99)})
        table.measure(kCases[std::size_t(row)],
                      [&, q = q](std::int64_t count) {
                          auto n = std::max<std::int64_t>(count, 100);
                          first.begin(std::size_t(n));
                          run(interpreter, "cycle.late", n);
                          std::vector<std::int64_t> late;
                          for (std::size_t i = 0; i < first.times.size(); ++i)
                              if (first.due[i] != 0) late.push_back(first.times[i] - first.due[i]);
                          return quantileOf(std::move(late), q) * count;
                      },
                      [&, q = q](std::int64_t count) {
                          std::vector<std::int64_t> late;
                          bareLoop(std::max<std::int64_t>(count, 100),
                                   [&](std::int64_t due) { late.push_back(sorma::monotonicNow() - due); });
                          return quantileOf(std::move(late), q) * count;
                      });

    std::string steps = "clock.first";
    std::vector<sorma::Reference> objects;
    std::vector<sorma::Message> messages(kSteps);
    for (int i = 0; i < kSteps; ++i) {
        std::string name = "nop.step" + std::to_string(i);
        steps += " " + name;
        objects.push_back(sorm.get(name));
    }
    interpreter.eval("cycle.many CTRL -period 0.001 -steps {" + steps + " clock.last}");
    table.measure(kCases[2],
                  [&](std::int64_t count) {
                      auto n = std::max<std::int64_t>(count, 50);
                      first.begin(std::size_t(n));
                      last.begin(std::size_t(n));
                      run(interpreter, "cycle.many", n);
                      std::vector<std::int64_t> spans;
                      for (std::size_t i = 0; i < last.times.size(); ++i)
                          if (last.times[i] != 0) spans.push_back(last.times[i] - first.times[i]);
                      return quantileOf(std::move(spans), 0.5) * count / kSteps;
                  },
                  [&](std::int64_t count) {
                      std::vector<std::int64_t> spans;
                      bareLoop(std::max<std::int64_t>(count, 50), [&](std::int64_t) {
                          std::int64_t start = sorma::monotonicNow();
                          for (int i = 0; i < kSteps; ++i) objects[std::size_t(i)]->exec(messages[std::size_t(i)]);
                          spans.push_back(sorma::monotonicNow() - start);
                      });
                      return quantileOf(std::move(spans), 0.5) * count / kSteps;
                  });

    if (!table.wants(kCases[3].row)) return;
    interpreter.eval("cycle.late CTRL -start");
    auto nop = sorm.get("clock.first");
    sorma::Message m;
    table.measure(kCases[3], repeat([&] {
                      m.reset();
                      m.words = {"-version"};
                      nop->invoke(sorma::Method::dbx, m);
                  }));
    interpreter.eval("cycle.late CTRL -stop");
}

}  // namespace bench
