// lateSpans.h -- the spans of work for which no reply waits: one-way requests, and what subscribers do with events.
//
// They are kept here for some seconds. A caller with the trace's number and the right to inspect `sorm` gets them: DBX -spans of
// `sorm`. The process that traces asks this user's daemons on its host, and those to which it is connected (comm/lateTrace.h).
//
// Bounded: each trace has at most TraceShare::kMostSpans spans, and the oldest leave when there are too many. They are charged to
// the sender of a one-way request; those of events to this process.
//
// Threads: the SORM's.
#pragma once

#include <deque>

#include "bus/budget.h"
#include "bus/loop.h"
#include "bus/span.h"

namespace sorma {

class LateSpans {
public:
    static constexpr std::size_t kMostKept = 500, kMostTraces = 32;
    static constexpr std::int64_t kKept = 5'000'000'000, kLongest = 60'000'000'000;     // [ns] after its end; after its beginning

    explicit LateSpans(Sorm& sorm) : sorm_(sorm) {}

    // Something begins that was caused by that one. Null when its account has no room: then it is not traced.
    SpanPointer begin(const TraceOrigin& origin, std::string name, Method method, std::int64_t begun);

    struct Late {
        std::uint64_t cause, number;            // number: of this one, at random
        SpanPointer span;
        Charge charge;
    };
    const std::deque<Late>& kept() const { return kept_; }

private:
    std::shared_ptr<TraceShare> shareOf(TraceNumber number);
    void sweep();
    void sweepLater();

    Sorm& sorm_;
    std::deque<Late> kept_;                     // the oldest first
    Timer timer_;
};

// While this exists, the present request's next call of that object is a one-way request.
class LeaveScope {
public:
    LeaveScope(Sorm& sorm, const std::string& name, Method method);
    ~LeaveScope();
    LeaveScope(const LeaveScope&) = delete;
    LeaveScope& operator=(const LeaveScope&) = delete;

private:
    SpanPointer outer_, mine_;
};

// Is it over, with all that it calls?
bool isOver(const Span& span);

}  // namespace sorma
