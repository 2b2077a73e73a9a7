// fnv.h -- the hash FNV-1a (Fowler, Noll, Vo; RFC 9923). No secret: it tells contents apart. Header only: engine and snapshot library
// stand alone.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sorma {

// Word: std::uint64_t or std::uint32_t, the size of the hash.
template <class Word = std::uint64_t> class Fnv {
    static constexpr bool kLong = sizeof(Word) == 8;
    static constexpr Word kBegin = static_cast<Word>(kLong ? 0xcbf29ce484222325u : 2166136261u);
    static constexpr Word kPrime = static_cast<Word>(kLong ? 0x100000001b3u : 16777619u);

public:
    explicit Fnv(Word before = kBegin) : value_(before) {}
    void add(Word word) { value_ = (value_ ^ word) * kPrime; }      // a byte; or more at a time, which is another hash
    void add(const void* bytes, std::size_t n) {
        for (auto* p = static_cast<const unsigned char*>(bytes); n > 0; --n) add(Word(*p++));
    }
    Word value() const { return value_; }

private:
    Word value_;
};

}  // namespace sorma
