#include "recording/block.h"

#include <algorithm>
#include <cstring>

#include "recording/crc32c.h"

namespace sorma::recording {

namespace {

// The sum before the first record: of the file and of the block, so that nothing of another block passes for a part of this one.
std::uint32_t seed(std::uint64_t file, std::uint64_t number) {
    const std::uint64_t both[2] = {file, number};
    return crc32c(both, sizeof both);
}

// ---- parts: a count of 32 bits, then so much ----

using Count = std::uint32_t;

std::size_t sizeOf(std::string_view text) { return sizeof(Count) + text.size(); }
std::size_t sizeOf(const std::vector<std::string>& words) {
    std::size_t all = sizeof(Count);
    for (auto& w : words) all += sizeOf(w);
    return all;
}
std::size_t sizeOf(const Entry& e) {
    return 1 + sizeOf(e.symbol) + sizeOf(e.details) + sizeOf(e.text) + sizeOf(e.so) + sizeOf(e.daemon) + sizeOf(e.file) + sizeOf(e.request) + 4 + 8;
}
std::size_t sizeOf(const Trail& trail) {
    std::size_t all = 2 * sizeof(Count);
    for (auto& e : trail.entries()) all += sizeOf(e);
    return all;
}
template <class T> std::size_t sizeOf(const std::vector<T>& values) { return sizeof(Count) + values.size() * sizeof(T); }

class Pen {
public:
    explicit Pen(char* at) : at_(at) {}
    template <class T> void put(T value) { put(&value, sizeof value); }
    void put(const void* bytes, std::size_t n) {
        if (n > 0) std::memcpy(at_, bytes, n);
        at_ += n;
    }
    void text(std::string_view t) { put(Count(t.size())), put(t.data(), t.size()); }
    void words(const std::vector<std::string>& list) {
        put(Count(list.size()));
        for (auto& w : list) text(w);
    }
    template <class T> void numbers(const std::vector<T>& list) { put(Count(list.size())), put(list.data(), list.size() * sizeof(T)); }
    void trail(const Trail& t) {
        put(Count(t.dropped()));
        put(Count(t.entries().size()));
        for (auto& e : t.entries()) {
            put(std::uint8_t(e.severity));
            text(e.symbol), words(e.details), text(e.text), text(e.so), text(e.daemon), text(e.file), text(e.request);
            put(std::int32_t(e.line)), put(e.time);
        }
    }

private:
    char* at_;
};

class Lens {
public:
    explicit Lens(std::string_view bytes) : left_(bytes) {}
    bool good() const { return good_; }
    bool atEnd() const { return left_.empty(); }
    template <class T> T get() {
        T value{};
        if (has(sizeof value)) std::memcpy(&value, left_.data(), sizeof value), left_.remove_prefix(sizeof value);
        return value;
    }
    void text(std::string& out) {
        const auto n = get<Count>();
        if (!has(n)) return;
        out.assign(left_.data(), n);
        left_.remove_prefix(n);
    }
    void words(std::vector<std::string>& out) {
        const auto n = get<Count>();
        if (!has(std::size_t(n) * sizeof(Count))) return;           // each has at least its size
        out.resize(n);
        for (auto& w : out) text(w);
    }
    template <class T> void numbers(std::vector<T>& out) {
        const auto n = get<Count>();
        if (!has(std::size_t(n) * sizeof(T))) return;
        out.resize(n);
        if (n > 0) std::memcpy(out.data(), left_.data(), n * sizeof(T));
        left_.remove_prefix(n * sizeof(T));
    }
    void trail(Trail& out) {
        const auto dropped = get<Count>(), n = get<Count>();
        for (Count i = 0; i < n && good_; ++i) {
            Entry e;
            const auto severity = get<std::uint8_t>();
            if (severity > std::uint8_t(Severity::error)) good_ = false;
            e.severity = Severity(severity);
            text(e.symbol), words(e.details), text(e.text), text(e.so), text(e.daemon), text(e.file), text(e.request);
            e.line = get<std::int32_t>(), e.time = get<std::int64_t>();
            if (good_) out.add(std::move(e));
        }
        out.setDropped(out.dropped() + dropped);
    }

private:
    bool has(std::size_t n) { return good_ = good_ && n <= left_.size(); }
    std::string_view left_;
    bool good_ = true;
};

// Which parts a message has, and how many bytes they are.
std::uint16_t partsOf(const Message& m, std::size_t& size) {
    std::uint16_t parts = 0;
    auto has = [&](bool any, std::uint16_t part, const auto& value) {
        if (any) parts |= part, size += sizeOf(value);
    };
    has(!m.text.empty(), RecordHead::text, m.text);
    has(!m.floats.empty(), RecordHead::floats, m.floats);
    has(!m.ints.empty(), RecordHead::ints, m.ints);
    has(!m.any.empty(), RecordHead::any, m.any);
    has(!m.words.empty(), RecordHead::words, m.words);
    has(!m.trail.empty(), RecordHead::trail, m.trail);
    return parts;
}

}  // namespace

// ---- writing ----

std::uint32_t Block::name(std::string_view text) {
    if (text.empty()) return 0;
    if (auto found = known_.find(text); found != known_.end()) return found->second;
    const auto number = std::uint32_t(names_.size() + 1);
    names_.push_back(known_.emplace(std::string(text), number).first->first);
    RecordHead head;
    head.kind = Kind::name;
    head.number = number;
    head.parts = RecordHead::text;
    head.size = std::uint32_t(sizeof head + sizeOf(text));
    const std::size_t at = bytes_.size();
    bytes_.resize(at + head.size);
    Pen pen(bytes_.data() + at);
    pen.put(head);
    pen.text(text);
    return number;
}

bool Block::add(const Facts& facts, const Message* content) {
    RecordHead head;
    std::size_t size = sizeof head;
    if (content) head.parts = partsOf(*content, size);
    const std::string_view texts[3] = {facts.source, facts.object, facts.word};
    for (auto& text : texts)
        if (text.size() > kMostRecord) return false;
    if (size > kMostRecord) return false;
    std::uint32_t numbers[3] = {};
    for (int i = 0; i < 3; ++i) {
        if (texts[i].empty()) continue;             // requests have a caller, and the replies between them none
        if (texts[i] != lastText_[i]) {
            lastName_[i] = name(texts[i]);
            lastText_[i] = names_[lastName_[i] - 1];
        }
        numbers[i] = lastName_[i];
    }
    head.size = std::uint32_t(size);
    head.kind = facts.kind;
    if (facts.method) head.method = std::uint8_t(*facts.method);
    head.code = facts.code;
    head.source = numbers[0], head.object = numbers[1], head.word = numbers[2];
    head.time = facts.time;
    head.number = facts.number;
    head.span = facts.span;
    if (records_ == 0) first_ = last_ = facts.time;
    first_ = std::min(first_, facts.time), last_ = std::max(last_, facts.time);
    ++records_;
    states_ += facts.kind == Kind::state;
    append(head, content, size);
    return true;
}

void Block::append(const RecordHead& head, const Message* content, std::size_t size) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + size);
    Pen pen(bytes_.data() + at);
    pen.put(head);
    if (head.parts & RecordHead::text) pen.text(content->text);
    if (head.parts & RecordHead::floats) pen.numbers(content->floats);
    if (head.parts & RecordHead::ints) pen.numbers(content->ints);
    if (head.parts & RecordHead::any) pen.numbers(content->any);
    if (head.parts & RecordHead::words) pen.words(content->words);
    if (head.parts & RecordHead::trail) pen.trail(content->trail);
}

const std::string& Block::finish(std::uint64_t file, std::uint64_t number) {
    constexpr std::size_t kBehind = offsetof(RecordHead, check) + sizeof(RecordHead::check);
    std::uint32_t check = seed(file, number);
    for (std::size_t at = 0; at < bytes_.size();) {
        char* p = bytes_.data() + at;
        std::uint32_t size;
        std::memcpy(&size, p, sizeof size);
        check = crc32c(p + kBehind, size - kBehind, crc32c(&size, sizeof size, check));
        std::memcpy(p + offsetof(RecordHead, check), &check, sizeof check);
        at += size;
    }
    return bytes_;
}

void Block::clear() {
    bytes_.clear();
    known_.clear();
    names_.clear();
    for (auto& text : lastText_) text = {};
    for (auto& number : lastName_) number = 0;
    records_ = states_ = 0;
    first_ = last_ = 0;
}

// ---- reading ----

BlockReader::BlockReader(std::string bytes, std::uint64_t file, std::uint64_t number)
    : bytes_(std::move(bytes)), check_(seed(file, number)) {}

// The head of the record at at_, when that is whole.
bool BlockReader::take(RecordHead& head) {
    constexpr std::size_t kBehind = offsetof(RecordHead, check) + sizeof(RecordHead::check);
    const std::size_t left = bytes_.size() - at_;
    if (left < sizeof head) return false;
    const char* p = bytes_.data() + at_;
    std::memcpy(&head, p, sizeof head);
    if (head.size < sizeof head || head.size > left) return false;
    const std::uint32_t check = crc32c(p + kBehind, head.size - kBehind, crc32c(&head.size, sizeof head.size, check_));
    if (check != head.check) return false;
    check_ = check;
    return true;
}

// The check sum finds accidents. A file that was made by somebody else may hold anything.
bool BlockReader::next(Record& out) {
    RecordHead head;
    while (take(head)) {
        const std::string_view content(bytes_.data() + at_ + sizeof head, head.size - sizeof head);
        const std::size_t known = names_.size();
        if (head.kind == Kind::name) {
            if (head.number != known + 1 || head.parts != RecordHead::text || content.size() < sizeof(Count)) return false;
            names_.push_back(content.substr(sizeof(Count)));
            at_ += head.size;
            continue;
        }
        if (head.source > known || head.object > known || head.word > known) return false;
        at_ += head.size;
        ++records_;
        if (head.kind < Kind::name || head.kind > kLastKind) continue;          // of a later version
        out.kind = head.kind;
        out.method.reset();
        if (head.method <= std::uint8_t(Method::dbx)) out.method = Method(head.method);
        out.source = text(head.source), out.object = text(head.object), out.word = text(head.word);
        out.code = head.code;
        out.time = head.time;
        out.number = head.number;
        out.span = head.span;
        out.content = content;
        out.parts = head.parts;
        return true;
    }
    return false;
}

bool Record::read(Message& out) const {
    out.reset();
    out.code = code;
    Lens lens(content);
    if (parts & RecordHead::text) lens.text(out.text);
    if (parts & RecordHead::floats) lens.numbers(out.floats);
    if (parts & RecordHead::ints) lens.numbers(out.ints);
    if (parts & RecordHead::any) lens.numbers(out.any);
    if (parts & RecordHead::words) lens.words(out.words);
    if (parts & RecordHead::trail) lens.trail(out.trail);
    return lens.good() && lens.atEnd() && (parts & ~RecordHead::all) == 0;
}

}  // namespace sorma::recording
