#include "recording/writer.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "recording/compress.h"
#include "recording/crc32c.h"

namespace sorma::recording {

namespace {

std::int64_t nanoseconds(clockid_t clock) {
    timespec t;
    clock_gettime(clock, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

template <class Head> void seal(Head& head) { head.check = crc32c(&head, offsetof(Head, check)); }

[[noreturn]] void refuse(const std::string& what, const std::string& file) {
    const int error = errno;
    throw FileError(what + " " + file + ": " + std::strerror(error));
}

}  // namespace

bool canCompress() { return compress::available(); }

Writer::Writer(std::string file, WriterOptions options) : file_(std::move(file)), options_(options) {
    if (options_.compress && !canCompress()) throw FileError("cannot compress " + file_ + ": SORMA was built without zstd (libzstd-dev)");
    if (options_.most > 0 && options_.most < WriterOptions::kLeastFile)
        throw FileError("a recording of at most " + std::to_string(options_.most) + " bytes is too small: give it " + std::to_string(WriterOptions::kLeastFile));
    // Not emptied before it is known that nobody writes it. A pipe would block.
    out_ = Descriptor(::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0600));
    if (!out_) refuse("cannot write", file_);
    struct stat status{};
    if (::fstat(out_.get(), &status) != 0) refuse("cannot write", file_);
    if (!S_ISREG(status.st_mode)) throw FileError("cannot write " + file_ + ": it is no file");
    if (::flock(out_.get(), LOCK_EX | LOCK_NB) != 0) throw FileError("cannot write " + file_ + ": another recorder is writing it");
    if (::fchmod(out_.get(), 0600) != 0 || ::ftruncate(out_.get(), 0) != 0) refuse("cannot write", file_);
    if (::getrandom(&id_, sizeof id_, 0) != ssize_t(sizeof id_)) refuse("no random number for", file_);
    FileHead head;
    head.id = id_;
    head.began = nanoseconds(CLOCK_REALTIME);
    head.monotonic = nanoseconds(CLOCK_MONOTONIC);
    seal(head);
    put(0, &head, sizeof head);
    next_ = sizeof head;
}

void Writer::put(std::uint64_t at, const void* bytes, std::size_t n) {
    for (auto* p = static_cast<const char*>(bytes); n > 0;) {
        const ssize_t done = ::pwrite(out_.get(), p, n, off_t(at));
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) refuse("cannot go on writing", file_);
        p += done, at += std::uint64_t(done), n -= std::size_t(done);
        end_ = std::max(end_, at);
    }
}

// Is no section there whose records are still wanted?
bool Writer::isFree(std::uint64_t at, std::uint64_t bytes) const {
    return std::none_of(sections_.begin(), sections_.end(), [&](const Section& s) { return s.at < at + bytes && at < s.at + s.bytes; });
}

// Where a block of so many bytes shall stand. What is overwritten there is forgotten.
std::uint64_t Writer::place(std::uint64_t bytes) {
    while (options_.keep > 0 && sections_.size() > 1 && sections_.front().last < sections_.back().last - options_.keep) sections_.pop_front();
    std::uint64_t at = next_;
    const bool limited = options_.most > 0;
    if (limited ? at + bytes > options_.most : options_.keep > 0 && at == end_ && isFree(sizeof(FileHead), std::max<std::uint64_t>(bytes, 2 * kBlockBytes)))
        at = sizeof(FileHead);
    if (!limited && !isFree(at, bytes)) at = end_;
    while (!isFree(at, bytes)) sections_.pop_front();
    return at;
}

// Returns where it stands.
std::uint64_t Writer::putBlock(Block& block, std::uint32_t flags) {
    const std::string& plain = block.finish(id_, number_);
    const bool packs = options_.compress && compress::pack(plain, packed_) && packed_.size() < plain.size();
    const std::string& stored = packs ? packed_ : plain;
    BlockHead head;
    head.id = id_;
    head.number = number_;
    head.stored = std::uint32_t(stored.size());
    head.plain = std::uint32_t(plain.size());
    head.records = block.records();
    head.flags = packs ? flags | BlockHead::zstd : flags;
    head.first = block.first();
    head.last = block.last();
    head.states = block.states();
    seal(head);
    const std::uint64_t at = flags & BlockHead::index ? end_ : place(sizeof head + stored.size());
    put(at, &head, sizeof head);
    put(at + sizeof head, stored.data(), stored.size());
    next_ = at + sizeof head + stored.size();
    ++number_;
    return at;
}

// A block has been written: it belongs to a section.
void Writer::note(const Block& block, std::uint64_t at) {
    const bool follows = !sections_.empty() && sections_.back().bytes < kBlockBytes && sections_.back().at + sections_.back().bytes == at;
    if (!follows) {
        sections_.emplace_back();
        sections_.back().at = at;
        sections_.back().number = number_ - 1;
        sections_.back().first = block.first();
        sections_.back().last = block.last();
    }
    Section& s = sections_.back();
    s.bytes = next_ - s.at;
    ++s.blocks;
    s.records += block.records();
    s.states += block.states();
    s.first = std::min(s.first, block.first());
    s.last = std::max(s.last, block.last());
    for (auto& name : block.names()) {
        auto found = known_.find(name);
        if (found == known_.end()) {
            if (!(s.named = s.named && names_.size() < kMostNames)) continue;
            found = known_.emplace(std::string(name), std::uint32_t(names_.size())).first;
            names_.push_back(&found->first);
        }
        s.names.push_back(found->second);
    }
    std::sort(s.names.begin(), s.names.end());
    s.names.erase(std::unique(s.names.begin(), s.names.end()), s.names.end());
}

void Writer::write(Block& block) {
    if (block.empty()) return;
    const std::uint64_t at = putBlock(block, 0);
    records_ += block.records() - block.states();
    note(block, at);
    block.clear();
}

// A record for each section. The numbers of its names are those of the block that the record is in.
void Writer::putIndex() {
    Block block;
    Message m;
    for (auto& s : sections_) {
        m.ints = {std::int64_t(s.at), std::int64_t(s.bytes), std::int64_t(s.blocks), std::int64_t(s.records), s.named};
        for (auto name : s.names) m.ints.push_back(block.name(*names_[name]));
        block.add({.kind = Kind::section, .code = int(std::min<std::uint64_t>(s.states, INT32_MAX)), .time = s.first, .number = s.number, .span = s.last - s.first}, &m);
        if (!block.full()) continue;
        putBlock(block, BlockHead::index);
        block.clear();
    }
    if (!block.empty()) putBlock(block, BlockHead::index);
}

Index Writer::index() const {
    Index out{{sections_.begin(), sections_.end()}, {}};
    for (auto* name : names_) out.names.push_back(*name);
    return out;
}

void Writer::close() {
    if (!out_) return;
    FileEnd end;
    end.id = id_;
    end.index = end_;
    putIndex();
    seal(end);
    put(end_, &end, sizeof end);
    if (!out_.close()) refuse("cannot go on writing", file_);
}

}  // namespace sorma::recording
