#include "callee.h"

namespace bench {

namespace {

class Implementation final : public Plain {
public:
    void call() override {}
    void copy(const double* in, double* out) override {
        for (int i = 0; i < 10; ++i) out[i] = in[i];
    }
    void add(double* values, std::size_t n) override {
        for (std::size_t i = 0; i < n; ++i) values[i] += 1;
    }
};

class Adder : public sorma::Service {
public:
    void exec(sorma::Message& m) override {
        for (double& x : m.floats) x += 1;
    }
};

}  // namespace

void plainFunction() { asm volatile(""); }

Plain::~Plain() = default;

std::unique_ptr<Plain> makePlain() { return std::make_unique<Implementation>(); }

sorma::Class describeAdder() {
    return sorma::Class::of<Adder>("adder", "adds 1 to each of ten numbers")
        .reads(sorma::Field::floats, sorma::exactly(10), "1", "numbers")
        .writes(sorma::Field::floats, sorma::exactly(10), "1", "numbers plus 1")
        .example("adder EXEC FMSG 10 0 1 2 3 4 5 6 7 8 9");
}

}  // namespace bench
