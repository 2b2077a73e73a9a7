#include "bus/loop.h"

#include <chrono>

#include "bus/deadline.h"

namespace sorma {

void Mailbox::post(KeptCallPointer context, Loop::Callback work) {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    bool first = work_.empty();
    work_.push_back({std::move(context), std::move(work)});
    if (!first) return;
    if (bell_) bell_();
    came_.notify_one();
}

void Mailbox::run() {
    std::size_t n;
    {
        std::lock_guard lock(mutex_);
        n = work_.size();
    }
    while (n-- > 0) {
        Item item;
        {
            std::lock_guard lock(mutex_);
            if (work_.empty()) return;          // an event loop inside of an item has done the rest
            item = std::move(work_.front());
            work_.pop_front();
        }
        CallContext context(item.context);
        try {
            item.work();
        } catch (...) {
            ringAgain();
            throw;
        }
    }
    ringAgain();
}

// post() does not call the bell for items that came while the box was not empty.
void Mailbox::ringAgain() {
    std::lock_guard lock(mutex_);
    if (bell_ && !work_.empty()) bell_();
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
    std::deque<Item> dropped;                   // may post again while it goes
    std::lock_guard lock(mutex_);
    closed_ = true;
    owner = nullptr;
    bell_ = nullptr;
    dropped.swap(work_);
}

}  // namespace sorma
