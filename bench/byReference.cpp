// byReference.cpp -- calls inside the process, the object in hand.
#include "rows.h"

#include <algorithm>

#include "callee.h"
#include "interpreter.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {"F", "function call through a shared library"},
    {"TO", "EXEC by reference, empty", "virtual call across a shared library", 1.5},
    {"TO_seen", "EXEC by reference, empty, one observer of requests", "virtual call across a shared library"},
    {"TO10", "EXEC by reference, 10 floats in and out", "virtual call, 10 doubles copied in and out", 1.5},
    {"TO10_checked", "the same, signature checked, numbers changed", "virtual call that changes 10 doubles", 1.5},
};

// A caller's work around a call with ten numbers: it puts them where the callee wants them, and takes the result.
struct Numbers {
    double in[10], out[10];
    Numbers() {
        for (int i = 0; i < 10; ++i) in[i] = i + 0.125;
    }
};

// An observer (bus/request.h) that does nothing but count.
struct Counter final : sorma::Observer {
    std::uint64_t came_ = 0, answered_ = 0;
    void came(const sorma::Passage&, const sorma::Message&) override { ++came_; }
    void answered(const sorma::Passage&, const sorma::Message&, std::int64_t) override { ++answered_; }
};

}  // namespace

void byReference(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    sorma::Sorm& sorm = interpreter.sorm();
    sorm.add(describeAdder());
    auto plain = makePlain();

    table.measure(kCases[0], repeat([] { plainFunction(); }));

    sorma::Message empty;
    auto nop = sorm.get("nop");
    table.measure(kCases[1],
                  repeat([&] {
                      nop.exec(empty);
                      keep(empty);
                  }),
                  repeat([&] {
                      plain->call();
                      keep(empty);
                  }));

    Counter counter;
    sorm.observers.add(&counter);
    table.measure(kCases[2],
                  repeat([&] {
                      nop.exec(empty);
                      keep(empty);
                  }),
                  repeat([&] {
                      plain->call();
                      keep(empty);
                  }));
    sorm.observers.remove(&counter);
    nop.exec(empty);

    Numbers numbers;
    double arguments[10], results[10];
    sorma::Message message;
    message.floats.resize(10);
    auto echo = sorm.get("echo");
    table.measure(kCases[3],
                  repeat([&] {
                      std::copy_n(numbers.in, 10, message.floats.data());
                      echo.exec(message);
                      std::copy_n(message.floats.data(), 10, numbers.out);
                      keep(numbers);
                  }),
                  repeat([&] {
                      std::copy_n(numbers.in, 10, arguments);
                      plain->copy(arguments, results);
                      std::copy_n(results, 10, numbers.out);
                      keep(numbers);
                  }));

    auto adder = sorm.get("adder");
    table.measure(kCases[4],
                  repeat([&] {
                      std::copy_n(numbers.in, 10, message.floats.data());
                      adder.exec(message);
                      std::copy_n(message.floats.data(), 10, numbers.out);
                      keep(numbers);
                  }),
                  repeat([&] {
                      std::copy_n(numbers.in, 10, arguments);
                      plain->add(arguments, 10);
                      std::copy_n(arguments, 10, numbers.out);
                      keep(numbers);
                  }));
}

}  // namespace bench
