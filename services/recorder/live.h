// live.h -- what passes on the bus of one process, sent in pieces to a recorder in another one, which merges several of them.
//
// A piece is a block of records as it stands in a file (doc/recording.md). Its bytes are `any`. The ints are the number of the block
// and an offset: the clock of its records less the monotonic clock of the host. A third one is the time up to which all has been sent. Processes of one host have the same monotonic clock.
// So their records can be put on one clock, also when the wall time steps between the beginnings of two recorders. The clock of another
// host is compared as class clock does it.
//
// Threads: the SORM's, but for LivePieces::take.
#pragma once

#include <sorma.h>

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <recording/recorder.h>

#include "clock/difference.h"

namespace recorder {

// The writer of such a stream. It records from the first piece that is wanted.
class LivePieces : public sorma::Pieces {
public:
    // all: those of an object; this one adds itself, and removes itself at its end.
    using All = std::shared_ptr<std::set<LivePieces*>>;
    LivePieces(sorma::Sorm& sorm, sorma::recording::Selection selection, All all);
    ~LivePieces() override;
    // Send soon what there is, also that there is nothing.
    void push() { if (recorder_) recorder_->push(); }
    bool next(sorma::Message& piece, std::size_t most) override;
    bool works() const override { return false; }
    std::size_t heap() const override { return kMost * sorma::recording::kBlockBytes; }

private:
    // Blocks that wait for the reader. More are refused: the recorder counts them as lost, and says so in the stream.
    static constexpr std::size_t kMost = 32;
    void take(sorma::recording::Block& block, std::int64_t upTo);
    sorma::Sorm& sorm_;
    const sorma::recording::Selection selection_;
    const All all_;
    std::mutex mutex_;
    struct Waiting {
        std::string bytes;
        std::int64_t upTo;
        std::uint64_t number;
    };
    std::deque<Waiting> blocks_;                            // with the lock
    std::uint64_t number_ = 0;
    std::unique_ptr<sorma::recording::Recorder> recorder_;  // last: its thread uses what is above
};

// Reads such streams of several recorders, and gives their records to a recorder here, ordered by time. A record waits kHold for
// earlier ones of others. One that comes later than that is not moved. Recorders without work rest: they are asked whether that is still
// so while a record waits for them. When a daemon is lost a note says so, and it is tried
// again each kRetry. The clock of each is compared kCompares times before its records are taken, and then each kCompare. A difference that
// is larger than its error is in the file (Kind::source).
class Merge {
public:
    static constexpr std::int64_t kHold = 500'000'000, kRetry = 1'000'000'000, kTurn = 50'000'000;     // [ns]
    static constexpr std::int64_t kCompare = 1'000'000'000, kTellClock = 60'000'000'000;                // [ns]
    static constexpr std::size_t kCompares = 4;
    // names: of the recorders; request: the words that each of them gets.   to: gets the records, and lives longer.
    Merge(sorma::Sorm& sorm, const std::vector<std::string>& names, std::vector<std::string> request, const sorma::PrincipalPointer& author,
          sorma::recording::Recorder& to);
    ~Merge();
    // All that has come is given on, in order; then nothing more is taken.
    void stop();
    // The same, when all that has happened so far has come. Runs the event loop, until nothing of it has come for 2 s; a minute at most.
    void drain();
    std::size_t connected() const;          // recorders that have answered, and are not lost
    std::vector<std::pair<std::string, std::string>> away() const;      // those that are lost, and why, in one line

private:
    struct Source {
        std::string name;
        std::unique_ptr<sorma::Reading> reading;
        std::string daemon;                 // as its records name it; empty: none has come
        std::string lost;                   // why; empty: it is there
        bool heard = false;                 // it has answered, and is not lost
        std::int64_t upTo = INT64_MIN;
        std::int64_t pushed = INT64_MIN;    // when it was asked for what it has
        std::uint64_t pieces = 0;           // that have come
        sorma::Timer retry;
        sorma::Reference recorder;
        timing::Difference clock;           // of its monotonic clock from ours
        std::int64_t ahead = 0;             // by which its clock is taken to be ahead [ns]
        std::int64_t told = INT64_MIN;      // when that was written, by our monotonic clock
        std::int64_t newest = INT64_MIN, floor = INT64_MIN;     // times of its records; none that comes is before floor
        sorma::Timer compare;
        std::uint64_t round = 0;            // answers to earlier ones are not wanted
    };
    struct Held {
        sorma::recording::Facts facts;      // its texts are those below
        std::string source, object, word;
        sorma::Message message;
        std::size_t bytes;
    };
    void open(Source& source);
    void compare(Source& source);
    void compared(Source& source, std::int64_t sent, const sorma::Future& answer);
    void setAhead(Source& source);
    void begin(Source& source);
    void await(Source& source);
    void take(Source& source);
    void lose(Source& source, const std::string& why);
    void absorb(Source& source, sorma::Message& piece);
    void note(const Source& source, std::string_view what, const std::string& text);
    void give(std::int64_t until);
    void settle();
    void push();
    void turn();
    std::int64_t complete() const;

    sorma::Sorm& sorm_;
    const std::vector<std::string> request_;
    const sorma::PrincipalPointer author_;
    sorma::recording::Recorder& to_;
    std::vector<std::unique_ptr<Source>> sources_;
    std::multimap<std::int64_t, Held> held_;
    std::size_t heldBytes_ = 0;
    sorma::Timer turn_;
    std::shared_ptr<Merge*> alive_ = std::make_shared<Merge*>(this);        // callbacks of futures ask
};

}  // namespace recorder
