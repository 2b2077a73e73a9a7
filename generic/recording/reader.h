// reader.h -- what is in the file of a recording, also when that was cut, spoiled, or is still written.
//
// The bytes of the file may be anything: reading ends, says what is wrong, and needs 64 MB more than the file at most.
//
// Threads: none of its own; an object belongs to one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "bus/descriptor.h"
#include "recording/block.h"
#include "recording/writer.h"

namespace sorma::recording {

// A place of the file that could not be read.
struct Damage {
    std::uint64_t at = 0, bytes = 0;
    std::string what;
};

class Reader {
public:
    // Fails with a FileError when the file cannot be read, is no recording, or one of a newer version.
    explicit Reader(std::string file);
    // The same while a writer of this process writes it, which knows what is where.
    Reader(std::string file, Index index);

    const FileHead& head() const { return head_; }
    std::uint64_t bytes() const { return size_; }
    bool closed() const { return closed_; }                 // has it an index?
    // The parts of the file, the oldest first. Without an index their names are not known before they were read.
    const std::vector<Section>& sections() const { return sections_; }
    const std::vector<std::string>& names() const { return names_; }
    // The broken places that were found so far. Reading all records finds all.
    const std::vector<Damage>& damages() const { return damages_; }

    // The next record, the oldest first. The texts of a record are valid until the next call. False at the end, or where the section
    // `before` begins.
    bool next(Record& out, std::size_t before = SIZE_MAX);
    // Go on with this section of sections(); beyond them is the end.
    void seek(std::size_t section);
    std::size_t section() const { return section_; }        // of the last record

    // Take in blocks that were written since, at most some 64 MB of them: they are new sections, behind those that there are. A
    // section whose place they took has no bytes any more; the others stay where they are in sections(). A block that is
    // not complete yet is left for the next call. Reading goes on by seek().
    // False: the file has to be opened anew. It is another one or shorter, its last block was read before it was complete, or
    // more of it was overwritten since than there is.
    bool grow();

private:
    struct Found {
        BlockHead head;
        std::uint64_t at = 0;
        std::uint64_t body() const { return at + sizeof head; }
        std::uint64_t end() const { return body() + head.stored; }
    };
    bool get(std::uint64_t at, void* to, std::size_t n) const;
    bool takeHead(std::uint64_t at, Found& out);
    bool find(std::uint64_t from, std::uint64_t to, Found& out);
    bool load(const Found& found, BlockReader& out, std::string& why) const;
    bool readHead();
    void readIndex();
    bool readSections(std::uint64_t at, std::uint64_t end);
    bool takeSection(const Record& record, const BlockReader& block, std::uint64_t end, Message& m);
    void rebuild();
    void append(const Found& found, std::size_t from = 0);
    bool isSame();
    bool findNext(std::uint64_t end, Found& out);
    bool isWhole(const Found& found) const;
    void forget(const Found& found);
    void leave();
    void damage(std::uint64_t at, std::uint64_t end, std::string what);

    void open();
    const std::string file_;
    Descriptor in_;
    std::uint64_t size_ = 0;
    FileHead head_;
    bool closed_ = false;
    bool knowsId_ = false;
    std::vector<Section> sections_;
    std::vector<std::string> names_;
    std::map<std::string, std::uint32_t, std::less<>> known_;       // places in names_
    std::vector<std::uint32_t> places_;     // those of the names of the block of the index in hand
    std::vector<Damage> damages_;

    // A file that grows.
    Found newest_;                      // the block with the highest number, as rebuild() has found it
    std::uint64_t looked_ = 0;          // size of the file before
    std::int64_t changed_ = 0;          // when it was written [ns]
    std::uint64_t gone_ = 0;            // bytes of sections that were overwritten
    int misses_ = 0;                    // it was written, and no block was found

    // Reading records.
    std::size_t section_ = 0;
    std::uint64_t at_ = 0;              // where the next block of the section begins
    bool inBlock_ = false;
    Found found_;                       // the block in hand
    BlockReader block_;
    std::string why_;                   // what is wrong with it; empty: nothing is known
};

}  // namespace sorma::recording
