// follower.h -- a thread that waits for a new record, for code that must not block.
//
// The thread exists from the first watch() until the follower is deleted. It sleeps while there is nothing to watch; then
// the writer need not wake it.
//
// Threads: watch() and rest() belong to one thread, the one that deletes the follower.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "ring.h"

namespace shmem {

class Follower {
public:
    // news is called on the follower's own thread, and must not throw.
    explicit Follower(std::function<void()> news) : news_(std::move(news)) {}
    ~Follower();                        // waits for the end of the thread, which may be in news
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;

    // Call news once: when there is a record after n, when the segment is retired, or at a time [ns, monotonic]. This
    // replaces what was watched before. Without a reader it waits for the time only.
    void watch(std::optional<Reader> reader, std::uint64_t n, std::int64_t until);
    void rest();                        // watch nothing

private:
    struct Task {
        std::optional<Reader> reader;
        std::uint64_t after;
        std::int64_t until;
    };
    void change(std::optional<Task> task, bool end = false);
    void run();
    bool follow(const Task& task, unsigned number);     // false: the task has changed meanwhile

    const std::function<void()> news_;
    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Task> task_;
    std::optional<Reader> asleepIn_;    // the segment in which the thread sleeps, to wake it there
    std::atomic<unsigned> number_{0};   // of the task; counts up when it changes
    bool ended_ = false;
};

}  // namespace shmem
