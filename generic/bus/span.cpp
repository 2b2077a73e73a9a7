#include "bus/span.h"

#include <algorithm>
#include <cstdio>
#include <random>
#include <utility>

#include "bus/call.h"
#include "bus/loop.h"
#include "bus/reply.h"
#include "bus/request.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

// Wants all requests, so that all come to the guarded entrance; the spans are made there.
class Marker : public Observer {
public:
    void came(const Passage&, const Message&) override {}
    void answered(const Passage&, const Message&, std::int64_t) override {}
};
Marker marker;

bool hex(std::string_view text, std::uint64_t& value) {
    value = 0;
    for (char c : text) {
        const int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
        if (digit < 0) return false;
        value = value << 4 | std::uint64_t(digit);
    }
    return true;
}

}  // namespace

TraceNumber TraceNumber::random() {
    std::random_device source;
    auto word = [&] { return std::uint64_t(source()) << 32 | source(); };
    return {word() | 1, word() | 1};
}

TraceNumber TraceNumber::parse(std::string_view parent) {
    TraceNumber n;
    std::uint64_t version, span, flags;
    const bool good = parent.size() == 55 && parent[2] == '-' && parent[35] == '-' && parent[52] == '-' && hex(parent.substr(0, 2), version) &&
                      version == 0 && hex(parent.substr(3, 16), n.high) && hex(parent.substr(19, 16), n.low) &&
                      hex(parent.substr(36, 16), span) && span != 0 && hex(parent.substr(53, 2), flags);
    return good ? n : TraceNumber();
}

std::string TraceNumber::toText() const {
    char text[33];
    std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(high), static_cast<unsigned long long>(low));
    return text;
}

std::string traceparent(TraceNumber number) { return "00-" + number.toText() + "-" + TraceNumber::random().toText().substr(0, 16) + "-01"; }

std::string traceparent() {
    const CallContext* context = CallContext::current();
    return context && context->span ? traceparent(context->span->share->number) : std::string();
}

TraceShare::TraceShare(TraceNumber number, Sorm& sorm) : number(number), mailbox_(sorm.mailbox()) { sorm.observers.add(&marker); }

TraceShare::~TraceShare() {
    if (mailbox_->owner) mailbox_->owner->observers.remove(&marker);
}

// ---- spans ----

Span::Span(std::shared_ptr<TraceShare> share, std::string name, Method method, std::int64_t begun)
    : name(std::move(name)), method(method), begun(begun), share(std::move(share)) {}

SpanPointer Span::root(TraceNumber number, Sorm& sorm, std::string name, Method method, std::int64_t begun) {
    return std::make_shared<Span>(std::make_shared<TraceShare>(number, sorm), std::move(name), method, begun);
}

SpanPointer Span::call(std::string name, Method method) {
    if (share->spans >= TraceShare::kMostSpans) {
        ++lost;
        return nullptr;
    }
    ++share->spans;
    const std::int64_t now = monotonicNow();
    auto span = std::make_shared<Span>(share, std::move(name), method, now);
    span->offset = now - begun;
    calls.push_back(span);
    return span;
}

SpanPointer Span::leave(Kind kind, std::string name, Method method) {
    SpanPointer span = call(std::move(name), method);
    if (!span) return nullptr;
    span->kind = kind;
    span->cause = TraceNumber::random().low;
    span->heard = 1;
    span->sent = true;
    return span;
}

void Span::finish(const Trail* why) {
    if (std::exchange(finished, true)) return;
    whole = monotonicNow() - begun;
    if (!why) return;
    failed = true;
    if (const Entry* cause = why->cause()) error = cause->text;
}

std::int64_t Span::lasted() const { return finished ? whole : monotonicNow() - begun; }

// Calls may overlap, and may be under way when this is over.
std::int64_t Span::running() const {
    if (sent && !answered) return 0;
    const std::int64_t from = answered ? farWaited : waited, to = answered ? far : lasted();
    std::vector<std::pair<std::int64_t, std::int64_t>> parts;
    for (auto& c : calls) parts.emplace_back(std::clamp(c->offset, from, std::max(from, to)), std::min(c->offset + c->lasted(), to));
    std::sort(parts.begin(), parts.end());
    std::int64_t left = to - from, seen = from;
    for (auto& [begin, end] : parts) {
        if (end <= seen) continue;
        left -= end - std::max(begin, seen);
        seen = end;
    }
    return std::max<std::int64_t>(left, 0);
}

// ---- the present request ----

SpanScope::SpanScope(const std::string& name, Method method, bool elsewhere) {
    CallContext* context = CallContext::current();
    if (!context || !context->span) return;
    outer_ = context->span;
    if (outer_->door && outer_->name == name) {
        outer_->door = false;
        outer_->waited = monotonicNow() - outer_->begun;
        mine_ = outer_;
    } else {
        mine_ = outer_->call(name, method);
    }
    if (mine_) mine_->elsewhere = elsewhere;
    context->span = mine_;
}

SpanScope::~SpanScope() {
    if (!outer_) return;
    if (CallContext* context = CallContext::current()) context->span = outer_;
    if (mine_ && !later_) mine_->finish();
}

void SpanScope::failed(const Trail& why) {
    if (mine_) mine_->finish(&why);
}

void SpanScope::later(Pending& pending) {
    if (!mine_) return;
    later_ = true;
    pending.whenAnswered([span = mine_, p = &pending] { span->finish(p->failed() ? &p->failure : nullptr); });
}

}  // namespace sorma
