// recording.h -- records of snapshot buffers in a file, in the order in which they were written.
//
// The file begins with Head. Then come frames: Frame, and what belongs to it. A frame of channel n, from 0 on, is a record: its
// floats, then its bytes of any. A frame of kNewChannel announces the next channel: Channel. The last frame has kEnd: its counter says how
// many frames are before it, so that a file that was cut is noticed. Nothing follows it. Each byte is under a check sum: a file in which
// a single bit has turned is refused. Numbers are as the machine has them; another byte order is refused.
//
// Version 1, which is read as well, had FNV-1a as its check sum, and none over the head.
//
// Threads: none of its own; an object belongs to one thread.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <shmem/ring.h>

namespace recorder {

// The message names the file, the byte and what is wrong there.
struct FileError : std::runtime_error {
    using runtime_error::runtime_error;
};

// A recorded buffer. A buffer of another shape with the same key is another channel.
struct Channel {
    std::string key;                // without the prefix
    shmem::Shape shape;
};

struct Record {
    std::uint32_t channel = 0;
    shmem::Stamp stamp;
    std::vector<double> floats;
    std::vector<unsigned char> any;
};

struct Head {
    char magic[20] = "sorma-recording 2\n";
    std::uint32_t check = 0;        // CRC32C of the head with check 0
    std::uint64_t order = 0x0102030405060708;
    std::int64_t monotonic = 0;     // [ns] when the recording began
    std::int64_t wall = 0;          // [us] since 1970
};
struct Frame {
    static constexpr std::uint32_t kNewChannel = 0xfffffffe, kEnd = 0xffffffff;
    std::uint32_t channel = 0;
    std::uint32_t check = 0;        // CRC32C of the frame with check 0, and of what belongs to it
    std::uint64_t counter = 0;      // of a record: that of its stamp
    std::int64_t monotonic = 0, wall = 0;
};

struct CloseFile {
    void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// Both fail with a FileError.
class RecordingWriter {
public:
    explicit RecordingWriter(std::string file);         // replaces what is there
    std::uint32_t announce(const Channel& channel);
    void write(const Record& record);
    void flush();                   // to the system: what is before this survives the end of this process
    void close();                   // writes the last frame, which says that the file is complete

private:
    void put(Frame frame, const void* a, std::size_t aBytes, const void* b = nullptr, std::size_t bBytes = 0);
    void put(const void* bytes, std::size_t n);
    const std::string file_;
    File out_;
    std::uint32_t channels_ = 0;
    std::uint64_t frames_ = 0;
};

class RecordingReader {
public:
    // partial: a file that has been cut ends with the last frame that is whole.
    RecordingReader(std::string file, bool partial);
    // Read the next record; false: that was the last one. Its channel is in channels() then.
    bool next(Record& record);
    const std::vector<Channel>& channels() const { return channels_; }
    const Head& head() const { return head_; }

private:
    using Sum = std::uint32_t (*)(const void* bytes, std::size_t n, std::uint32_t before);
    std::uint32_t checkOf(Frame frame) const;
    bool get(void* to, std::size_t n);                  // false: the file is cut here, and that is allowed
    bool cut() const;               // returns false when the file may end here; else throws
    [[noreturn]] void refuse(const std::string& why) const;
    const std::string file_;
    const bool partial_;
    File in_;
    Sum sum_ = nullptr;             // of the file's version
    std::uint32_t first_ = 0;       // the sum of no bytes
    Head head_;
    std::vector<Channel> channels_;
    std::uint64_t at_ = 0, frames_ = 0, size_ = 0;      // at_: where the frame in hand begins
};

}  // namespace recorder
