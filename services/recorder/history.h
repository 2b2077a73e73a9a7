// history.h -- questions to a past moment, answered from a recording of the bus alone. No object is asked.
//
// It reads sections of the file backwards from that moment, up to the last record of all options of the object (Kind::state,
// doc/recording.md). Changes that came later are applied. An Unknown says that the recording cannot tell: it begins later or has ended,
// a daemon was lost, records are missing, or a value has changed by itself.
//
// Threads: none of its own; an object belongs to one thread at a time.
#pragma once

#include <sorma.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <recording/reader.h>
#include <recording/recorder.h>

namespace recorder {

// The text says what is not in the recording, and why.
struct Unknown : std::runtime_error {
    using runtime_error::runtime_error;
};

// Tells apart a file from another one, and from itself when it was written meanwhile.
std::string versionOf(const std::string& file);

// An exact number of ns for "12.000000345". False: it is no such number.
bool readSeconds(std::string_view text, std::int64_t& ns);

class History {
public:
    // until: up to which moment it has all records; nothing: up to its last record.
    explicit History(std::unique_ptr<sorma::recording::Reader> reader, std::optional<std::int64_t> until = {});
    // Answer a question to that moment [ns since 1970]:
    //     NAME cget -option      NAME configure     NAME DBX -get -option    NAME DBX -dump     NAME DBX -trail
    //     buffer KEY             shmem_r.KEY EXEC   underway ?PATTERN?
    // NAME may be NAME@SOURCE. The answer becomes the text of the message; a record of a buffer its numbers and bytes.
    // Fails with an Unknown, also for other questions.
    // mayTell: others are not told of; empty: all are.
    void answer(std::int64_t time, const std::vector<std::string>& question, const std::function<bool(std::string_view)>& mayTell, sorma::Message& out);

private:
    using Record = sorma::recording::Record;
    struct Mark {
        std::uint64_t number = 0;
        std::int64_t time = 0;
    };
    // The facts that one source has told of an object.
    struct Known {
        std::optional<std::int64_t> whole, gone;        // when all its options were recorded last, and when it was removed
        std::string type;                               // its class
        std::vector<std::pair<std::string, std::string>> values;        // those that were recorded then
        std::map<std::string, std::pair<std::int64_t, std::string>> told;       // changes: when and to what
        Mark trail;
    };
    struct Source {
        std::optional<std::int64_t> looked;             // when the last complete look began
        std::optional<std::int64_t> look;               // the last one, complete or not
        std::vector<Mark> underWay;                     // at that time
        std::int64_t lost = INT64_MIN, found = INT64_MIN;      // its stream
        std::string why;                                // it was lost
        struct Missing {
            std::int64_t first, last;
            std::uint64_t records;
        };
        std::vector<Missing> missing;
    };
    struct Subject {
        std::string name, source;
    };
    using Take = std::function<void(const Record&)>;
    // A name, by its place in the index.
    using Place = std::optional<std::uint32_t>;
    Place placeOf(std::string_view name) const;
    static bool has(const sorma::recording::Section& section, Place name) { return !section.named || (name && std::binary_search(section.names.begin(), section.names.end(), *name)); }
    template <class Wants, class Enough> void back(std::int64_t time, Wants wants, Enough enough, const Take& take);
    template <class Wants, class Enough> void forth(std::int64_t time, Wants wants, Enough enough, const Take& take);
    bool tells(const sorma::recording::Section& section) const;
    void note(const Record& record);
    void need(std::int64_t time) const;
    Known know(const Subject& subject, std::int64_t time, std::string& source);
    void judge(const Subject& subject, const std::string& source, const Known& known, std::int64_t time) const;
    struct Value {
        std::string option, value;
        std::int64_t since;                     // when it was told, or seen
    };
    void needSame(const std::string& name, const std::string& source, std::vector<Value> values, std::int64_t time);
    std::vector<Value> valuesOf(const Subject& subject, std::string_view option, std::int64_t time);
    void trail(const Subject& subject, std::int64_t time, sorma::Message& out);
    void buffer(const std::string& key, std::int64_t time, sorma::Message& out);
    void underWay(const std::string& pattern, std::int64_t time, const std::function<bool(std::string_view)>& mayTell, sorma::Message& out);
    bool fetch(std::int64_t time, const std::function<bool(const Record&)>& is, const Take& take);
    std::string like(const std::string& name) const;

    const std::unique_ptr<sorma::recording::Reader> reader_;
    std::vector<std::int64_t> lastUpTo_;        // the latest time in this section and all before it
    std::vector<std::uint32_t> marks_;          // names that stand in sections which tell of losses, and of lost sources
    std::map<std::string, std::uint32_t, std::less<>> looks_;       // sources: the word that ends their looks
    bool indexed_ = true;                       // then these are all sources
    std::int64_t first_ = INT64_MAX, last_ = INT64_MIN;
    std::map<std::string, Source, std::less<>> sources_;        // that were met for this question
    sorma::Message message_;
};

}  // namespace recorder
