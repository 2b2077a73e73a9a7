// wireSpan.h -- the spans of a trace at the end of a reply, see doc/wire.md.
//
// Bounded: what finds no room is counted, as with spans that are made. A reply without spans, or with some that cannot be read,
// is a good reply; its call then shows no times of the other process.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <functional>
#include <set>
#include <string>

#include "bus/lateSpans.h"
#include "bus/span.h"
#include "comm/xdr.h"

namespace sorma::wire {

inline constexpr std::size_t kMostSpanBytes = 64 * 1024;

// The present times of a request here, and the calls below it.   shown: may the one who asks inspect that object?   foreign:
// and those of other daemons?
Buffer spansOf(const Span& root, const std::function<bool(const std::string& name)>& shown, bool foreign);
// Read them into the span of the call that has made the request. False: nothing was read.
bool readSpans(std::string_view body, Span& into);

// Those of a trace that no reply brings.
Buffer lateSpansOf(const LateSpans& late, TraceNumber number, const std::function<bool(const std::string& name)>& shown, bool foreign);
// Read those that were caused by a span.   find: that with this number; null: it is of another trace.   seen: those that have been
// read before, and now.   all: also those that are under way. False: the rest cannot be read.
bool readLateSpans(std::string_view body, const std::function<Span*(std::uint64_t cause)>& find, std::set<std::uint64_t>& seen, bool all);

}  // namespace sorma::wire
