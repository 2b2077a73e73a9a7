// trail.h -- what a call has to say beside its result: the messages it gathered, across processes.
//
// Entries are added where something is noticed and travel with the reply, never to stderr. A trail is bounded
// (`setLimit`): the oldest verbose entries go first, then the oldest warnings, then errors (the first, which is the
// cause, stays), and `dropped()` tells how many went.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sorma {

enum class Severity : std::uint8_t { verbose, warning, error };
const char* toText(Severity severity);                  // as typed in Tcl: "verbose", "warning", "error"
bool fromText(std::string_view text, Severity& out);

struct Entry {
    Severity severity = Severity::error;
    std::string symbol;                 // area and symbol: "OPTION RANGE"
    std::vector<std::string> details;   // rest of the error code: {"carry.slow", "-transferSpeed"}
    std::string text;                   // clear text
    std::string so;                     // service object that raised it
    std::string daemon;                 // daemon it came from; empty: this process
    std::string file;                   // source file, without folders
    int line = 0;
    std::int64_t time = 0;              // microseconds since 1970, the raising host's clock
    std::string request;                // request text that reproduces this hop alone

    bool operator==(const Entry&) const = default;
};

class Trail {
public:
    static constexpr std::size_t kDefaultLimit = 200;

    Trail() = default;
    explicit Trail(Entry entry) { add(std::move(entry)); }

    void add(Entry entry);
    void append(const Trail& other);
    void clear() { entries_.clear(); dropped_ = 0; }                        // keeps the memory
    void swap(Trail& other) noexcept { entries_.swap(other.entries_), std::swap(dropped_, other.dropped_); }
    bool empty() const { return entries_.empty() && dropped_ == 0; }
    const std::vector<Entry>& entries() const { return entries_; }
    std::vector<Entry>& entries() { return entries_; }
    std::size_t dropped() const { return dropped_; }
    void setDropped(std::size_t count) { dropped_ = count; }

    // The entry that says what went wrong: the first error, else the last entry, else null.
    const Entry* cause() const;

    // One line for each entry, for people, in local time; no newline at the end:
    // error SORMA OPTION RANGE: carry.slow: -transferSpeed 7 is outside ...  (carry.slow@robot, carry.cpp:31, 10:31:02.123)
    std::string toText() const;

    // Limit for trails of this process, in entries; at least 1.
    static void setLimit(std::size_t entries);
    static std::size_t limit();

    bool operator==(const Trail&) const = default;

private:
    void trim();

    std::vector<Entry> entries_;    // in the order in which they were raised
    std::size_t dropped_ = 0;
};

}  // namespace sorma
