#include "recording/reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "recording/compress.h"
#include "recording/crc32c.h"

namespace sorma::recording {

namespace {

constexpr std::size_t kWindow = 1024 * 1024;        // read at a time while a block is searched
constexpr std::size_t kMostDamages = 1000;          // that are listed
constexpr std::uint64_t kMostGrowth = 64 * 1024 * 1024;     // bytes in a call
constexpr int kMostMisses = 3;

std::int64_t changeOf(const struct stat& s) { return std::int64_t(s.st_mtim.tv_sec) * 1'000'000'000 + s.st_mtim.tv_nsec; }

template <class Head> bool agrees(const Head& head) { return head.check == crc32c(&head, offsetof(Head, check)); }
template <class Head> bool begins(const Head& head) { return std::memcmp(head.magic, Head().magic, sizeof head.magic) == 0; }

}  // namespace

Reader::Reader(std::string file, Index index) : file_(std::move(file)), sections_(std::move(index.sections)), names_(std::move(index.names)) {
    open();
    readHead();
    seek(0);
}

void Reader::open() {
    in_ = Descriptor(::open(file_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
    struct stat status{};
    if (!in_ || ::fstat(in_.get(), &status) != 0) throw FileError("cannot read " + file_ + ": " + std::strerror(errno));
    if (!S_ISREG(status.st_mode)) throw FileError("cannot read " + file_ + ": it is no file");
    size_ = std::uint64_t(status.st_size);
    changed_ = changeOf(status);
}

Reader::Reader(std::string file) : file_(std::move(file)) {
    open();
    const bool hasHead = readHead();
    readIndex();
    if (!closed_) rebuild();
    if (!hasHead && sections_.empty()) throw FileError(file_ + " is no recording");
    if (!sections_.empty()) at_ = sections_[0].at;
}

// False: at the end of the file, or it cannot be read.
bool Reader::get(std::uint64_t at, void* to, std::size_t n) const {
    if (at > size_ || n > size_ - at) return false;
    for (auto* p = static_cast<char*>(to); n > 0;) {
        const ssize_t done = ::pread(in_.get(), p, n, off_t(at));
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return false;
        p += done, at += std::uint64_t(done), n -= std::size_t(done);
    }
    return true;
}

void Reader::damage(std::uint64_t at, std::uint64_t end, std::string what) {
    for (auto& d : damages_)
        if (d.at == at) return;         // found before
    if (damages_.size() < kMostDamages) damages_.push_back({at, end - at, std::move(what)});
}

// ---- heads ----

// False: it has none. Fails when this is something else.
bool Reader::readHead() {
    constexpr std::size_t kDigit = 16;
    if (!get(0, &head_, sizeof head_)) {
        damage(0, size_, "the file ends inside its head");
        return false;
    }
    FileHead ours;
    const bool family = std::memcmp(head_.magic, ours.magic, kDigit) == 0 && head_.magic[kDigit + 1] == '\n';
    if (family && head_.magic[kDigit] < '3' && head_.id == ours.order)      // which stands there in their heads
        throw FileError(file_ + " is a recording of buffers alone, of version " + head_.magic[kDigit] + ": EXEC list, play and export of class recorder read it");
    if (family && head_.magic[kDigit] > '3' && head_.magic[kDigit] <= '9' && agrees(head_))
        throw FileError(file_ + " is a recording of version " + head_.magic[kDigit] + ", which is newer than this SORMA: it knows 3");
    if (begins(head_) && agrees(head_)) {
        if (head_.order != ours.order) throw FileError(file_ + " was recorded by a machine of the other byte order");
        return knowsId_ = true;
    }
    head_ = ours;
    damage(0, sizeof head_, "the head of the file is broken: when it began is not known");
    return false;
}

// The head of a block of this file.
bool Reader::takeHead(std::uint64_t at, Found& out) {
    BlockHead head;
    if (!get(at, &head, sizeof head) || !begins(head) || !agrees(head)) return false;
    if (head.stored > kMostBlock || head.plain > kMostBlock || (!(head.flags & BlockHead::zstd) && head.stored != head.plain)) return false;
    if (knowsId_ && head.id != head_.id) return false;
    head_.id = head.id;
    knowsId_ = true;
    out = {head, at};
    return true;
}

// The first block that begins from here on, before `to`.
bool Reader::find(std::uint64_t from, std::uint64_t to, Found& out) {
    if (takeHead(from, out)) return true;
    const BlockHead ours;
    const std::string_view magic(ours.magic, sizeof ours.magic);
    std::string window;
    for (std::uint64_t at = from + 1; at + sizeof(BlockHead) <= to;) {
        window.resize(std::size_t(std::min<std::uint64_t>(kWindow, to - at)));
        if (!get(at, window.data(), window.size())) return false;
        for (std::size_t i = window.find(magic); i != window.npos; i = window.find(magic, i + 1))
            if (takeHead(at + i, out)) return true;
        at += window.size() - magic.size() + 1;
    }
    return false;
}

// The block's records, as far as they are there. False: something is wrong, and why.
bool Reader::load(const Found& f, BlockReader& out, std::string& why) const {
    std::string stored(std::size_t(std::min<std::uint64_t>(f.head.stored, size_ - f.body())), '\0');
    why.clear();
    if (stored.size() < f.head.stored) why = "the file ends inside this block";
    if (!get(f.body(), stored.data(), stored.size())) why = "this block cannot be read", stored.clear();
    if (f.head.flags & BlockHead::zstd) {
        std::string plain;
        if (!compress::unpack(stored, f.head.plain, plain) && why.empty())
            why = compress::available() ? "what is compressed in this block is broken" : "this block is compressed, and SORMA was built without zstd";
        stored.swap(plain);
    }
    out = BlockReader(std::move(stored), f.head.id, f.head.number);
    return why.empty();
}

// ---- the index ----

void Reader::readIndex() {
    FileEnd end;
    const std::uint64_t at = size_ - sizeof end;
    if (size_ < sizeof head_ + sizeof end || !get(at, &end, sizeof end) || !begins(end)) return;
    if (!agrees(end) || (knowsId_ && end.id != head_.id)) return damage(at, size_, "the end mark is broken");
    knowsId_ = true;
    head_.id = end.id;
    closed_ = readSections(end.index, at);
    if (closed_) return;
    sections_.clear(), names_.clear(), known_.clear();
    damage(end.index, at, "the index is broken");
}

bool Reader::readSections(std::uint64_t begin, std::uint64_t end) {
    if (begin < sizeof head_ || begin > end) return false;
    Message message;                    // its memory is used again
    for (std::uint64_t at = begin; at < end;) {
        Found f;
        BlockReader block;
        std::string why;
        if (!takeHead(at, f) || !(f.head.flags & BlockHead::index) || f.end() > end || !load(f, block, why)) return false;
        places_.clear();
        for (Record r; block.next(r);)
            if (!takeSection(r, block, begin, message)) return false;
        if (!block.whole()) return false;
        at = f.end();
    }
    // They do not overlap, so all of them are not more than the file.
    std::vector<const Section*> order;
    for (auto& s : sections_) order.push_back(&s);
    std::sort(order.begin(), order.end(), [](auto* a, auto* b) { return a->at < b->at; });
    for (std::size_t i = 1; i < order.size(); ++i)
        if (order[i - 1]->at + order[i - 1]->bytes > order[i]->at) return false;
    return true;
}

bool Reader::takeSection(const Record& record, const BlockReader& block, std::uint64_t end, Message& m) {
    enum { kAt,
           kBytes,
           kBlocks,
           kRecords,
           kNamed,
           kNames };
    if (record.kind != Kind::section || !record.read(m) || m.ints.size() < kNames) return false;
    Section s;
    s.at = std::uint64_t(m.ints[kAt]), s.bytes = std::uint64_t(m.ints[kBytes]);
    if (s.at < sizeof head_ || s.at > end || s.bytes > end - s.at) return false;
    s.number = record.number;
    s.blocks = std::uint64_t(m.ints[kBlocks]), s.records = std::uint64_t(m.ints[kRecords]);
    s.states = std::uint64_t(std::max(0, record.code));
    s.first = record.time, s.last = std::int64_t(std::uint64_t(record.time) + std::uint64_t(record.span));
    s.named = m.ints[kNamed] != 0;
    s.names.reserve(m.ints.size() - kNames);
    for (std::size_t i = kNames; i < m.ints.size(); ++i) {
        if (m.ints[i] < 1 || std::uint64_t(m.ints[i]) > block.names().size()) return false;
        // Each name of a block is looked up once: a large file has thousands of sections.
        while (places_.size() < block.names().size()) {
            const std::string_view text = block.names()[places_.size()];
            auto known = known_.find(text);
            if (known == known_.end()) {
                known = known_.emplace(std::string(text), std::uint32_t(names_.size())).first;
                names_.push_back(known->first);
            }
            places_.push_back(known->second);
        }
        s.names.push_back(places_[std::size_t(m.ints[i]) - 1]);
    }
    std::sort(s.names.begin(), s.names.end());
    sections_.push_back(std::move(s));
    return true;
}

// From the heads of the blocks.
void Reader::rebuild() {
    FileEnd end;
    const bool hasEnd = size_ >= sizeof head_ + sizeof end && get(size_ - sizeof end, &end, sizeof end) && begins(end);
    const std::uint64_t to = hasEnd ? size_ - sizeof end : size_;
    bool first = true, wrapped = false;
    std::uint64_t newest = 0;
    Found f;
    for (std::uint64_t at = sizeof head_; at < to; at = std::min(f.end(), to)) {
        const bool found = find(at, to, f) && f.at < to;
        // Bytes between the newest block of a black box and the oldest one are the rest of an overwritten block.
        const bool seam = found ? !first && f.head.number < newest : wrapped;
        if ((!found || f.at > at) && !seam) damage(at, found ? f.at : to, found ? "no block begins here: it is broken" : "no block begins here: the file was cut, or is broken");
        if (!found) break;
        if (first) wrapped = f.head.number > 0 && f.at == sizeof head_;
        if (first || f.head.number > newest_.head.number) newest_ = f;
        first = false;
        newest = f.head.number;
        if (!(f.head.flags & BlockHead::index)) append(f);
    }
    std::sort(sections_.begin(), sections_.end(), [](auto& a, auto& b) { return a.number < b.number; });
}

// from: earlier sections stay as they are.
void Reader::append(const Found& f, std::size_t from) {
    const bool follows = sections_.size() > from && sections_.back().bytes < kBlockBytes && sections_.back().at + sections_.back().bytes == f.at &&
                         sections_.back().number + sections_.back().blocks == f.head.number;
    if (!follows) {
        Section s;
        s.at = f.at;
        s.number = f.head.number;
        s.first = f.head.first, s.last = f.head.last;
        s.named = false;
        sections_.push_back(std::move(s));
    }
    Section& s = sections_.back();
    s.bytes = std::min(f.end(), size_) - s.at;
    ++s.blocks;
    s.records += f.head.records;
    s.states += std::min(f.head.states, f.head.records);
    s.first = std::min(s.first, f.head.first);
    s.last = std::max(s.last, f.head.last);
}

// ---- a file that grows ----

// Is it the file that was opened, and not shorter? Then its size is that of now.
bool Reader::isSame() {
    struct stat named{}, ours{};
    if (::stat(file_.c_str(), &named) != 0 || ::fstat(in_.get(), &ours) != 0 || named.st_dev != ours.st_dev || named.st_ino != ours.st_ino) return false;
    const std::int64_t changed = changeOf(ours);
    misses_ = changed == changed_ && std::uint64_t(ours.st_size) == size_ ? 0 : misses_ + 1;
    changed_ = changed;
    if (std::uint64_t(ours.st_size) < size_) return false;
    looked_ = size_;
    size_ = std::uint64_t(ours.st_size);
    FileHead head;
    return !knowsId_ || !get(0, &head, sizeof head) || !begins(head) || !agrees(head) || head.id == head_.id;
}

// The block behind the newest one. The writer goes on there, at the beginning of the file, or at its end.
bool Reader::findNext(std::uint64_t end, Found& out) {
    const std::uint64_t number = sections_.empty() ? 0 : sections_.back().number + sections_.back().blocks;
    const std::uint64_t behind = sections_.empty() ? sizeof head_ : sections_.back().at + sections_.back().bytes;
    for (auto at : {behind, std::uint64_t(sizeof head_), end, looked_})
        if (takeHead(at, out) && out.head.number == number) return true;
    return false;
}

bool Reader::isWhole(const Found& f) const {
    BlockReader block;
    std::string why;
    if (f.end() > size_ || !load(f, block, why)) return false;
    for (Record r; block.next(r);) {}
    return block.whole() && block.records() == f.head.records;
}

// Sections that had the place of this block.
void Reader::forget(const Found& f) {
    for (auto& s : sections_) {
        if (s.bytes == 0 || s.at >= f.end() || s.at + s.bytes <= f.at) continue;
        gone_ += s.bytes;
        s.bytes = s.records = s.states = 0;
    }
}

bool Reader::grow() {
    if (!isSame()) return false;
    if (closed_) return true;
    if (newest_.at > 0 && std::any_of(damages_.begin(), damages_.end(), [&](auto& d) { return d.at == newest_.at; })) return !isWhole(newest_) && misses_ < kMostMisses;
    const std::size_t before = sections_.size();
    std::uint64_t end = sizeof head_, taken = 0;
    for (auto& s : sections_) end = std::max(end, s.at + s.bytes);
    for (Found f; taken < kMostGrowth && findNext(end, f);) {
        closed_ = f.head.flags & BlockHead::index;
        if (closed_ || !isWhole(f)) break;
        if (f.at < end) forget(f);
        append(f, before);
        end = std::max(end, f.end());
        taken += f.end() - f.at;
    }
    if (sections_.size() > before) newest_ = {};        // what was added is whole
    if (sections_.size() > before || closed_) misses_ = 0;
    return misses_ < kMostMisses && gone_ <= size_;
}

// ---- records ----

void Reader::seek(std::size_t section) {
    section_ = section;
    inBlock_ = false;
    if (section < sections_.size()) at_ = sections_[section].at;
}

// All records of the block in hand were read.
void Reader::leave() {
    inBlock_ = false;
    if (why_.empty() && (!block_.whole() || block_.records() != found_.head.records)) why_ = "this block is broken behind its first records";
    if (why_.empty()) return;
    damage(found_.at, std::min(found_.end(), size_), why_ + ": " + std::to_string(block_.records()) + " of its " + std::to_string(found_.head.records) + " records were read");
}

bool Reader::next(Record& out, std::size_t before) {
    for (;;) {
        if (inBlock_ && block_.next(out)) return true;
        if (inBlock_) leave();
        if (section_ >= std::min(before, sections_.size())) return false;
        const Section& s = sections_[section_];
        const std::uint64_t to = s.at + s.bytes;
        if (at_ >= to) {
            seek(section_ + 1);
            continue;
        }
        const bool found = find(at_, to, found_) && found_.at < to;
        if (!found || found_.at > at_) damage(at_, found ? found_.at : to, "no block begins here: it is broken");
        if (!found) {
            at_ = to;
            continue;
        }
        at_ = std::min(found_.end(), to);
        load(found_, block_, why_);
        inBlock_ = true;
    }
}

}  // namespace sorma::recording
