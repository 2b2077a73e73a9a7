#include "segment.h"

#include <dirent.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <climits>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "bus/descriptor.h"
#include "bus/users.h"

namespace shmem {

namespace {

using sorma::Descriptor;

const char* const kFolder = "/dev/shm/";        // where Linux keeps them; used to list them only
const char* const kPrefix = "sorma.";
constexpr off_t kWriterByte = 0, kUserByte = 1;
constexpr int kAttempts = 200;                  // against others who make and remove at the same moment

std::string errorText(int error) { return std::generic_category().message(error); }

[[noreturn]] void failSystem(const std::string& what, const std::string& key, int error) {
    if (error == EACCES || error == EPERM)
        throw Failure(Reason::denied, "no permission to " + what + " segment " + key + "; its writer's user decides (-access)");
    if (error == ENOSPC || error == EFBIG || error == ENOMEM)
        throw Failure(Reason::full, "no room to " + what + " segment " + key + ": " + errorText(error) +
                                        "; see df /dev/shm, remove what nobody uses (-clean), or ask for less");
    throw Failure(Reason::system, "cannot " + what + " segment " + key + ": " + errorText(error));
}

std::string fileOf(const std::string& key) {
    bool good = !key.empty() && key.size() <= 200 && key[0] != '.';
    for (char c : key)
        good = good && ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                        std::string_view("_-+.,:=%").find(c) != std::string_view::npos);
    if (!good)
        throw Failure(Reason::key, "\"" + key +
                                       "\" must be 1 to 200 letters, digits and _ - + . , : = % and not begin with a dot");
    return std::string("/") + kPrefix + key;
}

// Only regular files; a FIFO of that name must not make us wait.
int openShared(const std::string& file, int flags, mode_t mode = 0) {
    return shm_open(file.c_str(), flags | O_NONBLOCK, mode);
}

// Take the lock on one byte, or with F_UNLCK release it. False when another process has a lock that excludes it.
bool lock(int fd, short type, off_t byte, const std::string& key) {
    struct flock l{};
    l.l_type = type;
    l.l_whence = SEEK_SET;
    l.l_start = byte;
    l.l_len = 1;
    int done;
    do done = fcntl(fd, F_OFD_SETLK, &l);
    while (done != 0 && errno == EINTR);
    if (done == 0) return true;
    if (errno == EAGAIN || errno == EACCES) return false;
    failSystem("lock", key, errno);
}

// Does anybody else have a lock on the byte?
bool isLocked(int fd, off_t byte) {
    struct flock l{};
    l.l_type = F_WRLCK;
    l.l_whence = SEEK_SET;
    l.l_start = byte;
    l.l_len = 1;
    return fcntl(fd, F_OFD_GETLK, &l) == 0 && l.l_type != F_UNLCK;
}

struct stat factsOf(int fd, const std::string& key) {
    struct stat s{};
    if (fstat(fd, &s) != 0) failSystem("look at", key, errno);
    return s;
}

uid_t userOf(const std::string& text, const std::string& key) {
    uid_t number = 0;
    if (sorma::userNumber(text, number)) return number;
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size())
        throw Failure(Reason::denied, "segment " + key + " cannot be read: this machine knows no user \"" + text + "\" (-owner)");
    return number;
}

// Another user can read, fill and truncate a file that he has made under this name.
void needOwner(int fd, const std::string& key, uid_t user) {
    uid_t owner = factsOf(fd, key).st_uid;
    if (owner != user)
        throw Failure(Reason::foreign, "segment " + key + " belongs to " + sorma::userName(owner) + "; he can remove it, or choose another -key");
}

void setMode(int fd, mode_t mode, const std::string& key) {
    if (fchmod(fd, mode) != 0) failSystem("set who may read", key, errno);
}

// Take all locks, to remove it; false when another process has one, or the name was removed already. Always in this order:
// a process that does not get the first lock does not keep another one from its second.
bool isAlone(int fd, const std::string& key) {
    return lock(fd, F_WRLCK, kUserByte, key) && lock(fd, F_WRLCK, kWriterByte, key) && factsOf(fd, key).st_nlink > 0;
}

void pause() {
    timespec t{0, 1'000'000};
    nanosleep(&t, nullptr);
}

std::int64_t wallMicroseconds() {
    timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return std::int64_t(t.tv_sec) * 1'000'000 + t.tv_nsec / 1000;
}

// When this process began, in ticks since the machine did.
std::int64_t ownStart() {
    FILE* f = std::fopen("/proc/self/stat", "re");
    if (!f) return 0;
    char line[1024];
    std::size_t n = std::fread(line, 1, sizeof line - 1, f);
    std::fclose(f);
    line[n] = 0;
    const char* at = std::strrchr(line, ')');       // a program's name may hold anything
    for (int field = 2; at && field < 22; ++field) at = std::strchr(at + 1, ' ');
    return at ? std::atoll(at) : 0;
}

// ---- the header of a file, read without mapping it: whatever is in the file cannot hurt ----

class Bytes {
public:
    // False when there is not even room for a header.
    bool read(int fd) { return pread(fd, bytes_, sizeof bytes_, 0) == ssize_t(sizeof bytes_); }
    template <class T> T at(std::size_t offset) const {
        T value;
        std::memcpy(&value, bytes_ + offset, sizeof value);
        return value;
    }

private:
    unsigned char bytes_[sizeof(Header)] = {};
};

struct Found {
    std::optional<Reason> reason;       // why it is no good
    std::string text;
    Shape shape;
    std::uint64_t size = 0, count = 0;
    std::int64_t created = 0;
    Writing writing;
    bool retired = false, keep = false;
};

Found examine(int fd, const std::string& key) {
    Found f;
    auto bad = [&](Reason reason, const std::string& text) {
        f.reason = reason;
        f.text = "segment " + key + " " + text;
        return f;
    };
    struct stat s = factsOf(fd, key);
    f.size = std::uint64_t(s.st_size);
    if (!S_ISREG(s.st_mode)) return bad(Reason::foreign, "is no shared memory");
    if (s.st_size == 0) return bad(Reason::absent, "is empty: it is just being made, or who made it has died");
    Bytes b;
    if (!b.read(fd))
        return bad(Reason::foreign, "is not of SORMA: it has " + std::to_string(s.st_size) + " bytes, fewer than a header");
    auto word = b.at<std::uint64_t>(offsetof(Header, magic));
    if (word == 0) return bad(Reason::absent, "is not complete: it is just being made, or who made it has died");
    if (word != magic()) return bad(Reason::foreign, "is not of SORMA: it does not begin with SORMAshm");
    auto order = b.at<std::uint32_t>(offsetof(Header, order)), layout = b.at<std::uint32_t>(offsetof(Header, layout));
    if (order != kOrder) return bad(Reason::foreign, "was written by a machine of another byte order");
    auto layouts = "has layout " + std::to_string(layout) + ", this program knows " + std::to_string(kLayout);
    if (layout < kLayout) return bad(Reason::older, layouts + "; restart its writer with a newer SORMA");
    if (layout > kLayout) return bad(Reason::newer, layouts + "; use a newer SORMA here");
    f.shape = {b.at<std::uint64_t>(offsetof(Header, blocks)), b.at<std::uint64_t>(offsetof(Header, floats)),
               b.at<std::uint64_t>(offsetof(Header, any))};
    auto size = b.at<std::uint64_t>(offsetof(Header, size));
    bool possible = f.shape.blocks >= 2 && f.shape.blocks <= kMostBlocks && f.shape.floats <= kMostFloats &&
                    f.shape.any <= kMostAny;
    if (!possible || size != segmentBytes(f.shape) || b.at<std::uint64_t>(offsetof(Header, headerBytes)) != sizeof(Header) ||
        b.at<std::uint64_t>(offsetof(Header, blockBytes)) != blockBytes(f.shape))
        return bad(Reason::foreign, "contradicts itself: its sizes do not fit together");
    if (f.size < size)
        return bad(Reason::truncated, "is truncated: " + std::to_string(f.size) + " bytes instead of " + std::to_string(size));
    f.count = b.at<std::uint64_t>(offsetof(Header, count));
    f.created = b.at<std::int64_t>(offsetof(Header, created));
    f.retired = b.at<std::uint32_t>(offsetof(Header, retired)) != 0;
    f.keep = b.at<std::uint32_t>(offsetof(Header, keep)) != 0;
    f.writing.process = b.at<std::int64_t>(offsetof(Header, process));
    f.writing.started = b.at<std::int64_t>(offsetof(Header, started));
    f.writing.since = b.at<std::int64_t>(offsetof(Header, since));
    char program[33] = {};
    auto name = b.at<std::array<char, 32>>(offsetof(Header, program));
    std::copy(name.begin(), name.end(), program);
    f.writing.program = program;
    return f;
}

std::string whoWrites(const Writing& w) {
    if (w.process == 0) return "another process";
    std::string text = (w.program.empty() ? "process " : w.program + " ") + "[" + std::to_string(w.process) + "]";
    std::time_t seconds = w.since / 1'000'000;
    std::tm t{};
    char when[40];
    if (localtime_r(&seconds, &t) && std::strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S", &t))
        text += std::string(" since ") + when;
    return text;
}

// Tell those who still have it that it is over. Only a segment of our own layout can be told.
void retire(int fd) {
    void* p = mmap(nullptr, sizeof(Header), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (p == MAP_FAILED) return;
    auto* h = static_cast<Header*>(p);
    h->retired.store(1, std::memory_order_seq_cst);
    // A reader that goes to sleep now has seen `retired`, or is seen here.
    h->bell.fetch_add(1, std::memory_order_seq_cst);
    syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&h->bell), FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
    munmap(p, sizeof(Header));
}

}  // namespace

// Segments that are open when the process exits are left then: the objects that have them may never be destroyed.
struct Leaving {
    std::mutex mutex;
    std::set<Segment*> open;

    static Leaving& instance() {
        static Leaving& one = *new Leaving;         // never destroyed: segments may go after all static objects
        static struct AtExit {
            ~AtExit() {
                std::lock_guard lock(one.mutex);
                for (auto* segment : std::exchange(one.open, {})) segment->leave();
            }
        } atExit;
        return one;
    }
    static void add(Segment* s) {
        auto& l = instance();
        std::lock_guard lock(l.mutex);
        l.open.insert(s);
    }
    static void remove(Segment* s) {
        auto& l = instance();
        std::lock_guard lock(l.mutex);
        l.open.erase(s);
    }
};

// ---- making and finding ----

namespace {

// After an error nothing stays of the file.
void makePages(int fd, const std::string& key, const std::string& file, std::uint64_t bytes) {
    if (ftruncate(fd, 0) != 0) failSystem("make", key, errno);
    int error;
    do error = posix_fallocate(fd, 0, off_t(bytes));
    while (error == EINTR);
    if (error == 0) return;
    shm_unlink(file.c_str());
    failSystem("make", key, error);
}

// All but the magic number, which says that the rest is there.
void describe(Header& h, const Shape& shape) {
    h.order = kOrder;
    h.layout = kLayout;
    h.size = segmentBytes(shape);
    h.headerBytes = sizeof(Header);
    h.blockBytes = shmem::blockBytes(shape);
    h.blocks = shape.blocks;
    h.floats = shape.floats;
    h.any = shape.any;
    h.created = wallMicroseconds();
}

}  // namespace

std::shared_ptr<Segment> Segment::forWriting(const std::string& key, const Shape& shape, Access access, bool keep,
                                             const std::string& program) {
    const std::string file = fileOf(key);
    const mode_t mode = access == Access::owner ? 0600 : access == Access::group ? 0640 : 0644;
    int refused = 0;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        Descriptor fd(openShared(file, O_RDWR | O_CREAT | O_EXCL, mode));
        if (!fd && errno == EEXIST) {
            fd = Descriptor(openShared(file, O_RDWR));
            if (!fd && errno == ENOENT) continue;      // removed meanwhile
        }
        if (!fd) failSystem("make", key, errno);
        needOwner(fd.get(), key, geteuid());
        if (!lock(fd.get(), F_WRLCK, kWriterByte, key)) {
            // A process that removes a segment has this lock for a short time; a writer keeps it.
            Found f = examine(fd.get(), key);
            if (++refused < 10) {
                pause();
                continue;
            }
            throw Failure(Reason::busy, "segment " + key + " has a writer already: " + whoWrites(f.writing));
        }
        struct stat s = factsOf(fd.get(), key);
        if (s.st_nlink == 0) continue;              // removed since we opened it
        if (!lock(fd.get(), F_RDLCK, kUserByte, key)) {
            pause();
            continue;
        }
        Found f = examine(fd.get(), key);
        if (f.reason == Reason::absent) {           // it is not complete, so no reader has it: we may use it
            makePages(fd.get(), key, file, segmentBytes(shape));
            setMode(fd.get(), mode, key);           // whatever the umask
            std::shared_ptr<Segment> made(new Segment(key, fd.release(), true));
            made->map(segmentBytes(shape), true);
            Header& h = made->header();
            describe(h, shape);
            made->take(shape);
            made->setKeep(keep);
            made->sign(program);
            h.magic.store(magic(), std::memory_order_release);      // readers who see it see all of the above
            return made;
        }
        if (!f.reason && !f.retired && f.shape == shape) {
            setMode(fd.get(), mode, key);
            std::shared_ptr<Segment> taken(new Segment(key, fd.release(), true));
            taken->map(f.size, true);
            taken->take(shape);
            taken->setKeep(keep);
            taken->sign(program);
            return taken;
        }
        if (f.reason == Reason::foreign || f.reason == Reason::newer)
            throw Failure(*f.reason, f.text + "; remove it with -clean " + key);
        // It has no writer, and cannot be taken over: retire it.
        if (!f.reason) retire(fd.get());
        if (shm_unlink(file.c_str()) != 0 && errno != ENOENT) failSystem("replace", key, errno);
    }
    throw Failure(Reason::busy, "segment " + key + " is made and removed by others all the time");
}

std::shared_ptr<Segment> Segment::forReading(const std::string& key, const std::string& trusted) {
    const std::string file = fileOf(key);
    const uid_t also = trusted.empty() ? geteuid() : userOf(trusted, key);
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        bool writable = true;
        Descriptor fd(openShared(file, O_RDWR));
        if (!fd && (errno == EACCES || errno == EROFS)) {
            writable = false;
            fd = Descriptor(openShared(file, O_RDONLY));
        }
        if (!fd && errno == ENOENT)
            throw Failure(Reason::absent, "there is no segment " + key + ": nobody writes it yet");
        if (!fd) failSystem("read", key, errno);
        // Refused only while another process removes it.
        if (!lock(fd.get(), F_RDLCK, kUserByte, key)) {
            pause();
            continue;
        }
        struct stat s = factsOf(fd.get(), key);
        if (s.st_nlink == 0) continue;
        if (s.st_uid != geteuid() && s.st_uid != 0 && s.st_uid != also)
            throw Failure(Reason::denied, "segment " + key + " belongs to " + sorma::userName(s.st_uid) +
                                              ", who could end the processes that read it by truncating it; if you trust that user, say -owner " +
                                              sorma::userName(s.st_uid));
        Found f = examine(fd.get(), key);
        if (f.reason) throw Failure(*f.reason, f.text);
        if (f.retired) {
            pause();                                // its name is about to go
            continue;
        }
        std::shared_ptr<Segment> found(new Segment(key, fd.release(), writable));
        found->map(f.size, false);
        found->take(f.shape);
        return found;
    }
    throw Failure(Reason::absent, "segment " + key + " is made and removed by others all the time");
}

Segment::Segment(std::string key, int fd, bool writable)
    : key_(std::move(key)), fd_(fd), writable_(writable), owner_(getpid()) {}

void Segment::map(std::uint64_t size, bool writes) {
    // Populated, so that the first round through the blocks is as quick as all others.
    void* p = mmap(nullptr, size, PROT_READ | (writes ? PROT_WRITE : 0), MAP_SHARED | MAP_POPULATE, fd_, 0);
    if (p == MAP_FAILED) failSystem("map", key_, errno);
    size_ = size;
    header_ = static_cast<Header*>(p);
    Leaving::add(this);
    if (writes) {
        words_ = header_;
    } else if (writable_) {             // a page, whatever its size: mappings begin and end with pages
        void* page = mmap(nullptr, sizeof(Header), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, 0);
        if (page == MAP_FAILED) failSystem("map", key_, errno);
        words_ = static_cast<Header*>(page);
    }
}

void Segment::take(const Shape& shape) {
    shape_ = shape;
    blockBytes_ = shmem::blockBytes(shape);
    first_ = reinterpret_cast<char*>(header_) + sizeof(Header);
}

void Segment::sign(const std::string& program) {
    char name[32] = {};
    program.copy(name, sizeof name - 1);
    for (int i = 0; i < 4; ++i) {
        std::uint64_t word;
        std::memcpy(&word, name + 8 * i, 8);
        header_->program[i].store(word, std::memory_order_relaxed);
    }
    // For people only; nothing is decided by it.
    header_->started.store(ownStart(), std::memory_order_relaxed);
    header_->since.store(wallMicroseconds(), std::memory_order_relaxed);
    header_->process.store(getpid(), std::memory_order_relaxed);
}

Segment::~Segment() {
    Leaving::remove(this);
    leave();
    if (words_ && words_ != header_) munmap(words_, sizeof(Header));
    if (header_) munmap(header_, size_);
}

void Segment::leave() noexcept {
    if (fd_ < 0) return;
    const Descriptor own(std::exchange(fd_, -1));
    const int fd = own.get();
    if (owner_ != getpid()) return;         // a fork of ours: the rights are its parent's
    try {
        // Release the locks explicitly, since the mapping keeps the open file description, too.
        // If two leave at the same time, one finds itself alone, because both first give up their locks.
        lock(fd, F_UNLCK, kWriterByte, key_);
        lock(fd, F_UNLCK, kUserByte, key_);
        bool wanted = header_ && header_->keep.load(std::memory_order_relaxed);
        if (writable_ && !wanted && isAlone(fd, key_)) shm_unlink(fileOf(key_).c_str());
        lock(fd, F_UNLCK, kWriterByte, key_);
        lock(fd, F_UNLCK, kUserByte, key_);
    } catch (const Failure&) {              // it stays, and can be removed by clean
    }
}

bool Segment::unlinked() const {
    struct stat s{};
    return fd_ >= 0 && fstat(fd_, &s) == 0 && s.st_nlink == 0;
}

void Segment::ring() const {
    words_->bell.fetch_add(1, std::memory_order_seq_cst);
    syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&words_->bell), FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

bool Writing::alive() const { return process > 0 && (::kill(pid_t(process), 0) == 0 || errno == EPERM); }

Writing Segment::writing() const {
    Writing w;
    w.process = header_->process.load(std::memory_order_relaxed);
    w.started = header_->started.load(std::memory_order_relaxed);
    w.since = header_->since.load(std::memory_order_relaxed);
    char name[33] = {};
    for (int i = 0; i < 4; ++i) {
        std::uint64_t word = header_->program[i].load(std::memory_order_relaxed);
        std::memcpy(name + 8 * i, &word, 8);
    }
    w.program = name;
    return w;
}

// ---- all of them ----

std::vector<Segment::Entry> Segment::list() {
    std::vector<Entry> all;
    DIR* dir = opendir(kFolder);
    if (!dir) return all;
    const std::string prefix = kPrefix;
    while (dirent* d = readdir(dir)) {
        std::string name = d->d_name;
        if (!name.starts_with(prefix)) continue;
        Entry e;
        e.key = name.substr(prefix.size());
        Descriptor fd(openShared("/" + name, O_RDONLY));
        if (!fd) {
            if (errno == ENOENT) continue;
            e.problem = errorText(errno);
        } else {
            try {
                Found f = examine(fd.get(), e.key);
                e.problem = f.reason ? f.text : std::string();
                e.ours = !f.reason || *f.reason == Reason::absent || *f.reason == Reason::truncated || *f.reason == Reason::older;
                e.size = f.size;
                e.count = f.count;
                e.shape = f.shape;
                e.writing = f.writing;
                e.created = f.created;
                e.keep = f.keep;
                e.written = isLocked(fd.get(), kWriterByte);
                e.used = e.written || isLocked(fd.get(), kUserByte);
            } catch (const Failure& failure) {
                e.problem = failure.what();
            }
        }
        all.push_back(std::move(e));
    }
    closedir(dir);
    std::sort(all.begin(), all.end(), [](auto& a, auto& b) { return a.key < b.key; });
    return all;
}

std::vector<std::string> Segment::clean(const std::string& key) {
    std::vector<std::string> removed;
    std::vector<std::string> keys;
    if (key.empty()) {
        for (auto& e : list())
            if (e.ours && !e.used && !e.keep) keys.push_back(e.key);
    } else {
        keys.push_back(key);
    }
    for (auto& k : keys) {
        const std::string file = fileOf(k);
        Descriptor fd(openShared(file, O_RDWR));
        if (!fd) {
            if (key.empty()) continue;
            if (errno == ENOENT) throw Failure(Reason::absent, "there is no segment " + k);
            failSystem("remove", k, errno);
        }
        bool alone = isAlone(fd.get(), k);
        if (alone && shm_unlink(file.c_str()) == 0) {
            removed.push_back(k);
        } else if (!key.empty()) {
            if (!alone) throw Failure(Reason::busy, "segment " + k + " is in use");
            failSystem("remove", k, errno);
        }
    }
    return removed;
}

}  // namespace shmem
