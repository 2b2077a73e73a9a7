// writer.h -- the file of a recording, while it is made.
//
// Blocks are written one behind the other. With a limit, the newest take the place of the oldest: the file is a black box then.
// Consecutive blocks of kBlockBytes or more in all are a section; the index, which close() writes, has an entry for each.
// Whenever the process ends, the blocks that were written are read.
//
// Threads: none of its own; an object belongs to one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "bus/descriptor.h"
#include "recording/block.h"

namespace sorma::recording {

// A part of the file: blocks that stand one behind the other and were written so.
struct Section {
    std::uint64_t at = 0, bytes = 0;            // in the file
    std::uint64_t number = 0;                   // of its first block
    std::uint64_t blocks = 0, records = 0, states = 0;      // states are records, too
    std::int64_t first = 0, last = 0;           // times of its records [ns since 1970]
    std::vector<std::uint32_t> names;           // all texts of its records, by their place in the list of names; in order
    bool named = true;                          // false: it is not known which texts these are
};

struct WriterOptions {
    std::uint64_t most = 0;         // bytes of the file, without its index; 0: no limit; kLeastFile or more
    std::int64_t keep = 0;          // [ns] older records may be overwritten; 0: none
    bool compress = false;          // with zstd, where the library is there
    static constexpr std::uint64_t kLeastFile = 4 * kBlockBytes;
};

// The places of sections and their names. The oldest section comes first.
struct Index {
    std::vector<Section> sections;
    std::vector<std::string> names;
};

// Can recordings be compressed here?
bool canCompress();

class Writer {
public:
    // Replaces what is there; the file is for its owner alone. Fails with a FileError, also when a recorder writes it already.
    explicit Writer(std::string file, WriterOptions options = {});
    // Write a block, and clear it. Fails with a FileError; the next block is written in its place then.
    void write(Block& block);
    // Write the index. Nothing may be written then. Without it, readers look through the file.
    void close();
    // The index of all that was written so far.
    Index index() const;

    std::uint64_t id() const { return id_; }
    std::uint64_t bytes() const { return end_; }            // of the file
    std::uint64_t records() const { return records_; }      // written so far

private:
    void put(std::uint64_t at, const void* bytes, std::size_t n);
    bool isFree(std::uint64_t at, std::uint64_t bytes) const;
    std::uint64_t place(std::uint64_t bytes);
    std::uint64_t putBlock(Block& block, std::uint32_t flags);
    void note(const Block& block, std::uint64_t at);
    void putIndex();

    static constexpr std::size_t kMostNames = 100'000;      // that the index tells
    const std::string file_;
    const WriterOptions options_;
    Descriptor out_;
    std::uint64_t id_ = 0, number_ = 0, records_ = 0;
    std::uint64_t next_ = 0, end_ = 0;          // where the newest block ends; where the file ends
    std::deque<Section> sections_;              // in the order in which they were written
    std::map<std::string, std::uint32_t, std::less<>> known_;
    std::vector<const std::string*> names_;
    std::string packed_;
};

}  // namespace sorma::recording
