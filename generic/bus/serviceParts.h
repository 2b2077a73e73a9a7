// serviceParts.h -- what the files of a service object share: service.cpp (its life and its requests), serviceWords.cpp
// (CTRL and DBX of its class), commonRequests.cpp (those that every class answers).
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "bus/requestText.h"
#include "bus/service.h"
#include "bus/sorm.h"
#include "bus/statistics.h"

namespace sorma {

inline const Prototype kUnknownWord{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown word \"{}\": must be {}"};
inline const Prototype kMissingValue{Severity::error, "OPTION MISSING", 2, "{}: {} needs {}"};

// What only some objects ever need.
struct Service::Record {
    struct Source {                     // why an option has its value
        enum class Kind { initial, recipe, ctrl } kind = Kind::initial;
        Origin origin;                  // recipe
        PrincipalPointer author;        // of the word; null: the owner
        std::string by, request;        // ctrl
        std::int64_t time = 0;
    };
    struct Undo {
        int option;
        Value value;
        Source source;
    };
    struct Audit {
        std::int64_t time;
        std::string by, request;
        bool done;
    };

    std::vector<Source> sources;        // one for each option
    static constexpr std::size_t kUndoDepth = 10;
    std::deque<std::vector<Undo>> undo; // what each of the last CTRLs changed, the latest last
    std::deque<Audit> audit;
    Histogram times;                    // of EXEC, one call in 64
    std::uint64_t errors = 0, ctrls = 0, dbxs = 0;
    std::int64_t since = monotonicNow();
    Trail trail;                        // of the last request that had one
    std::size_t underWay = 0;           // requests taken over
    std::deque<PendingPointer> waiting; // for them
    struct Lock {
        ClientPointer holder;           // null: this process
        Client::Lease lease = 0;
        std::string by;
        std::int64_t since = 0;
    } lock;                             // while guard_ has kLockedBit
};

// Options that are being set. What it replaces ends after ticks go on again: the members go from the last to the first.
struct Service::Applying {
    Change::Values values;
    std::vector<Record::Source> sources;    // of each
    bool birth = false;                     // by its recipe: nothing has been there before
    std::vector<Record::Undo> before;
    Commit commit = nullptr;
    std::optional<BetweenTicks> between = std::nullopt;     // from the commit on
};

// The requests that every class answers.
struct CommonRequests {
    static const std::vector<Action>& actions();
    static const std::vector<Action>& inspections();

    static void help(Service& s, Args args, Message& reply);
    static void why(Service& s, Args args, Message& reply);
    static void diff(Service& s, Args args, Message& reply);
    static void stats(Service& s, Args args, Message& reply);
    static void info(Service& s, Args args, Message& reply);
    static void verbosity(Service& s, Args args, Message& reply);
    static void undo(Service& s, Args args, Message& reply);
    static void save(Service& s, Args args, Message& reply);
    static void lock(Service& s, Args args, Message& reply);
    static void unlock(Service& s, Args args, Message& reply);
    static void freeLock(Service& s);
    static std::string optionsList(Service& s, std::string_view only);
    static std::string trailText(const Trail& trail);
    static std::string describe(const Service::Record::Source& source);
    static int needOption(Service& s, const std::string& name);
};

// Another line of a reply.
inline void addLine(Message& reply, std::string_view line) {
    if (!reply.text.empty()) reply.text += '\n';
    reply.text += line;
}

// "-a, -b, or -c"
std::string oneOf(std::vector<std::string> words);

}  // namespace sorma
