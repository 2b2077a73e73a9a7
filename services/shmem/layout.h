// layout.h -- the layout of the shared memory of a snapshot buffer; doc/snapshot.md has it as a table.
//
// First a header of five cache lines, then `blocks` blocks; each has a stamp and the data of one record. The first line
// never changes after its magic was written; it says whether a program understands the rest. Numbers are in the byte order
// of the machine.
//
// All that two processes use at the same time is atomic, but for the floats and any of a record: see ring.h.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace shmem {

// The eight bytes "SORMAshm", whatever the byte order.
inline std::uint64_t magic() {
    std::uint64_t word;
    std::memcpy(&word, "SORMAshm", sizeof word);
    return word;
}
inline constexpr std::uint32_t kOrder = 0x01020304;     // another number on a machine of the other byte order
inline constexpr std::uint32_t kLayout = 1;             // version of this layout
inline constexpr std::size_t kLine = 64;                // [bytes] blocks begin on cache lines

// These are fixed when the segment is made.
struct Shape {
    std::uint64_t blocks = 16;      // records that it has, >= 2, since one may be incomplete
    std::uint64_t floats = 1;       // of a record
    std::uint64_t any = 0;          // [bytes] of a record

    bool operator==(const Shape&) const = default;
};
inline constexpr std::uint64_t kMostBlocks = 1'000'000, kMostFloats = 100'000'000, kMostAny = 1'000'000'000;

struct Header {
    // -- line 0: constant --
    std::atomic<std::uint64_t> magic;               // written last: without it the segment is not complete
    std::uint32_t order, layout;
    std::uint64_t size;                             // [bytes] of the whole segment
    std::uint64_t headerBytes, blockBytes;          // where the first block begins, and from one to the next
    std::uint64_t blocks, floats, any;
    // -- line 1 and 2: the writer; it sets them while it has the lock on writing --
    alignas(kLine) std::int64_t created;            // [us] since 1970
    std::atomic<std::int64_t> process;              // number of the process ...
    std::atomic<std::int64_t> started;              // ... and when it began, as /proc/PID/stat counts: no other has both
    std::atomic<std::int64_t> since;                // [us] since 1970, when it became the writer
    std::atomic<std::uint64_t> program[4];          // its name, filled with zeros
    alignas(kLine) std::atomic<std::uint32_t> keep; // not 0: the segment stays when its last user closes it
    // -- line 3: for readers --
    alignas(kLine) std::atomic<std::uint64_t> count;    // complete records; the newest is number `count`, the first is 1
    std::atomic<std::uint32_t> retired;             // not 0: no more records will come; there is a new segment of this name, or none
    // -- line 4: readers that sleep --
    alignas(kLine) std::atomic<std::uint32_t> bell; // futex; changed before they are woken
    std::atomic<std::uint32_t> asleep;              // not 0: a reader may be sleeping
};
static_assert(sizeof(Header) == 5 * kLine && alignof(Header) == kLine);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free && std::atomic<std::uint32_t>::is_always_lock_free);

// Record n lies in block (n - 1) % blocks.
struct Block {
    std::atomic<std::uint64_t> sequence;            // 2n - 1 while record n is being written, 2n when it is complete
    std::atomic<std::int64_t> monotonic;            // [ns] when it was written
    std::atomic<std::int64_t> offset;               // [ns] from the monotonic to the wall clock, as the writer saw it
    std::atomic<std::uint64_t> checksum;            // of number, monotonic, offset, floats and any (ring.cpp); 0: the writer makes none
    // floats, then any

    double* floats() { return reinterpret_cast<double*>(this + 1); }
    unsigned char* any(std::uint64_t count) { return reinterpret_cast<unsigned char*>(floats() + count); }
};
static_assert(sizeof(Block) == 32);

// From one block to the next. No overflow within the limits above.
inline std::uint64_t blockBytes(const Shape& s) {
    return (sizeof(Block) + s.floats * sizeof(double) + s.any + kLine - 1) / kLine * kLine;
}
inline std::uint64_t segmentBytes(const Shape& s) { return sizeof(Header) + s.blocks * blockBytes(s); }

}  // namespace shmem
