// timeline.h -- a recording of the bus as marks on a line of time, by source and object; for windows, `timeline` in doc/recorder.man.
//
// A thread reads the file once, section by section, and later what was written since. Meanwhile questions are answered from what
// it has read. A question costs what it shows, and not what is in the file. A mark has 16 bytes, and is kept for its object and for its source.
//
// Threads: the SORM's, but for that thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <unordered_map>
#include <vector>

#include <recording/reader.h>

#include "track.h"

namespace recorder {

class Timeline {
public:
    using MayTell = std::function<bool(std::string_view object)>;
    // index: as the writer has it, while this process writes the file. A file that cannot be read is told by `about`.
    explicit Timeline(std::string file, std::optional<sorma::recording::Index> index = {});
    ~Timeline();
    Timeline(const Timeline&) = delete;
    Timeline& operator=(const Timeline&) = delete;

    // Read what was written since, behind the scenes: new blocks alone. A file that was replaced, became shorter, or a black box that
    // has few of its old blocks is read anew. While it is being read, nothing happens.
    void more();
    // Answer a question: the words behind `timeline`. Returns what is wrong with them; empty: nothing. mayTell: others are not
    // told of; empty: all are.
    std::string answer(const std::vector<std::string>& words, std::size_t at, const MayTell& mayTell, std::string& out);

private:
    static constexpr std::size_t kMostMarks = 24'000'000;       // of all objects, and so many of all sources
    static constexpr std::size_t kMostTracks = 20'000, kMostAwaited = 1'000'000;
    using Record = sorma::recording::Record;
    struct Source {
        Track all, own;                     // of all its objects; what belongs to none
        std::map<std::string, Track, std::less<>> objects;
    };
    // A mark, and where it belongs.
    struct Found {
        std::uint32_t source, object;
        Mark mark;
        bool completes = false;             // an open mark that was told before
    };
    struct Awaited {
        std::int64_t time;
        std::uint32_t object, section;
        bool told = false;                  // as an open mark
    };
    // The names of the file, by numbers of ours. The thread's alone.
    struct Names {
        std::uint32_t of(std::string_view text);
        struct Hash {
            using is_transparent = void;
            std::size_t operator()(std::string_view text) const { return std::hash<std::string_view>()(text); }
        };
        std::unordered_map<std::string, std::uint32_t, Hash, std::equal_to<>> known;
        std::vector<const std::string*> texts;
    };
    void run(bool more);
    std::size_t open(bool more);
    void forget();
    void read(std::size_t section);
    void take(const Record& record, std::uint32_t section);
    void merge();
    void tellOpen();
    void giveUp();
    // With the lock.
    void about(const MayTell& mayTell, std::string& out) const;
    void tracks(const MayTell& mayTell, std::string& out) const;
    void draw(const View& view, Source& source, std::string_view object, std::size_t most, const MayTell& mayTell, std::string& out);
    void describe(const std::string& source, std::string_view row, std::int64_t time, std::int64_t within, const MayTell& mayTell, std::string& out);
    static void tellMark(std::string_view source, std::string_view object, const Mark& mark, std::string& out);
    std::string recordsOf(const std::string& source, std::string_view object, const Mark& mark, const MayTell& mayTell);
    // The tracks that stand for a row. object: empty for all of the source.
    void each(Source& source, std::string_view object, const MayTell& mayTell, const std::function<void(std::string_view object, Track& track)>& body);

    const std::string file_;
    std::mutex reading_;                    // of reader_; after mutex_, where both are held
    std::unique_ptr<sorma::recording::Reader> reader_;
    mutable std::mutex mutex_;              // of what follows
    std::map<std::string, Source, std::less<>> sources_;
    std::string error_;
    std::size_t sections_ = 0, done_ = 0;
    std::size_t marks_ = 0, tracks_ = 0;
    std::uint64_t version_ = 0;             // another one when something came
    std::int64_t first_ = View::kMost, last_ = View::kLeast;
    bool ended_ = false, full_ = false;
    // The thread's alone.
    std::optional<sorma::recording::Index> index_;
    std::string refused_;                   // the version of the file that could not be opened
    Names names_;
    std::vector<Found> found_;
    std::map<std::uint32_t, std::unordered_map<std::uint64_t, Awaited>> awaited_;       // by sources, then by the numbers of requests
    std::size_t waiting_ = 0;
    struct Place {
        Source* source;
        Track* track;
    };
    std::unordered_map<std::uint64_t, Place> places_;       // of both names
    std::atomic<bool> stop_{false};
    std::thread thread_;                    // last: it uses what is above
};

}  // namespace recorder
