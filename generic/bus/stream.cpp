#include "bus/stream.h"

#include <atomic>

#include "bus/deadline.h"
#include "bus/glob.h"
#include "bus/service.h"

namespace sorma {

Stream::~Stream() {
    for (auto& entry : subscribers_)
        if (entry.subscriber) entry.subscriber->gone();
}

void Stream::add(Subscriber* subscriber, std::string pattern) { subscribers_.push_back({subscriber, std::move(pattern)}); }

void Stream::remove(Subscriber* subscriber) {
    for (auto& entry : subscribers_)
        if (entry.subscriber == subscriber) entry.subscriber = nullptr;
    if (handing_ == 0) std::erase_if(subscribers_, [](auto& entry) { return !entry.subscriber; });
}

void Stream::publish(const Service& from, std::string_view name, const Message& m) {
    static std::atomic<std::uint64_t> serial{0};        // interpreters in several threads publish, too
    Event event{from.name(), name, m, wallNow(), serial.fetch_add(1, std::memory_order_relaxed) + 1};
    ++handing_;
    for (std::size_t i = 0; i < subscribers_.size(); ++i) {     // a listener may come or go meanwhile
        auto& entry = subscribers_[i];
        if (entry.subscriber && (entry.pattern == "*" || globMatch(entry.pattern, name))) entry.subscriber->event(event);
    }
    if (--handing_ == 0) std::erase_if(subscribers_, [](auto& entry) { return !entry.subscriber; });
}

void Inbox::push(Received event) {
    if (waiting_.size() >= keep_) {
        Received& oldest = waiting_.front();
        std::int64_t lost = oldest.lost < 0 ? -1 : oldest.lost + 1;
        waiting_.pop_front();
        Received& next = waiting_.empty() ? event : waiting_.front();
        next.lost = lost < 0 || next.lost < 0 ? -1 : next.lost + lost;
    }
    waiting_.push_back(std::move(event));
    if (std::exchange(scheduled_, true)) return;
    mailbox_->post([self = shared_from_this()] { self->deliver(); });
}

void Inbox::deliver() {
    constexpr int kTurn = 64;           // then others have their turn
    auto keep = shared_from_this();
    for (int i = 0; i < kTurn && !waiting_.empty() && listener_; ++i) {
        Received event = std::move(waiting_.front());
        waiting_.pop_front();
        auto listener = listener_;      // it may end the subscription
        listener(event);
    }
    scheduled_ = !waiting_.empty() && listener_;
    if (scheduled_) mailbox_->post([keep] { keep->deliver(); });
}

}  // namespace sorma
