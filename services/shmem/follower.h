// follower.h -- a thread that sleeps until there is a new record, for those who must not.
//
// It exists from the first watch() to the end of the follower, and rests while nothing is to be watched: then the writer
// has nobody to wake.
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
    // news is called on the follower's thread.
    explicit Follower(std::function<void()> news) : news_(std::move(news)) {}
    ~Follower();                        // ends the thread, and waits for that: at once unless news takes long
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;

    // Call news once: when there is a record after n, the segment is retired, or a time has come [ns, monotonic]. Replaces
    // what was watched before. No reader: just the time.
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
