// busRecording.h -- what passes on the bus of this process, recorded in a file; and such a file, read as text.
//
// Threads: the SORM's.
#pragma once

#include <sorma.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <recording/reader.h>
#include <recording/recorder.h>
#include <recording/writer.h>

namespace recorder {

// Requests and events of this process, until stop().
class BusRecording {
public:
    // Fails with a sorma::recording::FileError.
    BusRecording(sorma::Sorm& sorm, sorma::recording::Selection selection, const std::string& file, sorma::recording::WriterOptions options)
        : writer_(file, options), recorder_(sorm, std::move(selection), [this](sorma::recording::Block& block, std::int64_t) {
              std::lock_guard lock(mutex_);
              writer_.write(block);
          }) {}
    ~BusRecording() { recorder_.stop(); }
    // Write what has come so far, and the index. The result says what was not possible; the file can be read all the same.
    sorma::recording::Recorder::Figures stop() {
        recorder_.lookAtAll();
        recorder_.tellEnd();
        recorder_.stop();
        auto figures = recorder_.figures();
        try {
            writer_.close();
        } catch (const sorma::recording::FileError& e) {
            figures.error = e.what();
        }
        return figures;
    }
    sorma::recording::Recorder& recorder() { return recorder_; }
    // Where in the file is what. All that has happened so far is there, if the disk is not too slow.
    sorma::recording::Index index() {
        recorder_.flush();
        std::lock_guard lock(mutex_);
        return writer_.index();
    }

private:
    std::mutex mutex_;                          // of writer_, which the recorder's thread uses
    sorma::recording::Writer writer_;
    sorma::recording::Recorder recorder_;
};

// [s since 1970], with all its digits.
std::string seconds(std::int64_t ns);
// A request as it can be typed, a reply, or the content of another record.   m: for its parts.
std::string textOf(const sorma::recording::Record& record, sorma::Message& m);
// A record as a dict, see `records` in doc/recorder.man.   text: of textOf;   request: that of a reply; empty: not known.
std::string dictOf(const sorma::recording::Record& record, const std::string& text, const std::string& request = {});

// Which records are wanted of a file.
struct Search {
    std::string name = "*";             // of the object, a pattern as Tcl's string match
    std::string text;                   // somewhere in texts and words; empty: any
    std::int64_t from = INT64_MIN, until = INT64_MAX;       // [ns since 1970]
    std::int64_t slower = -1;           // replies that took more than so long [ns]; -1: all records
    bool failed = false;                // replies with a code below 0, alone
    std::function<bool(std::string_view object)> mayTell;   // records of other objects are skipped

    // Takes words "-name PATTERN -text TEXT -from S -until S -slower S -failed". Returns what is wrong with them; empty: nothing.
    std::string read(const std::vector<std::string>& words, std::size_t at);
};

// The records of a file as text: a list of Tcl, an element each, which is a dict; see `records` in doc/recorder.man.
class RecordText {
public:
    // Fails with a FileError.
    RecordText(const std::string& file, Search search) : reader_(file), search_(std::move(search)) {}
    // Append records, until there are so many bytes. Nothing is appended: that was all.
    void next(std::string& out, std::size_t most);

private:
    using Key = std::pair<std::string, std::uint64_t>;      // source and number of a request
    void add(std::string& out, const sorma::recording::Record& record);
    bool mayHave(const sorma::recording::Section& section) const;
    void await(Key key, std::string request);

    sorma::recording::Reader reader_;
    const Search search_;
    std::size_t section_ = 0;
    bool begun_ = false;                    // the section has been
    sorma::Message message_;
    // Requests whose replies may still come, up to kMostAwaited bytes.
    static constexpr std::size_t kMostAwaited = 32 << 20;
    std::map<Key, std::string> awaited_;
    std::deque<Key> order_;                 // of awaited_, the oldest first
    std::size_t awaitedBytes_ = 0;
};

// The file as a whole: a dict of Tcl, see `about` in doc/recorder.man. Fails with a FileError.   names: tell whom it is about, too.
std::string describe(const std::string& file, bool names);

}  // namespace recorder
