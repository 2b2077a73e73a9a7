// serviceParts.h -- shared by the files that implement Service. No other file includes it.
//
//     request.cpp          the one entrance for requests
//     service.cpp          the life of an object, and requests that wait
//     serviceWords.cpp     CTRL and DBX: options, actions and inspections of its class
//     commonRequests.cpp   actions and inspections that every class has
//     serviceLock.cpp      CTRL -lock and -unlock
//     openPieces.cpp       DBX -stream
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "bus/kept.h"
#include "bus/nearest.h"
#include "bus/openPieces.h"
#include "bus/request.h"
#include "bus/requestText.h"
#include "bus/service.h"
#include "bus/sorm.h"
#include "bus/statistics.h"

// The build says it, but not to the fuzz targets.
#ifndef SORMA_VERSION
#define SORMA_VERSION "1.0"
#endif

namespace sorma {

inline const Prototype kUnknownWord{Severity::error, "OPTION UNKNOWN", 2, "{0}: unknown word \"{1}\"{3}: must be {2}"};
inline const Prototype kMissingValue{Severity::error, "OPTION MISSING", 2, "{}: {} needs {}"};

// Data that many objects never need. Made when it is first needed.
struct Service::Record {
    // Where an option has its value from.
    struct Source {
        enum class Kind { initial, recipe, ctrl, remembered, found } kind = Kind::initial;
        Origin origin;                  // recipe: place of the word
        PrincipalPointer author;        // who wrote the value; null: the owner
        std::string by, request;        // ctrl, remembered: the caller; ctrl: the request; for people
        std::int64_t time = 0;          // [us since 1970]; found: when the object gave itself the value
        std::size_t value = 0;          // what the value takes [bytes], which is charged here
        std::size_t heap() const {
            return value + heapOf(origin.file) + heapOf(origin.via) + heapOf(origin.by) + heapOf(by) + heapOf(request);
        }
    };
    using KeptSource = Charged<Source>;
    // The value of an option before a change.
    struct Undo {
        int option;
        Value value;
        KeptSource source;
    };
    // A CTRL request, for DBX -audit.
    struct Audit {
        std::uint64_t number;           // of the request
        std::int64_t time;              // [us since 1970]
        std::string by, request;
        enum State : std::uint8_t { underWay, done, refused };
        mutable State state;            // charged for nothing
        std::size_t heap() const { return heapOf(by) + heapOf(request); }
    };

    std::vector<KeptSource> sources;    // one for each option
    static constexpr std::size_t kUndoDepth = 10;
    std::deque<std::vector<Undo>> undo; // the changes of the last CTRLs, the latest last
    void keepUndo(std::vector<Undo> before) {
        if (undo.size() == kUndoDepth) undo.pop_front();
        undo.push_back(std::move(before));
    }
    std::vector<bool> remembers;        // by option: its value outlives the process; empty: none
    std::deque<Charged<Audit>> audit;
    Histogram times;                    // of EXEC, one call in 64, until its answer
    std::uint64_t errors = 0, ctrls = 0, dbxs = 0;      // how many
    std::int64_t since = monotonicNow();
    Charged<Trail> trail;               // of the last request that had one
    std::size_t underWay = 0;           // requests that it has taken over and not finished
    std::deque<PendingPointer> waiting; // requests that start after those; null: a piece of a stream
    struct Lock {
        ClientPointer holder;           // null: this process
        Client::Lease lease = 0;
        std::string by;                 // the holder, for people
        std::int64_t since = 0;         // [us since 1970]
        std::string until;              // when it ends by itself, for people
        std::int64_t ends = 0;          // the same [ns], monotonic
        Timer timer;                    // ends it then, where there is a loop
    } lock;                             // while guard_ has kLockedBit
    // A client whose lock was broken or ran out, and who has not been told yet.
    struct Former {
        std::weak_ptr<Client> client;
        bool local;                     // it was this process
        std::string why;
        bool is(const ClientPointer& other) const { return other ? client.lock() == other : local; }
    };
    std::vector<Former> formerHolders;  // while guard_ has kFormerBit
    std::unique_ptr<OpenPieces> streams;
};

// A change of options. Members are deleted from the last to the first: so ticks go on again before the old values, which
// commit and before keep, are deleted.
struct Service::Applying {
    Change::Values values;
    Change::Values conditions = {};         // what options must have before (-if)
    std::vector<Record::KeptSource> sources;    // of each value
    std::vector<const Option*> options;     // of the values, each once; apply() finds them
    bool birth = false;                     // the recipe: there were no values before
    bool more = false;                      // actions follow, before ticks go on
    std::vector<Record::Undo> before;       // the values so far
    Commit commit = nullptr;
    std::optional<BetweenTicks> between = std::nullopt;     // set when the slow part is done
};

// The actions and inspections that every class has. Each answers in reply.text and throws Error.
struct CommonRequests {
    static const std::vector<Action>& actions();
    static const std::vector<Action>& inspections();
    // The action or inspection of that name: the class's own, else a common one; null: there is none.
    static const Action* findAction(const Class& type, std::string_view name);
    static const Action* findInspection(const Class& type, std::string_view name);

    static constexpr std::string_view kIf = "-if";      // configure() judges it before all other words are done
    static void remember(Service& s, Args args, Message& reply);
    static void forget(Service& s, Args args, Message& reply);
    static void help(Service& s, Args args, Message& reply);
    static void why(Service& s, Args args, Message& reply);
    static void diff(Service& s, Args args, Message& reply);
    static void stats(Service& s, Args args, Message& reply);
    static std::int64_t p99(Service& s);        // time that 99 of 100 EXEC do not exceed [ns]; 0: none was timed
    static void info(Service& s, Args args, Message& reply);
    static void verbosity(Service& s, Args args, Message& reply);
    static void undo(Service& s, Args args, Message& reply);
    static void save(Service& s, Args args, Message& reply);
    static void lock(Service& s, Args args, Message& reply);
    static void unlock(Service& s, Args args, Message& reply);
    static void stream(Service& s, Args args, Message& reply);
    // told: the holder knows that it ends.
    static void endLock(Service& s, const std::string& why, bool told);
    static std::string optionsList(Service& s, std::string_view only, const Permit& permit);    // a Tcl list; only: one option, or empty for all
    static std::string trailText(const Trail& trail);
    static std::string describe(const Service::Record::Source& source);     // for people
    static int needOption(Service& s, const std::string& name);
};

// Append a line to the text of a reply.
inline void addLine(Message& reply, std::string_view line) {
    if (!reply.text.empty()) reply.text += '\n';
    reply.text += line;
}

// Errors in the words of a recipe, as far as the table of its class shows them: place of the word, from 0, and the reason.
// Words that -SUBST brings are not looked at, and no object is made.
struct WordFault {
    std::size_t word;
    std::string why;
};
std::vector<WordFault> faultsOf(const Class& type, const std::string& name, const std::vector<std::string>& words);

// Fails as Service::ctrl and Service::dbx do before they change anything, as far as the table of the class decides it. Returns when all is
// well, and when only the object can say it.   rights: of the author, to the object.
void checkWords(const Class& type, const std::string& name, const std::vector<std::string>& words, bool ctrl, Rights rights);
// The owner's, who needs no right to files and programs.
inline bool isOwners(Rights rights) { return rights & Rights(Right::policy); }

}  // namespace sorma
