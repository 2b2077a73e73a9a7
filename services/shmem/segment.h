// segment.h -- the shared memory of a snapshot buffer as a file: who makes it, who may write, who takes it away.
//
// A segment is the POSIX shared memory object "/sorma.KEY" (on Linux the file /dev/shm/sorma.KEY). Rights are locks of
// its open file descriptions (OFD locks), which the kernel frees when a process dies, however it dies:
//
//     byte 0, exclusive    whoever writes, or makes, or removes the segment
//     byte 1, shared       everybody who uses it; exclusive: whoever removes it
//
// So there is no list of users to go stale, and a process number that is used again deceives nobody. Descriptors are
// closed by exec; a child that was forked without exec shares its parent's rights until it closes them or ends.
//
// Who owns it: only a segment of its own user is written, whoever has the name already (O_EXCL, then a look at the owner).
// Whoever owns the file can truncate it at any time, and then the next access to a page that is gone is SIGBUS, in whatever
// thread reads. There is no cheap guard: shared memory of this kind cannot be sealed (memfd alone can, and has no name),
// a handler of SIGBUS belongs to the whole program, and pread() for each record costs several times the copy. So a reader
// trusts owners instead: his own user and root, who can end him anyway, and the one he names.
//
// Who writes: the writer alone has the records mapped writable. Readers map them read-only, and once more the first page,
// for the two words by which they say that they sleep.
//
// Who removes: the last user when he leaves or exits, unless `keep` is set; Segment::clean what the killed have left.
// A segment without a writer is taken over by the next one when the shape is the same, counters go on; otherwise it is
// retired, which its readers see, and a new one is made in its place.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "layout.h"

namespace shmem {

enum class Reason {
    key,            // no name for a segment
    absent,         // there is none of that name, or it is not complete yet
    foreign,        // something else has that name, or another user's
    truncated,      // it is shorter than its header says
    older, newer,   // another layout than ours
    denied,         // no permission
    full,           // no room
    busy,           // another process writes
    system,         // anything else, with the system's own words
};

struct Failure : std::runtime_error {
    Failure(Reason r, const std::string& text) : std::runtime_error(text), reason(r) {}
    Reason reason;
};

// Who may read: the user that writes, also his group, or everybody. Nobody else ever writes.
enum class Access { owner, group, all };

struct Writing {        // who writes, or has been the last to write
    std::int64_t process = 0, started = 0, since = 0;
    std::string program;
    bool alive() const;         // its process runs. A system call
};

class Segment {
public:
    // Make the segment, or take it over, and become its writer. Fails with key, busy (naming the writer), foreign, newer,
    // denied, full, system: foreign also for another user's. After full there is nothing left of the attempt, and later writes never hit a missing page.
    static std::shared_ptr<Segment> forWriting(const std::string& key, const Shape& shape, Access access, bool keep,
                                               const std::string& program);
    // Look at one that is there. trusted: another user who may own it, by name or number; empty: none but this one and root.
    // Fails with key, absent, foreign, truncated, older, newer, denied (also an owner that is not trusted), system.
    static std::shared_ptr<Segment> forReading(const std::string& key, const std::string& trusted = {});
    ~Segment();                             // leaves; the last one removes it
    Segment(const Segment&) = delete;
    Segment& operator=(const Segment&) = delete;

    Header& header() const { return *header_; }
    Block& block(std::uint64_t record) const {
        return *reinterpret_cast<Block*>(first_ + (record - 1) % shape_.blocks * blockBytes_);
    }
    const Shape& shape() const { return shape_; }       // checked once; what others do to the header since does not count
    const std::string& key() const { return key_; }
    std::uint64_t blockBytes() const { return blockBytes_; }
    // The header where it can be written. Null: this reader cannot say that it sleeps.
    Header* words() const { return words_; }
    bool unlinked() const;                              // its name has been removed. A system call
    void ring() const;                                  // wake all who sleep
    Writing writing() const;
    void setKeep(bool keep) { words_->keep.store(keep, std::memory_order_relaxed); }

    // ---- all segments of this machine ----

    struct Entry {
        std::string key, problem;           // problem: why its header cannot be read; then only size is known
        std::uint64_t size = 0, count = 0;
        Shape shape;
        Writing writing;
        std::int64_t created = 0;
        bool written = false, used = false; // somebody writes; somebody, the writer included, uses it
        bool keep = false;
        bool ours = false;                  // no stranger's file, nor one of a newer SORMA
    };
    static std::vector<Entry> list();
    // Remove those that nobody uses, or the one of that key; kept ones only by key. Returns the keys removed.
    // With a key it fails with key, absent, busy (in use, or another user's), system.
    static std::vector<std::string> clean(const std::string& key = {});

private:
    Segment(std::string key, int fd, bool writable);
    void map(std::uint64_t size, bool writes);
    void take(const Shape& shape);
    void sign(const std::string& program);
    void leave() noexcept;
    friend struct Leaving;

    std::string key_;
    int fd_;
    bool writable_;
    int owner_;                             // the process that opened it: a forked child must not remove it
    Header* header_ = nullptr;
    Header* words_ = nullptr;               // the same page mapped writable; of a writer the same address
    char* first_ = nullptr;                 // block
    std::uint64_t blockBytes_ = 0, size_ = 0;
    Shape shape_;
};

}  // namespace shmem
