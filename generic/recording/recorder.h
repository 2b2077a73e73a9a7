// recorder.h -- an observer that records what passes on the bus of this process: requests, their answers, and events.
//
// The SORM's thread only appends records to a block in memory. A thread of the recorder gives full blocks to a sink, and at least every
// kFlush those that are not full. So the SORM never waits for a disk. When the sink refuses a block, or more than kWaiting of them wait,
// their records are lost. The count of these stands in a record of its own, as soon as the sink takes one.
//
// The value of a secret option never gets into a block. Neither do objects that the author of the recording has no right to inspect at
// that moment. Requests to `sorm` and `dict` may tell of any object, so they are recorded for the owner alone.
//
// It also records what objects are like (Kind::state), for questions to a past moment. It looks at all objects when it begins, and again
// after each kLookBytes or kLookTime. Objects that are made and changes that are told come in between. A look goes on in slices of kSlice.
//
// Threads: the SORM's, but for the sink.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "bus/message.h"
#include "bus/principal.h"
#include "bus/request.h"
#include "recording/block.h"

namespace sorma::recording {

// The reasons of losses, in the order of Recorder::Why.
inline constexpr const char* kReasons[] = {"they were not taken fast enough", "larger than a record may be", "no memory", "they could not be written"};

// Records that are missing, for one reason.
struct Loss {
    std::uint64_t records = 0;                  // states are not counted
    std::int64_t first = 0, last = 0;           // over how long [ns since 1970]
    std::uint64_t states = 0;
};

// Where a request comes from: the code of its record.
enum class From : int {
    outside = 0,
    inside = 1,         // it was made in the course of another request from outside
    process = 2,        // by the process itself
};

struct Selection {
    std::string requests, events;               // patterns of the names of objects, as Tcl's string match; empty: none
    std::string source;                         // name of this process in the records
    std::string without;                        // an object that is not recorded: the one which records
    PrincipalPointer author;                    // who records; null: the owner
    // Look at all objects after so many bytes and so long [ns]; 0: kLookBytes, kLookTime. For a file that keeps little.
    std::size_t lookBytes = 0;
    std::int64_t lookTime = 0;
    std::string reader = {};                    // Caller::toText of who gets the records: what he asks sorm by DBX is not recorded
};

// May requests to that object, and their replies, be told to an author? null: the owner. sorm and dict may tell of any object.
bool recordable(std::string_view object, const Sorm& sorm, const PrincipalPointer& author);

class Recorder : public Observer {
public:
    // Takes a block, and empties it. Throws a FileError: then it is lost. Called on the thread of the recorder.
    // upTo: all records up to that time have been given [ns since 1970]; kUnknown: there are more. An empty block comes at least each
    // kFlush, with a time; when kQuiet times nothing was recorded or pushed, each kRest, until something is.
    using Sink = std::function<void(Block& block, std::int64_t upTo)>;
    static constexpr std::int64_t kUnknown = INT64_MIN;
    static constexpr std::int64_t kFlush = 50'000'000, kRest = 1'000'000'000;          // [ns]
    static constexpr int kQuiet = 4;
    static constexpr std::size_t kWaiting = 64;                 // blocks
    static constexpr std::size_t kLookBytes = 4 << 20;          // of records, or four times the bytes of the last look
    static constexpr std::int64_t kLookTime = 60'000'000'000, kSlice = 2'000'000;      // [ns]

    Recorder(Sorm& sorm, Selection selection, Sink sink);
    ~Recorder() override { stop(); }
    // Give the rest to the sink, and end. Waits for that.
    void stop();

    struct Figures {
        std::uint64_t records = 0, lost = 0;    // that the sink has taken; that are missing
        std::string error;                      // why the sink has refused the last time; empty: never
    };
    Figures figures() const;
    // The clock of the records: wall time when it began, and from there by the monotonic clock [ns since 1970].
    std::int64_t now() const;
    // Record what all objects are like, also what has changed by itself. Takes 20 ms at most; the rest comes later.
    void lookAtAll();
    // Record that it ends now, and knows all up to here.
    void tellEnd();
    // All that was added so far has been given to the sink when this returns true. Waits for that, a second at most. Not on the sink's thread.
    bool flush();
    // The same without waiting: it comes soon. Returns how often that was asked for.
    std::uint64_t push();
    // Append a record that comes from elsewhere. Any thread.
    void add(const Facts& facts, const Message& m);

    void came(const Passage& passage, const Message& request) override;
    void answered(const Passage& passage, const Message& reply, std::int64_t ran) override;
    void published(const Event& event) override;

private:
    bool wants(const Passage& passage) const;
    bool isOfReader(const Passage& passage) const;
    From origin(const Passage& passage);
    bool mayTell(std::string_view object) const;
    enum Why : std::uint8_t { slow, large, memory, refused, kWhys };
    void lose(Why why, const Loss& loss);
    // look.cpp: what objects are like
    struct Mark {
        std::uint64_t number;
        std::int64_t time;
    };
    bool tracks(std::string_view object) const;
    void addState(State state, std::string_view object, std::string_view word, Message& m, std::int64_t time, std::int64_t span = 0);
    void tellWhole(std::string_view object);
    void tellChange(const Event& event);
    void beginRequest(std::uint64_t number, std::int64_t time);
    void endRequest(const Passage& passage, const Message& reply, std::int64_t time);
    void look();
    void askForLook();
    void tellBuffers();
    void judgeLook();
    std::size_t mostUnlooked() const;
    void run();
    void give(Block& block, std::int64_t upTo = kUnknown);
    bool giveLosses();

    Sorm& sorm_;
    const Selection selection_;
    const bool allRequests_;                    // no pattern needs to be compared
    const std::int64_t offset_;                 // of the wall time from the monotonic clock [ns]
    const Sink sink_;
    bool active_ = true;                        // the SORM's thread alone
    // Requests of others that are under way: those of their calls, by their own numbers; and these calls.
    std::unordered_map<std::uint64_t, std::uint64_t> open_;
    std::unordered_set<std::uint64_t> calls_;
    std::unordered_set<std::uint64_t> leftOut_;         // requests that have no answer yet, and are not recorded
    std::deque<Mark> underWay_;                 // requests, by their numbers; time 0: it was answered
    std::unordered_map<std::string, Mark> trails_;      // the last reply of each object that has a trail
    std::vector<std::string> toLook_;           // names of objects
    std::size_t looked_ = 0;                    // so many of these were looked at
    std::size_t lookSize_ = 0;                  // bytes of its states
    std::int64_t lookBegan_ = 0;                // 0: no look is under way
    std::shared_ptr<Recorder*> alive_ = std::make_shared<Recorder*>(this);      // work in the mailbox asks
    std::atomic<bool> lookDue_{false};

    mutable std::mutex mutex_;                  // of what follows
    std::condition_variable work_;
    Block block_;                               // is being filled
    std::deque<Block> waiting_;
    std::vector<Block> spares_;
    std::array<Loss, kWhys> losses_;            // that are not told yet
    Figures figures_;
    bool stop_ = false;
    bool resting_ = false;                      // the thread waits for the first record
    std::condition_variable flushed_;
    std::uint64_t asked_ = 0, done_ = 0;        // flushes
    std::map<std::string, Mark, std::less<>> buffers_;  // the newest record of each snapshot buffer
    std::size_t sinceLook_ = 0, lookBytes_ = 0; // bytes
    std::int64_t lookEnded_ = 0;                // by the monotonic clock
    bool lookAgain_ = false;                    // states were lost
    std::thread thread_;                        // last: it uses what is above
};

}  // namespace sorma::recording
