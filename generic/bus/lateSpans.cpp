#include "bus/lateSpans.h"

#include <algorithm>
#include <set>
#include <utility>

#include "bus/call.h"
#include "bus/deadline.h"
#include "bus/kept.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

std::size_t memoryOf(const Span& span) {
    std::size_t bytes = sizeof(Span) + heapOf(span.name) + heapOf(span.error) + heapOf(span.event);
    for (auto& c : span.calls) bytes += sizeof(SpanPointer) + memoryOf(*c);
    return bytes;
}

}  // namespace

bool isOver(const Span& span) {
    return span.finished && !span.underway && std::all_of(span.calls.begin(), span.calls.end(), [](auto& c) { return isOver(*c); });
}

// All that one trace causes here is one share.
std::shared_ptr<TraceShare> LateSpans::shareOf(TraceNumber number) {
    for (auto& k : kept_)
        if (k.span->share->number == number) return k.span->share;
    auto numbers = [this] {
        std::set<std::pair<std::uint64_t, std::uint64_t>> all;
        for (auto& k : kept_) all.insert({k.span->share->number.high, k.span->share->number.low});
        return all.size();
    };
    while (numbers() >= kMostTraces) kept_.pop_front();
    return std::make_shared<TraceShare>(number, sorm_);
}

SpanPointer LateSpans::begin(const TraceOrigin& origin, std::string name, Method method, std::int64_t begun) {
    auto share = shareOf(origin.number);
    if (share->spans >= TraceShare::kMostSpans) return nullptr;
    auto span = std::make_shared<Span>(std::move(share), cutText(name, kKeptName), method, begun);
    Charge charge(sorm_.budget.ofCaller(), Account::Use::records);
    if (!charge.set(memoryOf(*span))) return nullptr;
    ++span->share->spans;
    if (kept_.size() >= kMostKept) kept_.pop_front();
    kept_.push_back({origin.cause, TraceNumber::random().low, span, std::move(charge)});
    if (!timer_) sweepLater();
    return span;
}

void LateSpans::sweepLater() {
    if (!sorm_.hasLoop()) return;
    timer_ = sorm_.loop().after(monotonicNow() + 1'000'000'000, [this] {
        timer_ = Timer();
        sweep();
        if (!kept_.empty()) sweepLater();
    });
}

void LateSpans::sweep() {
    const std::int64_t now = monotonicNow();
    std::erase_if(kept_, [now](auto& k) {
        const Span& s = *k.span;
        return now - s.begun > kLongest || (isOver(s) && now - s.begun - s.whole > kKept);
    });
    for (auto& k : kept_) k.charge.force(k.charge.account() ? memoryOf(*k.span) : 0);
}

// ---- one-way requests inside this process ----

LeaveScope::LeaveScope(Sorm& sorm, const std::string& name, Method method) {
    CallContext* context = CallContext::current();
    if (!context || !context->span) return;
    outer_ = context->span;
    mine_ = outer_->leave(Span::Kind::oneway, name, method);
    context->span = mine_ ? sorm.lateSpans().begin(mine_->origin(), name, method, monotonicNow()) : nullptr;
    if (context->span) context->span->door = true;
}

LeaveScope::~LeaveScope() {
    if (!outer_) return;
    if (CallContext* context = CallContext::current()) context->span = outer_;
    if (mine_) mine_->finish();
}

}  // namespace sorma
