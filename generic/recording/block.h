// block.h -- records of a recording in memory: gathered in a block, and read out of one.
//
// A block stands alone: whatever a record needs to be understood, the texts that its numbers stand for, is in its block.
//
// Threads: none of its own; an object belongs to one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "bus/message.h"
#include "recording/format.h"

namespace sorma::recording {

// A record, without the parts of its message. doc/recording.md says what each field means, kind by kind.
struct Facts {
    Kind kind = Kind::note;
    std::optional<Method> method = {};
    std::string_view source = {}, object = {}, word = {};
    int code = 0;
    std::int64_t time = 0;              // [ns since 1970]
    std::uint64_t number = 0;
    std::int64_t span = 0;              // [ns]
};

// A block that is being filled.
class Block {
public:
    Block() = default;
    Block(Block&&) = default;
    Block& operator=(Block&&) = default;
    // Append a record. False: it would be larger than kMostRecord, and nothing has changed.
    // content: its parts and its trail become part of the record; null: none.
    bool add(const Facts& facts, const Message* content = nullptr);
    // The number of a text in this block, from 1; the empty text is 0.
    std::uint32_t name(std::string_view text);

    bool empty() const { return bytes_.empty(); }
    bool full() const { return bytes_.size() >= kBlockBytes; }
    std::size_t size() const { return bytes_.size(); }
    std::uint32_t records() const { return records_; }                  // names are none
    std::uint32_t states() const { return states_; }                    // of its records
    std::int64_t first() const { return first_; }
    std::int64_t last() const { return last_; }
    const std::vector<std::string_view>& names() const { return names_; }
    // Give each record its check sum. The bytes are what stands in the file then, unless they are compressed.
    const std::string& finish(std::uint64_t file, std::uint64_t number);
    void clear();                       // keeps the memory

private:
    struct Hash {
        using is_transparent = void;
        std::size_t operator()(std::string_view text) const { return std::hash<std::string_view>()(text); }
    };
    void append(const RecordHead& head, const Message* content, std::size_t size);
    std::string bytes_;
    std::unordered_map<std::string, std::uint32_t, Hash, std::equal_to<>> known_;
    std::vector<std::string_view> names_;       // keys of known_, in the order of their numbers
    std::string_view lastText_[3];              // keys of known_: most records name the same as the one before
    std::uint32_t lastName_[3] = {};
    std::uint32_t records_ = 0, states_ = 0;
    std::int64_t first_ = 0, last_ = 0;
};

// A record that was read. Its texts are valid as long as its block.
struct Record : Facts {
    // Read its parts into a message, which is emptied before. False: they are no message; then the file was not made by SORMA.
    bool read(Message& out) const;
    std::string_view content;           // the parts, as they lie in the file
    std::uint16_t parts = 0;
};

// Reads the records of a block, one by one.
class BlockReader {
public:
    BlockReader() = default;
    // bytes: what finish() gave for the same numbers, or the beginning of it.
    BlockReader(std::string bytes, std::uint64_t file, std::uint64_t number);
    // The next record. False at the end, or where the bytes are broken; whole() tells these apart.
    bool next(Record& out);
    bool whole() const { return at_ == bytes_.size(); }      // after next() was false: each byte has been read
    std::size_t at() const { return at_; }                   // bytes of the records that were read
    std::uint32_t records() const { return records_; }       // that were read, with those of kinds that are not known here
    const std::vector<std::string_view>& names() const { return names_; }       // so far; number 1 is the first

private:
    bool take(RecordHead& head);
    std::string_view text(std::uint32_t name) const { return name == 0 ? std::string_view() : names_[name - 1]; }
    std::string bytes_;
    std::size_t at_ = 0;
    std::uint32_t check_ = 0, records_ = 0;
    std::vector<std::string_view> names_;
};

}  // namespace sorma::recording
