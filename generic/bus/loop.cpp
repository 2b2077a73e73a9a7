#include "bus/loop.h"

#include <chrono>

#include "bus/deadline.h"

namespace sorma {

void Mailbox::post(Loop::Callback work) {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    bool first = work_.empty();
    work_.push_back(std::move(work));
    if (!first) return;
    if (bell_) bell_();
    came_.notify_one();
}

void Mailbox::run() {
    std::vector<Loop::Callback> work;
    {
        std::lock_guard lock(mutex_);
        work.swap(work_);
    }
    for (auto& item : work) item();
}

bool Mailbox::wait(std::int64_t until) {
    std::unique_lock lock(mutex_);
    auto left = std::chrono::nanoseconds(until - monotonicNow());
    return came_.wait_for(lock, left, [this] { return !work_.empty(); });
}

void Mailbox::setBell(Loop::Callback bell) {
    std::lock_guard lock(mutex_);
    bell_ = std::move(bell);
    if (bell_ && !work_.empty()) bell_();
}

void Mailbox::close() {
    std::vector<Loop::Callback> dropped;        // may post again while it goes
    std::lock_guard lock(mutex_);
    closed_ = true;
    owner = nullptr;
    bell_ = nullptr;
    dropped.swap(work_);
}

}  // namespace sorma
