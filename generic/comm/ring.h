// ring.h -- bytes from one process to another, through memory that both share. One end writes, the other one reads.
//
// Nothing in the memory is believed. Each end counts what it has moved in its own memory, and tells it to the other one. A count
// that cannot be right ends the line. Bytes are copied before anybody looks at them.
//
// Sleep:   the reader says that it sleeps, and looks once more. The writer tells what it has written, and looks whether the reader
//          sleeps. Both orders are sequentially consistent: so one of them sees the other. The same holds for a writer that waits
//          for room. The end that wakes the other one takes its mark away, so a burst wakes once.
// Pages:   a writer that is about to sleep gives back those whose bytes have been taken: nobody looks at them any more. So a silent
//          line keeps two, that of the counts and that where its next byte goes.
// Threads: each end belongs to one thread at a time.
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace sorma {

// What both ends see. Counts are of bytes since the beginning, and each has one writer.
struct RingMemory {
    static constexpr std::size_t kSize = 128 * 1024;            // [bytes] on their way, at most; a power of two
    static constexpr std::size_t kPage = 4096;                  // where pages are larger, none is given back
    using Count = std::atomic<std::uint64_t>;
    using Mark = std::atomic<std::uint32_t>;
    static_assert(Count::is_always_lock_free && Mark::is_always_lock_free && (kSize & (kSize - 1)) == 0);

    alignas(64) Count written;          // the writer's
    Mark readerSleeps;
    alignas(64) Count taken;            // the reader's
    Mark writerWaits;
    alignas(kPage) char bytes[kSize];
};

class RingWriter {
public:
    explicit RingWriter(RingMemory& memory) : memory_(&memory) {}
    // Write as much as there is room for. Returns how much; -1: the other end's count makes no sense.
    std::ptrdiff_t put(const char* data, std::size_t size) {
        if (RingMemory::kSize - (written_ - taken_) < size && !look()) return -1;
        size = std::min<std::size_t>(size, RingMemory::kSize - (written_ - taken_));
        if (size == 0) return 0;
        const std::size_t at = written_ % RingMemory::kSize, first = std::min(size, RingMemory::kSize - at);
        std::memcpy(memory_->bytes + at, data, first);
        std::memcpy(memory_->bytes, data + first, size - first);
        written_ += size;
        memory_->written.store(written_, std::memory_order_seq_cst);    // after the bytes; before readerSleeps is read
        return std::ptrdiff_t(size);
    }
    bool full() const { return written_ - taken_ == RingMemory::kSize; }        // as last seen
    // The reader is to wake us. False: there is room already.
    bool waits() {
        memory_->writerWaits.store(1, std::memory_order_seq_cst);       // before taken is read
        if (look() && full()) return true;
        memory_->writerWaits.store(0, std::memory_order_relaxed);       // a bell too many does no harm
        return false;
    }
    // Its thread is about to sleep: give back what can be. A reader that has much to take still wakes us when it has taken some. A
    // system call for each page that was filled.
    void sleeps() {
        if (written_ - given_ < RingMemory::kPage || !look()) return;
        giveBack();
        if (written_ - given_ < 2 * RingMemory::kPage) return;
        memory_->writerWaits.store(1, std::memory_order_seq_cst);       // before taken is read
        if (look()) giveBack();
    }
    // Is the reader to be woken? Says so once.
    bool wakes() { return memory_->readerSleeps.load(std::memory_order_seq_cst) != 0 && memory_->readerSleeps.exchange(0) != 0; }

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
    // Copy at most size bytes. keep: leave them there. Returns how many; -1: as look().
    std::ptrdiff_t take(char* room, std::size_t size, bool keep = false) {
        const std::ptrdiff_t here = look();
        if (here <= 0) return here;
        size = std::min(size, std::size_t(here));
        const std::size_t at = taken_ % RingMemory::kSize, first = std::min(size, RingMemory::kSize - at);
        std::memcpy(room, memory_->bytes + at, first);
        std::memcpy(room + first, memory_->bytes, size - first);
        if (keep) return std::ptrdiff_t(size);
        taken_ += size;
        memory_->taken.store(taken_, std::memory_order_seq_cst);        // after the copy; before writerWaits is read
        return std::ptrdiff_t(size);
    }
    // The writer is to wake us. False: something is there already.
    bool sleeps() {
        memory_->readerSleeps.store(1, std::memory_order_seq_cst);      // before written is read
        if (memory_->written.load(std::memory_order_seq_cst) == taken_) return true;
        awake();
        return false;
    }
    void awake() { memory_->readerSleeps.store(0, std::memory_order_relaxed); }         // a bell too many does no harm
    // Is the writer to be woken? Says so once.
    bool wakes() { return memory_->writerWaits.load(std::memory_order_seq_cst) != 0 && memory_->writerWaits.exchange(0) != 0; }

private:
    RingMemory* memory_;
    std::uint64_t taken_ = 0;
};

}  // namespace sorma
