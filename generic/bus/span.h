// span.h -- the trace of one request: a tree of spans, one for each call, with the times that it took.
//
// A call context may have a span. Then each request that is made in it gets a span of its own below that one. A request to
// another process takes the trace's number along; the spans of that process come back with the reply (comm/wireSpan.h), so
// nothing is left there. A call that is not finished by then is shown as under way.
//
// No reply waits for what one-way requests and events cause. These take a TraceOrigin along, and the spans of what they cause
// stay where that runs, for a few seconds: see bus/lateSpans.h.
//
// Times are durations, and offsets inside the caller's span: clocks of different hosts are never compared.
//
// While a process has a trace, its objects are observed, which brings all requests to Service::startGuarded. Without a trace
// a request pays nothing.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"

namespace sorma {

class Sorm;
class Span;
using SpanPointer = std::shared_ptr<Span>;

// The number of a trace, as W3C Trace Context has it.
struct TraceNumber {
    std::uint64_t high = 0, low = 0;            // both 0: none
    explicit operator bool() const { return (high | low) != 0; }
    bool operator==(const TraceNumber&) const = default;
    static TraceNumber random();
    // From 00-<32 hex digits>-<16 hex digits>-<2 hex digits>. Not set when it is something else.
    static TraceNumber parse(std::string_view parent);
    std::string toText() const;                 // 32 hex digits
};

// A one-way request or an event takes it along: its trace, and a number for its span.
struct TraceOrigin {
    TraceNumber number;
    std::uint64_t cause = 0;
    explicit operator bool() const { return cause != 0; }
};

// The W3C traceparent for what the present request calls by other means; empty when it is not traced.
std::string traceparent();
std::string traceparent(TraceNumber number);

// The part of one trace that this process adds.
class TraceShare {
public:
    static constexpr std::uint32_t kMostSpans = 1000;
    TraceShare(TraceNumber number, Sorm& sorm);     // its objects are observed from now on, until it is deleted
    ~TraceShare();
    TraceShare(const TraceShare&) = delete;
    TraceShare& operator=(const TraceShare&) = delete;
    const TraceNumber number;
    std::uint32_t spans = 0;                    // made or read so far

private:
    std::shared_ptr<class Mailbox> mailbox_;
};

class Span {
public:
    // event: an object publishes. listener: a subscriber gets that event.
    enum class Kind : std::uint8_t { call, oneway, event, listener };
    Span(std::shared_ptr<TraceShare> share, std::string name, Method method, std::int64_t begun);
    // The first span of a trace, or of this process's share of one.
    static SpanPointer root(TraceNumber number, Sorm& sorm, std::string name, Method method, std::int64_t begun);
    // A call that is made by this one. Null when the share is full: then it is counted.
    SpanPointer call(std::string name, Method method);
    // A one-way request or an event, which has effects that this does not wait for. Null as with call().
    SpanPointer leave(Kind kind, std::string name, Method method);
    TraceOrigin origin() const { return {share->number, cause}; }           // of what it leaves
    void finish(const Trail* failure = nullptr);            // only the first time counts
    std::int64_t lasted() const;                            // [ns] until now, when it is under way
    std::int64_t running() const;                           // [ns] its own time, without calls

    std::string name, error;                    // name empty: the one who asks may not inspect it
    Method method;
    Kind kind = Kind::call;
    std::string event;                          // its name, of event and listener
    std::uint64_t cause = 0;                    // of oneway and event: those that it causes have this number
    std::uint32_t heard = 0, told = 0;          // so many get it; so many of these have sent their spans
    bool finished = false, failed = false;
    bool underway = false;                      // at another process, when that one replied; finished here
    bool door = false;                          // of a request that has not started: Service::start begins in it
    bool elsewhere = false;                     // of an object of another process
    bool sent = false;                          // to that process
    bool answered = false;                      // that process has sent its spans
    std::int64_t offset = 0, whole = 0;         // [ns] offset: in the caller's span
    std::int64_t waited = 0;                    // [ns] before it was sent or begun, and at the other process
    std::int64_t far = 0;                       // [ns] when it was answered: waited and ran at the other process
    std::int64_t farWaited = 0;                 // [ns] of which it waited
    std::int64_t begun = 0;                     // [ns] by the monotonic clock
    std::vector<SpanPointer> calls;
    std::uint32_t lost = 0;                     // calls that found no room
    const std::shared_ptr<TraceShare> share;
};

// A request of the present context begins, and is over with the end of this, or when `pending` is answered. A service may make one
// for a part of its own work: SpanScope part("my.name", Method::exec, false).
class SpanScope {
public:
    SpanScope(const std::string& name, Method method, bool elsewhere);
    ~SpanScope();
    void failed(const Trail& why);
    void later(Pending& pending);
    SpanScope(const SpanScope&) = delete;
    SpanScope& operator=(const SpanScope&) = delete;

private:
    SpanPointer outer_, mine_;
    bool later_ = false;
};

}  // namespace sorma
