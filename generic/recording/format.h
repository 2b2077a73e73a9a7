// format.h -- how a recording lies in its file; doc/recording.md has it as tables, with the reasons.
//
// The structures are written and read as they lie in memory. A file of the other byte order is refused.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string_view>

namespace sorma::recording {

// The message names the file and says what is wrong, and what to do.
struct FileError : std::runtime_error {
    using runtime_error::runtime_error;
};

inline constexpr std::size_t kBlockBytes = 256 * 1024;      // a block of more bytes is complete, and so is a section
inline constexpr std::size_t kMostRecord = 16 * 1024 * 1024;
inline constexpr std::size_t kMostBlock = 64 * 1024 * 1024;

enum class Kind : std::uint8_t {
    name = 1,       // a text, and the number that stands for it in this block
    source = 2,     // where records come from: a daemon, its clock
    request = 3,
    reply = 4,
    event = 5,
    shape = 6,      // of a snapshot buffer
    sample = 7,     // a record of a snapshot buffer
    loss = 8,       // so many records of a source are missing
    note = 9,       // what the recorder says of itself
    section = 10,   // in the index: consecutive blocks
    state = 11,     // what an object was like: for questions to a past moment, and not counted among the records
};
inline constexpr Kind kLastKind = Kind::state;

// The code of a record of kind state.
enum class State : int {
    told = 0,       // options have changed: words -option value
    whole = 1,      // all options of the object
    gone = 2,       // the object was removed
    look = 3,       // here begins a look at all objects. Ints: number and time of each request that is under way
    looked = 4,     // it has ended; span: since it began
    end = 6,        // the recorder has stopped; all up to here is recorded
    buffer = 5,     // of a snapshot buffer. Ints: counter and time of its newest record
};
// Their words, in look and looked, with the source behind. So the index tells which sources there are, and which sections have their looks.
inline constexpr std::string_view kLook = "look at all objects of ", kLooked = "end of the look at all objects of ";

struct FileHead {
    char magic[24] = "sorma-recording 3\n";
    std::uint64_t id = 0;               // chosen at random; in each block, too
    std::int64_t began = 0;             // [ns since 1970]
    std::int64_t monotonic = 0;         // [ns] the same moment by the recorder's monotonic clock
    std::uint64_t order = 0x0102030405060708;
    std::uint32_t zero = 0;
    std::uint32_t check = 0;            // CRC32C of what is before it
};
struct BlockHead {
    enum Flags : std::uint32_t { zstd = 1, index = 2 };
    char magic[8] = {'S', 'O', 'b', 'l', 'o', 'c', 'k', '\n'};
    std::uint64_t id = 0;               // of the file
    std::uint64_t number = 0;           // of the block, from 0
    std::uint32_t stored = 0;           // bytes that follow this head
    std::uint32_t plain = 0;            // bytes of its records; the same, unless they are compressed
    std::uint32_t records = 0;
    std::uint32_t flags = 0;
    std::int64_t first = 0, last = 0;   // earliest and latest time of its records [ns since 1970]
    std::uint32_t states = 0;           // of its records, so many are states
    std::uint32_t check = 0;
};
struct RecordHead {
    std::uint32_t size = 0;             // of the record, with this head
    std::uint32_t check = 0;            // CRC32C of the rest of it, continued from the record before
    static constexpr std::uint8_t kNoMethod = 255;
    enum Parts : std::uint16_t { text = 1, floats = 2, ints = 4, any = 8, words = 16, trail = 32, all = 63 };
    Kind kind = Kind::note;
    std::uint8_t method = kNoMethod;
    std::uint16_t parts = 0;            // which follow, see Parts
    std::int32_t code = 0;
    std::uint32_t source = 0, object = 0, word = 0;     // names, by their numbers in this block; 0: none
    std::uint32_t zero = 0;
    std::int64_t time = 0;              // [ns since 1970], by the clock of the recorder
    std::uint64_t number = 0;
    std::int64_t span = 0;              // [ns]
};
// The end of a recording that was closed.
struct FileEnd {
    char magic[8] = {'S', 'O', 'e', 'n', 'd', '.', '.', '\n'};
    std::uint64_t id = 0;
    std::uint64_t index = 0;            // where its first block of the index begins
    std::uint32_t zero = 0;
    std::uint32_t check = 0;
};
static_assert(sizeof(FileHead) == 64 && sizeof(BlockHead) == 64 && sizeof(RecordHead) == 56 && sizeof(FileEnd) == 32);

}  // namespace sorma::recording
