// spanFuzz.cpp -- a daemon that lies about a trace: the spans at the end of a reply, and those without a reply. Whatever comes:
//
//   - Spans that cannot be read change nothing.
//   - There are never more than a trace may have. Their times can be added up.
//   - Those that were read can be sent on, and read again.
#include <set>
#include <string>

#include "bus/sorm.h"
#include "comm/wireSpan.h"
#include "fuzz.h"

using namespace sorma;

namespace {

constexpr std::int64_t kLongest = std::int64_t{1} << 60;

struct Sums {
    std::size_t spans = 0, named = 0;
};

void look(const Span& span, Sums& sums, int depth) {
    demand(depth <= 258, "too deep", depth);
    for (std::int64_t t : {span.offset, span.whole, span.waited}) demand(t >= 0 && t < kLongest, "a time", t);
    demand(span.running() >= 0, "running", span.running());
    demand(span.name.size() <= 512 && span.error.size() <= 512 && span.event.size() <= 512, "a long text");
    demand(span.told <= span.heard, "more than have heard of it", span.told);
    for (auto& c : span.calls) {
        ++sums.spans;
        sums.named += !c->name.empty();
        look(*c, sums, depth + 1);
    }
}

Sums sumsOf(const Span& span) {
    Sums sums;
    look(span, sums, 0);
    return sums;
}

void readReply(std::string_view body, Sorm& sorm) {
    const SpanPointer root = Span::root({1, 2}, sorm, "a", Method::exec, 0);
    root->finished = true;
    for (int i = 0; i < 3; ++i) {
        const std::size_t before = sumsOf(*root).spans;
        if (!wire::readSpans(body, *root)) {
            demand(sumsOf(*root).spans == before && root->share->spans == before, "what cannot be read has changed something");
            return;
        }
        demand(sumsOf(*root).spans == root->share->spans && root->share->spans <= TraceShare::kMostSpans, "spans", root->share->spans);
    }
    const Buffer again = wire::spansOf(*root, [](const std::string&) { return true; }, true);
    const SpanPointer same = Span::root({1, 2}, sorm, "a", Method::exec, 0);
    if (!wire::readSpans({again.data(), again.size()}, *same)) demand(root->whole >= kLongest || root->far >= kLongest, "cannot be read again");
}

void readLate(std::string_view body, Sorm& sorm, unsigned heard) {
    const SpanPointer root = Span::root({1, 2}, sorm, "a", Method::exec, 0);
    const SpanPointer left = root->leave(Span::Kind::event, "b", Method::exec);
    left->heard = heard % 4;
    std::set<std::uint64_t> seen;
    for (bool all : {false, true})
        wire::readLateSpans(body, [&](std::uint64_t cause) { return cause % 2 ? left.get() : nullptr; }, seen, all);
    root->finish();
    left->finish();
    demand(sumsOf(*root).spans <= TraceShare::kMostSpans + 1 && seen.size() <= left->heard, "late spans", std::int64_t(seen.size()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Sorm sorm;
    const std::string_view body(reinterpret_cast<const char*>(data), size);
    readReply(body, sorm);
    readLate(body, sorm, size > 0 ? data[size - 1] : 0);
    return 0;
}
