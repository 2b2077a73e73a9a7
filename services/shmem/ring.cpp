#include "ring.h"

#include <linux/futex.h>
#include <linux/membarrier.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <climits>

#include "bus/fnv.h"

namespace shmem {

namespace {

constexpr std::int64_t kRefresh = 1'000'000'000;        // [ns] between two looks at the wall clock
constexpr std::int64_t kPeek = 1'000'000;             // [ns] that those sleep at most who cannot be woken

// Times may be any number in a segment that another program has filled, or in a request.
std::int64_t distance(std::int64_t a, std::int64_t b) {
    std::int64_t d;
    if (__builtin_sub_overflow(std::max(a, b), std::min(a, b), &d)) return INT64_MAX;
    return d;
}

// Can this process's writers be made to execute a barrier?
bool canBeReached() {
    static const bool registered = syscall(SYS_membarrier, MEMBARRIER_CMD_REGISTER_GLOBAL_EXPEDITED, 0, 0) == 0;
    return registered;
}

bool reachWriters() { return syscall(SYS_membarrier, MEMBARRIER_CMD_GLOBAL_EXPEDITED, 0, 0) == 0; }

}  // namespace

Writer::Writer(const std::string& key, const Shape& shape, const std::string& program, Access access, bool keep)
    : segment_(Segment::forWriting(key, shape, access, keep, program)), header_(&segment_->header()) {
    count_ = header_->count.load(std::memory_order_acquire);        // 4
    // A predecessor that was killed between 2 and 3 has completed a record without counting it.
    if (segment_->block(count_ + 1).sequence.load(std::memory_order_acquire) == 2 * (count_ + 1))
        header_->count.store(++count_, std::memory_order_release);
    next_ = &segment_->block(count_ + 1);
    first_ = reinterpret_cast<char*>(&segment_->block(1));
    end_ = first_ + shape.blocks * segment_->blockBytes();
    blockBytes_ = std::uint32_t(segment_->blockBytes());
    floatBytes_ = shape.floats * sizeof(double);
    anyBytes_ = shape.any;
    fence_ = !canBeReached();
    refresh(nanoseconds());
}

void Writer::refresh(std::int64_t) noexcept {
    // The monotonic clock before and after, so that an interruption in between does not count.
    std::int64_t best = INT64_MAX;
    for (int i = 0; i < 3; ++i) {
        std::int64_t before = nanoseconds(), wall = nanoseconds(CLOCK_REALTIME), after = nanoseconds();
        if (after - before >= best) continue;
        best = after - before;
        offset_ = wall - before - best / 2;
        refresh_ = after + kRefresh;
    }
}

// FNV-1a with words in place of bytes, and then with the bytes that are left (Fowler, Noll, Vo; RFC 9923): each word or byte h = (h ^ word) * prime,
// so that a change of any one of them changes the result. In the order of the block, after the number. Never 0.
std::uint64_t Writer::checksum(const Segment& segment, const Block& b, std::uint64_t n) noexcept {
    sorma::Fnv h;
    h.add(n);
    h.add(std::uint64_t(b.monotonic.load(kDataLoad)));
    h.add(std::uint64_t(b.offset.load(kDataLoad)));
    constexpr int kOrder = int(kDataLoad);
    const auto* data = reinterpret_cast<const unsigned char*>(&b + 1);
    const std::uint64_t bytes = segment.shape().floats * sizeof(double) + segment.shape().any;
    std::uint64_t i = 0;
    for (; i + 8 <= bytes; i += 8) h.add(__atomic_load_n(reinterpret_cast<const std::uint64_t*>(data + i), kOrder));
    for (; i < bytes; ++i) h.add(__atomic_load_n(data + i, kOrder));
    return h.value() ? h.value() : 1;
}

// A reader that sets `asleep` from here on sees the record that was just counted. A reader that has set it before has read
// the bell before, and so does not sleep on its new value.
void Writer::wake() noexcept {
    header_->asleep.exchange(0, std::memory_order_seq_cst);
    segment_->ring();
}

Outcome Reader::nearestTo(std::int64_t time, bool wall, double* floats, void* any, Stamp& stamp) const noexcept {
    for (int i = 0; i < kTries; ++i) {
        std::uint64_t newest = count();
        if (newest == 0) return Outcome::empty;
        auto timeOf = [&](const Stamp& s) { return wall ? s.wall : s.monotonic; };
        // Times only grow (the wall clock may be set; then it is one of the nearest). The first record not
        // before `time`; records that were overwritten meanwhile are older than all others.
        std::uint64_t low = oldest(newest), high = newest;
        while (low < high) {
            std::uint64_t middle = low + (high - low) / 2;
            View v = view(middle);
            if (!v || !v.valid() || timeOf(v.stamp) < time) low = middle + 1;
            else high = middle;
        }
        std::uint64_t best = low;
        if (low > 1) {
            View after = view(low), before = view(low - 1);
            if (before && before.valid() && after &&
                distance(timeOf(before.stamp), time) <= distance(timeOf(after.stamp), time))
                best = low - 1;
        }
        if (Outcome outcome = copy(best, floats, any, stamp); outcome != Outcome::overwritten) return outcome;
    }
    return Outcome::overwritten;
}

void Reader::sleep(std::uint64_t n, std::uint32_t bell, std::int64_t until) const noexcept {
    Header* words = segment_->words();
    bool canBeWoken = words != nullptr;
    if (canBeWoken) {
        // Reads and writes, so that of a writer and a sleeper that do it at the same time the second one sees the first.
        words->asleep.exchange(1, std::memory_order_seq_cst);
        canBeWoken = reachWriters();                                        // 6
    }
    if (count() > n || retired()) return;
    std::int64_t left = until - nanoseconds();
    if (left <= 0) return;
    if (!canBeWoken) left = std::min(left, kPeek);
    timespec wait{time_t(left / 1'000'000'000), long(left % 1'000'000'000)};
    const bool forever = canBeWoken && until == INT64_MAX;          // no timer to be set and taken back
    syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&header_->bell), FUTEX_WAIT, bell, forever ? nullptr : &wait, nullptr, 0);
}

void Reader::poke() const noexcept {
    if (segment_->words()) segment_->ring();
}

#if SHMEM_BY_THE_LETTER
namespace {

// Words, and bytes of what is left: both sides split a part the same way, so all accesses to one place have one size.
template <class Move> void wordByWord(void* to, const void* from, std::size_t n, Move move) {
    auto* t = static_cast<unsigned char*>(to);
    auto* f = static_cast<const unsigned char*>(from);
    std::size_t i = 0;
    for (; i + 8 <= n; i += 8) move(reinterpret_cast<std::uint64_t*>(t + i), reinterpret_cast<const std::uint64_t*>(f + i));
    for (; i < n; ++i) move(t + i, f + i);
}

}  // namespace

void Writer::copyIn(void* to, const void* from, std::size_t n) noexcept {
    wordByWord(to, from, n, [](auto* t, const auto* f) {
        std::remove_reference_t<decltype(*t)> value;
        std::memcpy(&value, f, sizeof value);
        __atomic_store_n(t, value, __ATOMIC_RELEASE);
    });
}

void Writer::copyOut(void* to, const void* from, std::size_t n) noexcept {
    wordByWord(to, from, n, [](auto* t, const auto* f) {
        auto value = __atomic_load_n(f, __ATOMIC_ACQUIRE);
        std::memcpy(t, &value, sizeof value);
    });
}
#endif

}  // namespace shmem
