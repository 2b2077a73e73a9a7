// ring.h -- bytes from one process to another, through memory that both share. One end writes, the other one reads.
//
// Nothing in the memory is believed. Each end counts what it has moved in its own memory, and tells it to the other one. A count
// that cannot be right ends the line. Bytes are copied before anybody looks at them.
//
// Sleep:   the reader says that it sleeps, and looks once more. The writer tells what it has written, and looks whether the reader
//          sleeps. Both orders are sequentially consistent: so one of them sees the other. The same holds for a writer that waits
//          for room. It is woken when half of the ring is free. A reader takes all that is there before it sleeps. The end that wakes
//          the other one takes its mark away, so a burst wakes once. A reader that waits for nothing else dozes: at a futex, which
//          costs both ends less than a bell.
// Pages:   a writer that rests gives back those whose bytes have been taken: nobody looks at them any more. So a silent line keeps
//          two, that of the counts and that where its next byte goes.
// Threads: each end belongs to one thread at a time.
#pragma once

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace sorma {

// What both ends see. Counts are of bytes since the beginning, and each has one writer.
struct RingMemory {
    static constexpr std::size_t kSize = 256 * 1024;            // [bytes] on their way, at most; a power of two
    static constexpr std::size_t kPiece = 16 * 1024;            // is moved at a time: so both ends work on what is long
    static constexpr std::size_t kPage = 4096;                  // where pages are larger, none is given back
    using Count = std::atomic<std::uint64_t>;
    using Mark = std::atomic<std::uint32_t>;
    static_assert(Count::is_always_lock_free && Mark::is_always_lock_free && sizeof(Mark) == 4 && (kSize & (kSize - 1)) == 0);
    static constexpr std::uint32_t kAwake = 0, kSleeps = 1, kDozes = 2;     // what a mark says

    alignas(64) Count written;          // the writer's
    Mark reader;                        // does it sleep?
    alignas(64) Count taken;            // the reader's
    Mark writer;                        // does it wait for room?
    alignas(kPage) char bytes[kSize];
};

class RingWriter {
public:
    explicit RingWriter(RingMemory& memory) : memory_(&memory) {}
    // Write as much as there is room for, a piece at most. Returns how much; -1: the other end's count makes no sense.
    std::ptrdiff_t put(const char* data, std::size_t size) {
        if (RingMemory::kSize - (written_ - taken_) < size && !look()) return -1;
        size = std::min<std::size_t>({size, RingMemory::kSize - (written_ - taken_), RingMemory::kPiece});
        if (size == 0) return 0;
        const std::size_t at = written_ % RingMemory::kSize, first = std::min(size, RingMemory::kSize - at);
        std::memcpy(memory_->bytes + at, data, first);
        std::memcpy(memory_->bytes, data + first, size - first);
        written_ += size;
        memory_->written.store(written_, std::memory_order_seq_cst);    // after the bytes; before the reader's mark is read
        return std::ptrdiff_t(size);
    }
    std::size_t left() { return look() ? std::size_t(written_ - taken_) : 0; }          // what the reader has not taken
    bool full() const { return written_ - taken_ == RingMemory::kSize; }        // as last seen
    bool room() { return !look() || !full(); }                                  // by now, or the other end makes no sense
    // The reader is to wake us. False: there is room already.
    bool waits() {
        memory_->writer.store(1, std::memory_order_seq_cst);       // before taken is read
        if (look() && full()) return true;
        memory_->writer.store(0, std::memory_order_relaxed);       // a bell too many does no harm
        return false;
    }
    // The line is silent: give back what can be. A reader that has much to take still wakes us when it has taken some. A system call
    // for each page that was filled.
    void rest() {
        if (written_ - given_ < RingMemory::kPage || !look()) return;
        giveBack();
        if (written_ - given_ < 2 * RingMemory::kPage) return;
        memory_->writer.store(1, std::memory_order_seq_cst);       // before taken is read
        if (look()) giveBack();
    }
    // Is the reader to be woken by a bell? Says so once. One that dozes has been woken here.
    bool wakes() {
        if (memory_->reader.load(std::memory_order_seq_cst) == RingMemory::kAwake) return false;
        const std::uint32_t mark = memory_->reader.exchange(RingMemory::kAwake);
        if (mark == RingMemory::kDozes) syscall(SYS_futex, &memory_->reader, FUTEX_WAKE, 1, nullptr, nullptr, 0);
        return mark != RingMemory::kAwake && mark != RingMemory::kDozes;
    }

private:
    bool look() {
        const std::uint64_t now = memory_->taken.load(std::memory_order_seq_cst);      // room is ours when its bytes were copied
        if (now - taken_ > written_ - taken_) return false;
        taken_ = now;
        return true;
    }
    void giveBack() {
        constexpr std::uint64_t kSize = RingMemory::kSize, kPage = RingMemory::kPage;
        const std::uint64_t end = taken_ / kPage * kPage, next = (written_ + kPage - 1) / kPage * kPage;
        if (given_ + kSize < next) given_ = next - kSize;               // written anew since
        while (given_ < end) {
            const std::uint64_t at = given_ % kSize, size = std::min(end - given_, kSize - at);
            (void)madvise(memory_->bytes + at, size, MADV_REMOVE);      // fails where pages are larger, or the memory is no file
            given_ += size;
        }
    }
    RingMemory* memory_;
    std::uint64_t written_ = 0, taken_ = 0;
    std::uint64_t given_ = 0;           // at the beginning of a page
};

class RingReader {
public:
    explicit RingReader(RingMemory& memory) : memory_(&memory) {}
    // How much is there; -1: the other end's count makes no sense.
    std::ptrdiff_t look() const {
        const std::uint64_t here = memory_->written.load(std::memory_order_acquire) - taken_;      // the bytes are there before their count
        return here > RingMemory::kSize ? -1 : std::ptrdiff_t(here);
    }
    // Copy at most size bytes, or a piece. keep: leave them there. Returns how many; -1: as look().
    std::ptrdiff_t take(char* room, std::size_t size, bool keep = false) {
        const std::ptrdiff_t here = look();
        if (here <= 0) return here;
        size = std::min({size, std::size_t(here), RingMemory::kPiece});
        const std::size_t at = taken_ % RingMemory::kSize, first = std::min(size, RingMemory::kSize - at);
        std::memcpy(room, memory_->bytes + at, first);
        std::memcpy(room + first, memory_->bytes, size - first);
        if (keep) return std::ptrdiff_t(size);
        taken_ += size;
        left_ = std::size_t(here) - size;
        memory_->taken.store(taken_, std::memory_order_seq_cst);        // after the copy; before the writer's mark is read
        return std::ptrdiff_t(size);
    }
    // The writer is to wake us by a bell. False: something is there already.
    bool sleeps() { return say(RingMemory::kSleeps); }
    // Wait for the writer, or until somebody takes the mark away (see lookout.h), or a signal comes.   called: has he?
    template <class Called> void doze(Called called) {
        if (say(RingMemory::kDozes) && !called()) syscall(SYS_futex, &memory_->reader, FUTEX_WAIT, RingMemory::kDozes, nullptr, nullptr, 0);
        awake();
    }
    std::atomic<std::uint32_t>& mark() { return memory_->reader; }
    // The socket is closed. A writer rings the bell now, and learns that from the socket.
    void leave() { memory_->reader.store(RingMemory::kSleeps, std::memory_order_seq_cst); }
    void awake() { memory_->reader.store(RingMemory::kAwake, std::memory_order_relaxed); }      // woken once too often does no harm
    // Is the writer to be woken? Says so once, when half of the ring is free at the latest: so it is not woken for each piece.
    bool wakes() { return left_ <= RingMemory::kSize / 2 && memory_->writer.load(std::memory_order_seq_cst) != 0 && memory_->writer.exchange(0) != 0; }

private:
    bool say(std::uint32_t how) {
        memory_->reader.store(how, std::memory_order_seq_cst);          // before written is read
        if (memory_->written.load(std::memory_order_seq_cst) == taken_) return true;
        awake();
        return false;
    }
    RingMemory* memory_;
    std::uint64_t taken_ = 0;
    std::size_t left_ = 0;              // what we have seen of it and not taken
};

}  // namespace sorma
