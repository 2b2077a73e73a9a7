// circuit.cpp -- what wires cost, beyond the work of the units that they join.
#include "rows.h"

#include "interpreter.h"

namespace bench {

namespace {

constexpr int kUnits = 100;
constexpr int kChainWires = kUnits + 1, kSumWires = 2 * kUnits + 1;

const std::vector<Case> kCases = {
    {.row = "CIRCUIT", .what = "a wire of 101 that join 100 gains in a row", .floor = "the same gains in a loop", .mostMore = 3, .per = kChainWires},
    {.row = "CIRCUIT_sum", .what = "a wire of 201 that join 100 sums of two", .floor = "the same sums in a loop", .mostMore = 3, .per = kSumWires},
    {.row = "CIRCUIT_wide", .what = "a wire of 100 floats, of 101 that join 100 gains", .floor = "the same gains in a loop", .per = kChainWires},
};

std::string unit(const std::string& name, int i) { return name + std::to_string(i); }

// gain after gain; width elements on each wire.
std::string chain(const std::string& name, int width) {
    std::string wires = "in[0:" + std::to_string(width - 1) + "] -> " + unit(name, 0) + ".in";
    for (int i = 1; i < kUnits; ++i) wires += "; " + unit(name, i - 1) + ".out -> " + unit(name, i) + ".in";
    return wires + "; " + unit(name, kUnits - 1) + ".out -> out";
}

// Each sum adds the two before it.
std::string sums(const std::string& name) {
    auto before = [&](int i, int back) { return i < back ? "in[" + std::to_string(back - 1 - i) + "]" : unit(name, i - back) + ".out"; };
    std::string wires;
    for (int i = 0; i < kUnits; ++i)
        wires += before(i, 1) + " -> " + unit(name, i) + ".in1; " + before(i, 2) + " -> " + unit(name, i) + ".in2; ";
    return wires + unit(name, kUnits - 1) + ".out -> out";
}

}  // namespace

void circuit(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    auto measure = [&](const Case& of, const std::string& name, const std::string& units, const std::string& wires, std::size_t in,
                       std::size_t unitIn) {
        if (!table.wants(of.row)) return;
        interpreter.eval(name + " CTRL -wires {" + wires + "}");
        auto whole = interpreter.sorm().get(name);
        std::vector<sorma::Reference> parts;
        for (int i = 0; i < kUnits; ++i) parts.push_back(interpreter.sorm().get(unit(units, i)));
        std::vector<sorma::Message> messages(kUnits);
        for (auto& m : messages) m.floats.assign(unitIn, 0.5);
        sorma::Message m;
        table.measure(of,
                      repeat([&] {
                          m.floats.resize(in, 0.5);
                          whole.step(m, nullptr);
                          keep(m);
                      }),
                      repeat([&] {
                          for (int i = 0; i < kUnits; ++i) {
                              auto& own = messages[std::size_t(i)];
                              own.floats.resize(unitIn, 0.5);
                              parts[std::size_t(i)].step(own, nullptr);
                          }
                          keep(messages[0]);
                      }));
    };
    measure(kCases[0], "circuit.chain", "gain.c", chain("gain.c", 1), 1, 1);
    measure(kCases[1], "circuit.sums", "sum.s", sums("sum.s"), 2, 2);
    measure(kCases[2], "circuit.wide", "gain.w", chain("gain.w", 100), 100, 100);
}

}  // namespace bench
