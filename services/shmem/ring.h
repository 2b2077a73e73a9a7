// ring.h -- snapshot buffer: the last records of one writer, in shared memory, for any number of readers.
//
// Installed as <shmem/ring.h>, with a library of its own that needs nothing of SORMA: pkg-config --cflags --libs sorma-shmem.
//
//     shmem::Writer arm("arm", {.blocks = 16, .floats = 6}, "robot");      // makes the segment
//     arm.write(position, nullptr);                                       // each 15 ms
//
//     shmem::Reader reader("arm");                                        // another process; it needs only the key
//     std::vector<double> now(reader.shape().floats);
//     shmem::Stamp stamp;
//     if (reader.latest(now.data(), nullptr, stamp) == shmem::Outcome::read) ...
//
// The writer is wait-free: it never waits for a reader, calls the system only when a reader sleeps, and reads the clock once
// for each record. Readers are lock-free, do not disturb the writer or each other, and get only whole records. Nothing is
// allocated in write, read, latest and view. A writer may be killed at any moment: readers never get an incomplete record,
// and the next writer continues after the last complete one.
//
// The model. Each block has a sequence number, odd while record n is being written (2n - 1), even when it is complete (2n).
// A reader reads it before and after it copies. If it was 2n both times, the reader has the whole record n.
//  1. The writer's 2n - 1 comes before its data: a release fence stands between. The reader's second look comes after
//     its data: an acquire fence stands between. So a reader that has seen any word of record n' > n in the block sees
//     2n' - 1 or more in its second look, and drops its copy.
//  2. The 2n is stored with release, after the data, and loaded with acquire: who sees 2n at first sees the data of record n.
//  3. `count` is stored with release, after 2n: who loads it with acquire finds record `count` complete, or overwritten.
//  4. Numbers never come again: a writer that takes over goes on behind the highest number that is complete. Its
//     predecessor's last stores come before its own, because the kernel hands over the lock in between.
//  5. By the letter of C++ the copy itself is a data race when the record is being overwritten. The copy is dropped then. On all
//     machines memcpy just copies a mixture. Under ThreadSanitizer, which goes by the letter, copies go word by word through atomics,
//     stored with release and loaded with acquire. That also replaces the fences of 1, which it does not know: a reader that loads a
//     word of record n' sees the 2n' - 1 before it. It costs four times a memcpy.
//  6. Going to sleep: a reader sets `asleep` and then looks at `count`; the writer stores `count` and then looks at
//     `asleep`. One of the two must see the other, for which each needs a full barrier in between. The reader's system
//     call membarrier makes all writers execute one just then. So the writer needs none of its own: that would cost
//     more than the rest of a small record. Where the kernel does not offer that, the writer uses a fence, and readers
//     that cannot call it sleep for a millisecond at a time. `asleep` is a mark, not a count, so that a reader which is
//     killed in its sleep costs only one vain system call.
//
//  7. A writer may give each record a checksum. The sequence number tells a reader all that writers of this library do; the checksum
//     tells it what another program has done to the memory. Readers check it where there is one.
//
// Threads: a Writer belongs to one thread at a time; a Reader may be used by several.
#pragma once

#include <time.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "segment.h"

#if defined(__SANITIZE_THREAD__)
#define SHMEM_BY_THE_LETTER 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define SHMEM_BY_THE_LETTER 1
#endif
#endif

namespace shmem {

inline std::int64_t nanoseconds(clockid_t clock = CLOCK_MONOTONIC) {
    timespec t;
    clock_gettime(clock, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

struct Stamp {
    std::uint64_t counter = 0;      // number of the record, from 1
    std::int64_t monotonic = 0;     // [ns] CLOCK_MONOTONIC, when it was written
    std::int64_t wall = 0;          // [us] since 1970; the same instant by the wall clock as the writer last saw it (1 s)
};

enum class Outcome {
    read,
    empty,          // there is no record yet
    overwritten,    // the record is not there any more; latest: it was overwritten kTries times in a row while it was copied
    damaged,        // its data are not what its checksum was made of
};

class Reader;

class Writer {
public:
    // Become the writer of a segment. Fails as Segment::forWriting.
    Writer(const std::string& key, const Shape& shape, const std::string& program, Access access = Access::owner,
           bool keep = false);

    const Shape& shape() const { return segment_->shape(); }
    const std::shared_ptr<Segment>& segment() const { return segment_; }
    std::uint64_t count() const { return count_; }          // records written, those of predecessors included
    Reader reader() const;                                  // of the same memory
    // Give each record a checksum from now on, or none. It costs a nanosecond for a float on both sides.
    void checksums(bool wanted) noexcept { checksums_ = wanted; }

    // Append a record.   floats (shape.floats);   any (shape.any) [bytes], may be null when that is 0.
    void write(const double* floats, const void* any) noexcept { write(floats, floatBytes_, any, anyBytes_); }
    // The same with fewer bytes; the rest of the block keeps the bytes of an older record.
    void write(const double* floats, std::size_t floatBytes, const void* any, std::size_t anyBytes) noexcept {
        Block& b = begin();
        if (floatBytes) copyIn(b.floats(), floats, floatBytes);
        if (any && anyBytes) copyIn(b.any(segment_->shape().floats), any, anyBytes);
        end(b);
    }
    // In place: fill the block that begin() returns, then call end(). Until then readers do not get it.
    Block& begin() noexcept {
        std::int64_t now = nanoseconds();
        if (now >= refresh_) [[unlikely]] refresh(now);
        Block& b = *next_;
        b.sequence.store(2 * count_ + 1, std::memory_order_relaxed);        // ordered by the fence
        releaseFence();                                                     // 1
        // Data as well, and ordered as data are.
        b.monotonic.store(now, kDataStore);
        b.offset.store(offset_, kDataStore);
        b.checksum.store(0, kDataStore);
        return b;
    }
    void end(Block& b) noexcept {
        std::uint64_t n = ++count_;
        if (checksums_) [[unlikely]] b.checksum.store(checksum(*segment_, b, n), kDataStore);         // 7
        b.sequence.store(2 * n, std::memory_order_release);                 // 2
        header_->count.store(n, std::memory_order_release);                 // 3
        char* next = reinterpret_cast<char*>(next_) + blockBytes_;
        next_ = reinterpret_cast<Block*>(next == end_ ? first_ : next);
        if (anybodyAsleep()) [[unlikely]] wake();                           // 6
    }

private:
    friend class Reader;
#if SHMEM_BY_THE_LETTER
    static constexpr auto kDataStore = std::memory_order_release, kDataLoad = std::memory_order_acquire;     // 5
    static void releaseFence() {}
    static void acquireFence() {}
    static void copyIn(void* to, const void* from, std::size_t n) noexcept;
    static void copyOut(void* to, const void* from, std::size_t n) noexcept;
    // By the letter: of this and a sleeper's exchange the later one sees the earlier one, and all before it.
    bool anybodyAsleep() noexcept { return header_->asleep.fetch_or(0, std::memory_order_seq_cst) != 0; }
#else
    static constexpr auto kDataStore = std::memory_order_relaxed, kDataLoad = std::memory_order_relaxed;     // 1: fences
    static void releaseFence() { std::atomic_thread_fence(std::memory_order_release); }
    static void acquireFence() { std::atomic_thread_fence(std::memory_order_acquire); }
    static void copyIn(void* to, const void* from, std::size_t n) noexcept { std::memcpy(to, from, n); }
    static void copyOut(void* to, const void* from, std::size_t n) noexcept { std::memcpy(to, from, n); }
    bool anybodyAsleep() noexcept {
        if (fence_) [[unlikely]] std::atomic_thread_fence(std::memory_order_seq_cst);
        else std::atomic_signal_fence(std::memory_order_seq_cst);           // the compiler's part
        return header_->asleep.load(std::memory_order_relaxed) != 0;        // ordered by what stands above
    }
#endif
    static std::uint64_t checksum(const Segment& segment, const Block& b, std::uint64_t n) noexcept;
    void refresh(std::int64_t now) noexcept;
    void wake() noexcept;

    std::shared_ptr<Segment> segment_;
    // The data for write, on one line of the cache. Invariant: next_ is the block of record count_ + 1.
    alignas(kLine) Header* header_;
    Block* next_;
    std::uint64_t count_;
    std::int64_t offset_ = 0, refresh_ = 0;     // [ns]
    char *first_, *end_;
    std::uint32_t blockBytes_ = 0;
    bool fence_, checksums_ = false;
    std::size_t floatBytes_, anyBytes_;
};

class Reader {
public:
    // Read the segment of that name. Fails as Segment::forReading.
    explicit Reader(const std::string& key, const std::string& trusted = {}) : Reader(Segment::forReading(key, trusted)) {}
    explicit Reader(std::shared_ptr<Segment> segment) : segment_(std::move(segment)), header_(&segment_->header()) {}

    const Shape& shape() const { return segment_->shape(); }
    const std::shared_ptr<Segment>& segment() const { return segment_; }
    // Number of the newest record, 0 when there is none.
    std::uint64_t count() const { return header_->count.load(std::memory_order_acquire); }      // 3
    // Number of the oldest record that may still be there. It may be overwritten at any moment.
    std::uint64_t oldest() const { return oldest(count()); }
    std::uint64_t oldest(std::uint64_t count) const { return count > shape().blocks ? count - shape().blocks + 1 : 1; }
    // True: the records have ended; make another Reader of the same key. No other data depends on it.
    bool retired() const { return header_->retired.load(std::memory_order_relaxed); }

    // Copy the newest record.   floats (shape.floats), any (shape.any): null if you do not want them.
    // Wait-free: it tries kTries times at most.
    Outcome latest(double* floats, void* any, Stamp& stamp) const noexcept {
        for (int i = 0; i < kTries; ++i) {
            std::uint64_t n = count();
            if (n == 0) [[unlikely]] return Outcome::empty;
            if (Outcome outcome = copy(n, floats, any, stamp); outcome != Outcome::overwritten) [[likely]] return outcome;
        }
        return Outcome::overwritten;
    }
    static constexpr int kTries = 100;

    // Copy record n. False when it is not there any more, not yet, or damaged; then the copy is meaningless.
    bool read(std::uint64_t n, double* floats, void* any, Stamp& stamp) const noexcept {
        return copy(n, floats, any, stamp) == Outcome::read;
    }
    // The same, and why there is none: overwritten or damaged.
    Outcome copy(std::uint64_t n, double* floats, void* any, Stamp& stamp) const noexcept {
        Block& b = segment_->block(n);
        if (b.sequence.load(std::memory_order_acquire) != 2 * n) return Outcome::overwritten;       // 2
        takeStamp(b, n, stamp);
        if (floats) Writer::copyOut(floats, b.floats(), shape().floats * sizeof(double));
        if (any && shape().any) Writer::copyOut(any, b.any(shape().floats), shape().any);
        const std::uint64_t sum = b.checksum.load(Writer::kDataLoad);
        const bool right = sum == 0 || sum == Writer::checksum(*segment_, b, n);                             // 7
        if (!intact(b, n)) return Outcome::overwritten;
        return right ? Outcome::read : Outcome::damaged;
    }

    // A record in place, without a copy. Use it, then call valid(). If that is false, the record was overwritten meanwhile,
    // and what you computed from it is meaningless. Numbers may be a mixture before that check, so do not use them as
    // indices. Its checksum is not looked at.
    class View {
    public:
        const double* floats = nullptr;
        const unsigned char* any = nullptr;
        Stamp stamp;
        explicit operator bool() const { return block_ != nullptr; }        // there was such a record
        bool valid() const noexcept { return intact(*block_, stamp.counter); }

    private:
        friend class Reader;
        Block* block_ = nullptr;
    };
    View view(std::uint64_t n) const noexcept {
        View v;
        if (n == 0) return v;
        Block& b = segment_->block(n);
        if (b.sequence.load(std::memory_order_acquire) != 2 * n) return v;              // 2
        takeStamp(b, n, v.stamp);
        v.floats = b.floats();
        v.any = b.any(shape().floats);
        v.block_ = &b;
        return v;
    }

    // The record nearest to a time, which is given as in a Stamp: monotonic [ns], or with wall [us]. It reads only a few of
    // the records. Outcome as for latest.
    Outcome nearestTo(std::int64_t time, bool wall, double* floats, void* any, Stamp& stamp) const noexcept;

    // ---- waiting ----

    // Sleep until there is a record after n, the segment is retired, the bell has changed since `bell` was read, or until a
    // time [ns, monotonic; INT64_MAX: none]. May return early. To be woken by poke(), read bell() first, then check whether
    // you still have to wait, then sleep.
    void sleep(std::uint64_t n, std::uint32_t bell, std::int64_t until) const noexcept;
    std::uint32_t bell() const { return header_->bell.load(std::memory_order_seq_cst); }
    void poke() const noexcept;         // wakes all sleepers of the segment, also in other processes; those sleep again

private:
    static void takeStamp(const Block& b, std::uint64_t n, Stamp& stamp) noexcept {
        stamp.counter = n;
        stamp.monotonic = b.monotonic.load(Writer::kDataLoad);
        // Unsigned, since in a block that is being overwritten, or that another program has filled, the number may be
        // anything.
        auto offset = std::uint64_t(b.offset.load(Writer::kDataLoad));
        stamp.wall = std::int64_t(std::uint64_t(stamp.monotonic) + offset) / 1000;
    }
    static bool intact(const Block& b, std::uint64_t n) noexcept {
        Writer::acquireFence();                                             // 1
        return b.sequence.load(std::memory_order_relaxed) == 2 * n;         // ordered by the fence
    }

    std::shared_ptr<Segment> segment_;
    Header* header_;
};

inline Reader Writer::reader() const { return Reader(segment_); }

}  // namespace shmem
