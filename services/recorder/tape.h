// tape.h -- recording buffers, playing them, and making tables of them.
//
// Each runs in a thread of its own until its end, or until it is stopped.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <recording/recorder.h>

#include "recording.h"

namespace recorder {

struct Plan {
    std::string file, prefix, program;
    std::vector<std::string> buffers;       // patterns of keys, without the prefix
    std::string clock;                      // this buffer's float 0 is the time to play by; empty, or not recorded: wall time
    double speed = 1;                       // recorded seconds in a second; 0: as fast as it goes
    bool partial = false;
    std::string folder;                     // of tables
    std::function<void(std::size_t bytes)> charge;      // play: so much shared memory is about to be used; fails when that is too much

    sorma::recording::Recorder* bus = nullptr;          // record into this one, and not into the file

    bool wants(const std::string& key) const;
};

struct Figures {
    std::uint64_t records = 0, lost = 0;    // lost: overwritten before they were read
    std::size_t buffers = 0;
};

// Work in a thread of its own. The work calls rest() now and then to learn whether it has to stop. done gets its exception,
// or null.
class Job {
public:
    using Work = std::function<Figures(Job&)>;
    using Done = std::function<void(Figures, std::exception_ptr)>;      // on the job's thread
    Job(Work work, Done done);
    ~Job();                                 // stops it, and waits for that
    void stop();
    // Called by the work: sleep until a time [ns, monotonic]. False: the work has to stop.
    bool rest(std::int64_t until);
    bool ended() const;

private:
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    bool stop_ = false, ended_ = false;
    std::thread thread_;
};

// A recording that is being made.
class Recording {
public:
    // Begins to record: records that are written to the buffers from now on will be in the file. Fails with a FileError.
    explicit Recording(Plan plan);
    // Writes records to the file until the job is stopped, including those that have come by then.
    Figures run(Job& job);

private:
    struct Source {
        shmem::Reader reader;
        std::uint32_t channel;
        std::uint64_t next;                 // record to be taken next
    };
    void look();                            // for buffers that are not taken yet
    void take(Source& source);
    void takeAll();
    std::uint32_t announce(const Channel& channel);
    void write(const Record& record);
    void lose(const Source& source, std::uint64_t records);
    void add(sorma::recording::Facts facts, std::uint32_t channel, const sorma::Message& m);

    const Plan plan_;
    std::unique_ptr<RecordingWriter> out_;  // null: into plan_.bus
    std::vector<std::string> channels_;     // their keys, for plan_.bus
    sorma::Message message_;
    std::map<std::string, Source> sources_; // by their keys
    std::set<std::string> seen_;            // all keys that there were
    std::vector<Record> batch_;             // of one look at all buffers; the first used_ of them, the others are there to be used again
    std::size_t used_ = 0;
    std::int64_t nextLook_ = 0;
    Figures figures_;
};

// A recording is read through before the first record is played. Fails with a FileError, or a shmem::Failure when a buffer
// cannot be written.
Figures play(Job& job, const Plan& plan);
// A file KEY.csv in plan.folder for each buffer.
Figures exportTables(Job& job, const Plan& plan);
// A line for each buffer: key, floats, bytes of any, records, seconds from the first to the last, records that are missing.
Figures list(Job& job, const Plan& plan, std::string& text);

}  // namespace recorder
