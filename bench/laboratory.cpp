// laboratory.cpp -- what the laboratory's mathematics costs as a service, by reference.
#include "rows.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "interpreter.h"
#include "psom/psom.h"
#include "puma/puma.h"
#include "track/abg.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {.row = "PUMA_inverse", .what = "EXEC inverse of puma by reference, all 8 solutions within limits", .floor = "the function, called directly",
     .mostNs = 900},
    {.row = "PSOM", .what = "EXEC complete of psom by reference, 3x3x3 nodes, 7 components, 4 steps", .floor = "the function, called directly",
     .mostNs = 1000},
    {.row = "TRACK", .what = "EXEC of track by reference: a measurement of three axes at irregular times", .floor = "the filter, called directly",
     .mostNs = 150},
};

void inverse(Table& table, Interpreter& interpreter) {
    interpreter.eval("puma.bench CTRL -task inverse");
    auto puma = interpreter.sorm().get("puma.bench");
    puma::Joints posture;
    posture << 0.1, 0.2, 0.3, 0.4, 0.5, 0.6;
    const puma::Pose pose = puma::forward(posture);
    const puma::Limits limits;
    const puma::Joints weights = puma::Joints::Ones();
    puma::Solutions solutions;
    sorma::Message m;
    table.measure(kCases[0],
                  repeat([&] {
                      m.floats.resize(18);
                      std::copy_n(pose.data(), 12, m.floats.data());
                      std::copy_n(posture.data(), 6, m.floats.data() + 12);
                      puma.exec(m);
                      keep(m);
                  }),
                  repeat([&] {
                      puma::inverse(pose, posture, limits, weights, solutions);
                      keep(solutions);
                  }));
}

void complete(Table& table, Interpreter& interpreter) {
    constexpr std::size_t kComponents = 7;
    // A ball before a camera: its place, then column, row, area and radius in the image.
    std::vector<double> vectors;
    const std::vector<double> nodes = {-1, 0, 1};
    for (double i : nodes)
        for (double j : nodes)
            for (double k : nodes) {
                const double x = 0.06 * i, y = 0.06 * j, z = 0.32 + 0.06 * k;
                vectors.insert(vectors.end(), {x, y, z, 250 + 451 * y / z, 250 + 451 * x / z, 250 / (z * z), 9 / z + 5 * x});
            }
    std::vector<double> weights = {0, 0, 0, 1, 1, 1, 1}, given = {0, 0, 0, 265, 298, 2800, 30}, w(kComponents), s(3);
    psom::Map map({nodes, nodes, nodes}, kComponents);
    map.train(vectors);
    map.setWeights(weights, true);
    const psom::Search search{.tolerance = 0, .steps = 4};

    interpreter.eval("psom.bench CTRL -axes {{-1 0 1} {-1 0 1} {-1 0 1}} -dimension 7 -metric {0 0 0 1 1 1 1} -scale -steps 4 -tolerance 0");
    auto psom = interpreter.sorm().get("psom.bench");
    sorma::Message m;
    m.words = {"train"};
    m.floats = vectors;
    psom.exec(m);
    m.clear();
    table.measure(kCases[1],
                  repeat([&] {
                      m.floats.resize(kComponents);
                      std::copy_n(given.data(), kComponents, m.floats.data());
                      psom.exec(m);
                      keep(m);
                  }),
                  repeat([&] {
                      auto match = map.complete(given, search, w, s);
                      keep(match);
                  }));
}

// A target on a sine, seen every 40 to 110 ms: so the gains are computed for each measurement.
class Seen {
public:
    void next(double* f) {
        pause_ = pause_ > 0.1 ? 0.04 : pause_ + 0.007;
        time_ += pause_;
        const double x = 0.1 * std::sin(2.5 * time_);
        f[0] = time_, f[1] = x, f[2] = -x, f[3] = 0.5 * x;
    }
private:
    double time_ = 0, pause_ = 0.04;
};

void track(Table& table, Interpreter& interpreter) {
    constexpr std::size_t kAxes = 3;
    auto object = interpreter.sorm().get("track.bench");
    sorma::Message m;
    Seen seen, again;
    track::Filter filter(kAxes);
    const track::Settings settings;
    std::array<double, 1 + kAxes> given;
    table.measure(kCases[2],
                  repeat([&] {
                      m.floats.resize(1 + kAxes);
                      seen.next(m.floats.data());
                      object.exec(m);
                      keep(m);
                  }),
                  repeat([&] {
                      again.next(given.data());
                      auto taken = filter.update(settings, given[0], std::span(given).subspan(1));
                      keep(taken);
                  }));
}

}  // namespace

void laboratory(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    if (table.wants(kCases[0].row)) inverse(table, interpreter);
    if (table.wants(kCases[1].row)) complete(table, interpreter);
    if (table.wants(kCases[2].row)) track(table, interpreter);
}

}  // namespace bench
