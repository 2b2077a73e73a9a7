// fuzz.h -- for targets that read their input as a program: a byte for the operation, and bytes for its arguments.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>

inline void demand(bool condition, const char* what, std::int64_t value = 0) {
    if (condition) return;
    std::fprintf(stderr, "%s: %lld\n", what, static_cast<long long>(value));
    std::abort();
}

class Input {
public:
    Input(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}
    bool done() const { return at_ == end_; }
    unsigned byte() { return done() ? 0 : *at_++; }         // zeros after the end
    int below(int n) { return int(byte() % unsigned(n)); }

private:
    const std::uint8_t* at_;
    const std::uint8_t* end_;
};
