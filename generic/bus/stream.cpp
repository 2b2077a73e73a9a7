#include "bus/stream.h"

#include <algorithm>
#include <atomic>

#include "bus/call.h"
#include "bus/deadline.h"
#include "bus/atEnd.h"
#include "bus/glob.h"
#include "bus/lateSpans.h"
#include "bus/monitor.h"
#include "bus/service.h"
#include "bus/sorm.h"

namespace sorma {

std::string Subscriber::who() const { return Caller::self().toText(); }

Stream::~Stream() {
    for (auto& entry : subscribers_)
        if (entry.subscriber) entry.subscriber->gone();
}

void Stream::add(Subscriber* subscriber, std::string pattern) {
    monitors_ += pattern.starts_with("monitor");
    subscribers_.push_back({subscriber, std::move(pattern)});
}

bool Stream::remove(Subscriber* subscriber) {
    bool found = false;
    for (auto& entry : subscribers_) {
        if (entry.subscriber != subscriber) continue;
        entry.subscriber = nullptr;
        monitors_ -= entry.pattern.starts_with("monitor");
        found = true;
    }
    removeUnsubscribed();
    return found;
}

void Stream::each(const std::function<void(const Subscriber&, const std::string&)>& tell) const {
    for (auto& entry : subscribers_)
        if (entry.subscriber) tell(*entry.subscriber, entry.pattern);
}

void Stream::removeUnsubscribed() {
    if (handing_ == 0) std::erase_if(subscribers_, [](auto& entry) { return !entry.subscriber; });
}

// One more gets the event, of a request that is traced.
static void note(Span* caller, SpanPointer& span, Event& event) {
    if (span) {
        ++span->heard;
    } else if (event.serial != 0 && (span = caller->leave(Span::Kind::event, std::string(event.object), Method::exec))) {
        span->event = cutText(event.name);
        event.origin = span->origin();
    }
}

void Stream::publish(const Service& from, std::string_view name, const Message& m, bool monitor) {
    static std::atomic<std::uint64_t> serial{0};        // interpreters in several threads publish, too
    Event event{from.name(), name, m, wallNow(), serial.fetch_add(1, std::memory_order_relaxed) + 1, CallContext::currentRequest()};
    if (!monitor) {
        keep(event, from);
        from.sorm().observers.published(event);
        if (from.sorm().monitored() && from.name() != "sorm") [[unlikely]] tellPassing(from, name, m);
    }
    // Events about this process itself are no part of a trace.
    const CallContext* context = CallContext::current();
    Span* caller = context && !monitor && from.name() != "sorm" ? context->span.get() : nullptr;
    SpanPointer span;
    ++handing_;
    for (std::size_t i = 0; i < subscribers_.size(); ++i) {     // a listener may come or go meanwhile
        auto& entry = subscribers_[i];
        if (!entry.subscriber || (monitor && !entry.pattern.starts_with("monitor"))) continue;
        if (entry.pattern != "*" && !globMatch(entry.pattern, name)) continue;
        if (caller) [[unlikely]] note(caller, span, event);
        entry.subscriber->event(event);
    }
    if (span) span->finish();
    --handing_;
    removeUnsubscribed();
}

// An event that nobody can pay for any more is not kept.
void Stream::keep(const Event& event, const Service& from) {
    constexpr std::size_t kNames = 32, kBytes = 1 << 16;
    const Message& m = event.message;
    auto at = std::find_if(last_.begin(), last_.end(), [&](auto& l) { return l->name == event.name; });
    std::size_t bytes = m.text.size() + m.any.size() + 8 * (m.floats.size() + m.ints.size());
    auto account = from.sorm().budget.ofCaller();
    if (bytes > kBytes || (account && bytes > 0 && !account->fits(2 * bytes))) {               // the event that was kept before is not the last one any more
        if (at != last_.end()) last_.erase(at);
        return;
    }
    if (at == last_.end()) {
        if (last_.size() >= kNames)
            last_.erase(std::min_element(last_.begin(), last_.end(), [](auto& a, auto& b) { return a->serial < b->serial; }));
        at = last_.insert(last_.end(), Charged<Last>());
    }
    at->charge(std::move(account), Account::Use::records, [&](Last& last) {
        last.name = event.name;
        last.message = m;
        last.time = event.time;
        last.serial = event.serial;
        last.request = event.request;
    });
}

void Stream::replay(const Service& from, Subscriber* subscriber, std::string_view pattern) const {
    std::vector<const Last*> found;
    for (auto& l : last_)
        if (pattern == "*" || globMatch(pattern, l->name)) found.push_back(&*l);
    std::sort(found.begin(), found.end(), [](auto* a, auto* b) { return a->serial < b->serial; });
    for (auto* l : found) subscriber->event({from.name(), l->name, l->message, l->time, l->serial, l->request});
}

Inbox::Item Inbox::Spares::take() {
    if (events_.empty()) return std::make_unique<Received>();
    Item event = std::move(events_.back());
    events_.pop_back();
    event->message.reset();
    return event;
}

void Inbox::Spares::give(Item event) {
    constexpr std::size_t kMost = 512, kSmall = 1024;   // events, as a piece of shared memory may hold; [bytes] of each
    if (events_.size() < kMost && heapOf(event->message) <= kSmall) events_.push_back(std::move(event));
}

void Inbox::push(Item event) {
    if (waiting_.size() >= keep_) {
        Received& oldest = *waiting_.front();
        std::int64_t lost = oldest.lost < 0 ? -1 : oldest.lost + 1;
        waiting_.pop_front();
        Received& next = waiting_.empty() ? *event : *waiting_.front();
        next.lost = lost < 0 || next.lost < 0 ? -1 : next.lost + lost;
    }
    waiting_.push_back(std::move(event));
    if (std::exchange(scheduled_, true)) return;
    mailbox_->post([self = shared_from_this()] { self->deliver(); });
}

// As part of a trace.
void Inbox::tell(const Listener& listener, Received& event) {
    Sorm* sorm = mailbox_->owner;
    SpanPointer span = sorm ? sorm->lateSpans().begin(event.origin, event.object, Method::exec, monotonicNow()) : nullptr;
    if (!span) return listener(event);
    span->kind = Span::Kind::listener;
    span->event = cutText(event.name);
    auto kept = std::make_shared<KeptCall>(nullptr, Deadline(), CallContext::newRequest(), std::string());
    kept->span = span;
    const CallContext context(kept);
    const AtEnd over([&] { span->finish(); });
    listener(event);
}

void Inbox::deliver() {
    constexpr int kLook = 64;           // events; then we look whether our turn is over
    constexpr std::int64_t kTurn = 1'000'000;       // [ns]; then others have theirs
    auto keep = shared_from_this();
    const auto listener = listener_;    // it may end the subscription
    const std::int64_t end = waiting_.size() > kLook ? monotonicNow() + kTurn : 0;
    for (int i = 0; !waiting_.empty() && listener_ && (i == 0 || i % kLook != 0 || monotonicNow() < end); ++i) {
        Item event = std::move(waiting_.front());
        waiting_.pop_front();
        if (event->origin) [[unlikely]] tell(listener, *event);
        else listener(*event);
        if (spares_) spares_->give(std::move(event));
    }
    scheduled_ = !waiting_.empty() && listener_;
    if (scheduled_) mailbox_->post([keep] { keep->deliver(); });
}

}  // namespace sorma
