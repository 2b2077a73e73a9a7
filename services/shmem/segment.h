// segment.h -- the shared memory of a snapshot buffer: making it, the right to write, removing it.
//
// A segment is the POSIX shared memory object "/sorma.KEY" (on Linux the file /dev/shm/sorma.KEY). Locks on its open file
// descriptions (OFD locks) say who uses it. The kernel releases them when a process ends, also when it is killed:
//
//     byte 0, exclusive    the process that writes, makes or removes the segment
//     byte 1, shared       every process that uses it; exclusive: the one that removes it
//
// So there is no list of users that could be out of date, and it does not matter when a process number is used again. The
// descriptors are closed by exec. A child that was forked without exec shares its parent's locks until it closes them or ends.
//
// Owner: a process writes only a segment of its own user; if another user's file has the name, it fails (O_EXCL, then a
//        check of the owner). The owner of the file can truncate it at any time. Then the next access to a page that is
//        missing is SIGBUS, in the thread that reads. There is no cheap protection. Shared memory of this kind cannot be
//        sealed (only memfd can, and it has no name). A handler of SIGBUS belongs to the whole program. A pread() for each
//        record costs several times the copy. So a reader accepts only segments of certain owners: its own user and root,
//        which can end it anyway, and one user that it names.
//
// Writing: only the writer maps the records writable. Readers map them read-only; they map the first page writable as well,
// for the two words by which they say that they sleep.
//
// Removing: the last user removes the segment when it closes it or exits, unless `keep` is set. Segment::clean removes those
// of processes that were killed. The next writer takes over a segment without a writer if the shape is the same, and
// counters continue. Otherwise the segment is retired, which its readers see, and a new one is made.
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
    foreign,        // the name belongs to another kind of file, or to another user's
    truncated,      // it is shorter than its header says
    older, newer,   // another layout than ours
    denied,         // no permission
    full,           // no room
    busy,           // another process writes
    system,         // another error, with the system's message
};

struct Failure : std::runtime_error {
    Failure(Reason r, const std::string& text) : std::runtime_error(text), reason(r) {}
    Reason reason;
};

// Readers: the writer's user, also the group, or everybody. Only the writer's user may write.
enum class Access { owner, group, all };

struct Writing {        // the writer, or the last one
    std::int64_t process = 0, started = 0, since = 0;
    std::string program;
    bool alive() const;         // does its process run? Makes a system call
};

class Segment {
public:
    // Make the segment, or take it over, and become its writer. Throws Failure: key, busy (the message names the writer),
    // foreign, newer, denied, full, system. After full nothing stays of the attempt. All pages exist before it returns, so
    // that writing never fails.
    static std::shared_ptr<Segment> forWriting(const std::string& key, const Shape& shape, Access access, bool keep,
                                               const std::string& program);
    // Open a segment that exists. trusted: another user that may own it, by name or number; empty: only this user and root.
    // Throws Failure: key, absent, foreign, truncated, older, newer, denied (also for an owner that is not trusted), system.
    static std::shared_ptr<Segment> forReading(const std::string& key, const std::string& trusted = {});
    ~Segment();                             // closes it; the last user removes it
    Segment(const Segment&) = delete;
    Segment& operator=(const Segment&) = delete;

    Header& header() const { return *header_; }
    Block& block(std::uint64_t record) const {
        return *reinterpret_cast<Block*>(first_ + (record - 1) % shape_.blocks * blockBytes_);
    }
    const Shape& shape() const { return shape_; }       // a copy that was checked; later changes of the header do not matter
    const std::string& key() const { return key_; }
    std::uint64_t blockBytes() const { return blockBytes_; }
    // The header in the writable mapping. Null: this reader may not write there, and so cannot say that it sleeps.
    Header* words() const { return words_; }
    bool unlinked() const;                              // was its name removed? Makes a system call
    void ring() const;                                  // wake all readers that sleep
    Writing writing() const;
    void setKeep(bool keep) { words_->keep.store(keep, std::memory_order_relaxed); }

    // ---- all segments of this machine ----

    struct Entry {
        std::string key, problem;           // problem: why its header cannot be read; then only size is known
        std::uint64_t size = 0, count = 0;
        Shape shape;
        Writing writing;
        std::int64_t created = 0;
        bool written = false, used = false; // a process writes it; a process (perhaps the writer) uses it
        bool keep = false;
        bool ours = false;                  // a segment of ours, not of another program or a newer SORMA
    };
    static std::vector<Entry> list();
    // Remove the segments that nobody uses, or the one of that key; those with `keep` only by key. Returns the keys that
    // were removed. With a key it throws Failure: key, absent, busy (in use, or another user's), system.
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
