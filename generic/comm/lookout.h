// lookout.h -- wakes threads that doze at a mark in shared memory, when nobody else does: the other process has died, or their time
// is over.
//
// A kernel timer that is set for each wait, and taken back, costs a third of a call by memory. So one thread of this process keeps the
// time of all. It sets its timer again only when that has expired. It also waits for the end of their sockets.
//
// Threads: a Dozer belongs to one thread at a time. The lookout's own thread sets the marks.
#pragma once

#include <atomic>
#include <cstdint>

namespace sorma {

class Lookout;

class Dozer {
public:
    using Mark = std::atomic<std::uint32_t>;
    // socket: when its other end is closed, the dozer has ended. mark: a dozer waits until it is 0 (futex(2), between processes).
    // Throws std::system_error, also when there can be no thread.
    Dozer(int socket, Mark& mark);
    ~Dozer();
    Dozer(const Dozer&) = delete;
    Dozer& operator=(const Dozer&) = delete;

    void begin(std::int64_t until);                     // a wait that is over then, on the monotonic clock [ns]
    void end() { until_.store(0, std::memory_order_relaxed); }
    // Has the lookout called? Then the mark is 0, or nobody will change it.
    bool called() const { return called_.load(std::memory_order_seq_cst) || ended(); }
    bool ended() const { return ended_.load(std::memory_order_seq_cst); }

private:
    friend class Lookout;
    void call();                        // the lookout's

    Lookout& lookout_;
    Mark& mark_;
    std::atomic<std::int64_t> until_{0};                // 0: it does not wait
    std::atomic<bool> called_{false}, ended_{false};
    const std::uint64_t number_;
};

}  // namespace sorma
