// trail.h -- the errors, warnings and notes of a request, from all processes on its way.
//
// Code adds an entry where it notices something. The trail travels with the reply; nothing goes to stderr. A trail is
// bounded (`setLimit`): the oldest verbose entries are dropped first, then the oldest warnings, then errors, but for the
// first, which is the cause. `dropped()` counts them.
//
// Threads: a trail belongs to one thread at a time; the limit is for the whole process, any thread.
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
    std::string text;                   // for people
    std::string so;                     // name of the service object that raised it
    std::string daemon;                 // name of the daemon that raised it; empty: this process
    std::string file;                   // source file, without folders
    int line = 0;
    std::int64_t time = 0;              // [us since 1970] of the clock of the host that raised it
    // The error code that a caller sees: {"SORMA", "OPTION", "RANGE", ...}. An entry SERVICE CODE has the whole code of a
    // class that does not follow this form, behind the name of the object.
    std::vector<std::string> code() const;
    static constexpr const char* kForeign = "SERVICE CODE";

    std::string request;                // text of the request that was executed there; typed again it shows the error again

    bool operator==(const Entry&) const = default;
};

// Entries in order, the first one first.
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

    // The cause of a failure: the first error, else the last entry, else null.
    const Entry* cause() const;

    // For people: a line for each entry, in local time, without a newline at the end:
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
