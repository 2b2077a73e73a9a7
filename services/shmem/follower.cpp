#include "follower.h"

#include <pthread.h>
#include <signal.h>

#include <chrono>

namespace shmem {

Follower::~Follower() {
    change({}, true);
    if (thread_.joinable()) thread_.join();
}

void Follower::watch(std::optional<Reader> reader, std::uint64_t n, std::int64_t until) {
    change(Task{std::move(reader), n, until});
    if (thread_.joinable()) return;
    // Signals are the business of other threads.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    try {
        thread_ = std::thread([this] { run(); });
    } catch (...) {
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
        throw;
    }
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void Follower::rest() { change({}); }

void Follower::change(std::optional<Task> task, bool end) {
    std::lock_guard lock(mutex_);
    task_ = std::move(task);
    ended_ = ended_ || end;
    number_.fetch_add(1, std::memory_order_seq_cst);        // before the poke: who sleeps on wakes, who is about to, looks
    if (asleepIn_) asleepIn_->poke();
    changed_.notify_one();
}

void Follower::run() {
    std::unique_lock lock(mutex_);
    while (!ended_) {
        if (!task_) {
            changed_.wait(lock);
            continue;
        }
        Task task = *task_;
        unsigned number = number_.load(std::memory_order_relaxed);      // changes under the lock only
        bool came;
        if (task.reader) {
            asleepIn_ = task.reader;
            lock.unlock();
            came = follow(task, number);
            lock.lock();
            asleepIn_.reset();
        } else {
            auto left = std::chrono::nanoseconds(task.until - nanoseconds());
            came = !changed_.wait_for(lock, left, [&] { return number_.load(std::memory_order_relaxed) != number; });
        }
        if (!came || number_.load(std::memory_order_relaxed) != number) continue;
        task_.reset();
        lock.unlock();
        news_();
        lock.lock();
    }
}

bool Follower::follow(const Task& task, unsigned number) {
    const Reader& r = *task.reader;
    for (;;) {
        std::uint32_t bell = r.bell();
        if (number_.load(std::memory_order_seq_cst) != number) return false;     // after the bell: then poke() changes it
        if (r.count() > task.after || r.retired() || nanoseconds() >= task.until) return true;
        r.sleep(task.after, bell, task.until);
    }
}

}  // namespace shmem
