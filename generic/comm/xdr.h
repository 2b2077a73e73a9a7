// xdr.h -- writes and reads XDR (RFC 4506) in memory. It is inline, since every call uses it.
//
// libtirpc's xdr_* reach each word through a function pointer, which costs more than the rest of an empty call. The test
// suite compares this with what rpcgen makes of sorma.x.
//
// All words are big-endian, and take 4 or 8 bytes. Texts and bytes are counted and padded to a multiple of 4.
//
// Threads: no state but the objects'; one object belongs to one thread.
// Errors:  a writer throws std::bad_alloc. A reader never throws for its input and never reads beyond its record. When the
//          record is too short, the reader becomes bad, stays bad, and returns zeros and empty texts.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sorma {

// Between the byte order of this machine and that of the wire.
inline std::uint32_t swapped(std::uint32_t v) {
    return std::endian::native == std::endian::big ? v : __builtin_bswap32(v);
}
inline std::uint64_t swapped(std::uint64_t v) {
    return std::endian::native == std::endian::big ? v : __builtin_bswap64(v);
}

// Change the byte order of so many words of 8 bytes, between this machine's and that of the wire. to may be from; otherwise they do not
// overlap. Neither has to be aligned.
void swapMany(char* to, const char* from, std::size_t words);
inline void swapWords(char* to, const char* from, std::size_t words) {
    constexpr std::size_t kFew = 16;                                // are not worth a call
    if (words > kFew) return swapMany(to, from, words);
    for (; words > 0; --words, to += 8, from += 8) {
        std::uint64_t w;
        std::memcpy(&w, from, 8);
        w = swapped(w);
        std::memcpy(to, &w, 8);
    }
}

// Bytes that grow at the end. New bytes are undefined, since clearing them would cost more than writing them. Growing moves
// the bytes: pointers into a buffer are valid until the next append, extend, reserve or resize. May be moved, not copied.
class Buffer {
public:
    Buffer() = default;
    Buffer(Buffer&& o) noexcept
        : data_(std::exchange(o.data_, nullptr)), size_(std::exchange(o.size_, 0)), capacity_(std::exchange(o.capacity_, 0)) {}
    Buffer& operator=(Buffer&& o) noexcept {
        std::swap(data_, o.data_);
        std::swap(size_, o.size_);
        std::swap(capacity_, o.capacity_);
        return *this;
    }
    ~Buffer() { std::free(data_); }

    char* data() { return data_; }
    const char* data() const { return data_; }
    std::size_t size() const { return size_; }
    std::size_t capacity() const { return capacity_; }
    bool empty() const { return size_ == 0; }
    void clear() { size_ = 0; }                                     // keeps the memory
    void resize(std::size_t n) { reserve(n); size_ = n; }
    void reserve(std::size_t n) {
        if (n <= capacity_) return;
        std::size_t wanted = capacity_ * 2 > n ? capacity_ * 2 : n;
        if (wanted < 256) wanted = 256;
        void* grown = std::realloc(data_, wanted);
        if (!grown) throw std::bad_alloc();
        data_ = static_cast<char*>(grown);
        capacity_ = wanted;
    }
    char* extend(std::size_t n) {                                   // n more bytes; returns where they begin
        reserve(size_ + n);
        char* at = data_ + size_;
        size_ += n;
        return at;
    }
    void append(const char* bytes, std::size_t n) {
        if (n > 0) std::memcpy(extend(n), bytes, n);
    }
    void drop(std::size_t n) {                                      // remove n bytes from the front
        size_ -= n;
        if (size_ > 0) std::memmove(data_, data_ + n, size_);
    }
    void release() {                                                // clear, and free the memory
        std::free(data_);
        data_ = nullptr;
        size_ = capacity_ = 0;
    }

private:
    char* data_ = nullptr;
    std::size_t size_ = 0, capacity_ = 0;
};

namespace record {

inline constexpr std::size_t kLong = 64 * 1024;                     // [bytes] of numbers that are worth being moved apart
class Apart;

// Numbers of 64 bits that belong into a record, and do not stand there: see apart.h.
struct Lent {
    std::size_t at = 0;                                             // how far in the buffer of the record they belong
    const char* data = nullptr;                                     // in the byte order of this machine; null: none
    std::size_t count = 0;
    std::size_t size() const { return 8 * count; }                  // [bytes]
};

}  // namespace record

// Appends to a buffer, which must outlive it.
class XdrWriter {
public:
    // lent: the first long numbers are not copied. They must stay as they are until the record is sent.
    explicit XdrWriter(Buffer& out, record::Lent* lent = nullptr) : lent_(lent), out_(out) {}

    void u32(std::uint32_t v) { put(out_.extend(4), v); }
    void i32(std::int32_t v) { u32(static_cast<std::uint32_t>(v)); }
    void u64(std::uint64_t v) { put(out_.extend(8), v); }
    void i64(std::int64_t v) { u64(static_cast<std::uint64_t>(v)); }
    template <class... Words> void words(Words... v) {              // several u32, with one check for room
        char* at = out_.extend(4 * sizeof...(v));
        ((put(at, static_cast<std::uint32_t>(v)), at += 4), ...);
    }
    void bytes(const void* data, std::size_t n) {                   // counted, padded to a multiple of 4
        char* at = out_.extend(4 + padded(n));
        put(at, static_cast<std::uint32_t>(n));
        if (n == 0) return;
        std::uint32_t zero = 0;
        std::memcpy(at + padded(n), &zero, 4);                      // the last word: clears the padding
        std::memcpy(at + 4, data, n);
    }
    void text(std::string_view s) { bytes(s.data(), s.size()); }
    template <class T> void array64(const std::vector<T>& v) {      // counted 64-bit elements
        static_assert(sizeof(T) == 8);
        if (8 * v.size() >= record::kLong && lent_ && !lent_->data) [[unlikely]] {
            u32(static_cast<std::uint32_t>(v.size()));
            *lent_ = {out_.size(), reinterpret_cast<const char*>(v.data()), v.size()};
            return;
        }
        char* at = out_.extend(4 + 8 * v.size());
        put(at, static_cast<std::uint32_t>(v.size()));
        if (!v.empty()) swapWords(at + 4, reinterpret_cast<const char*>(v.data()), v.size());
    }
    void texts(const std::vector<std::string>& v) {
        u32(static_cast<std::uint32_t>(v.size()));
        for (auto& s : v) text(s);
    }

    static std::size_t padded(std::size_t n) { return (n + 3) & ~std::size_t{3}; }
    static void put(char* at, std::uint32_t v) { v = swapped(v); std::memcpy(at, &v, 4); }
    static void put(char* at, std::uint64_t v) { v = swapped(v); std::memcpy(at, &v, 8); }

protected:
    record::Lent* const lent_;

private:
    Buffer& out_;
};

// Reads from the front of a record, which must outlive it and the views that it returns. A copy reads on by itself.
class XdrReader {
public:
    XdrReader(const char* data, std::size_t size) : at_(data), end_(data + size) {}
    explicit XdrReader(std::string_view record) : XdrReader(record.data(), record.size()) {}
    // apart: numbers of the record that do not stand in it. It must outlive the reader, and gives them to the first that reads them.
    XdrReader(std::string_view record, record::Apart& apart);

    bool good() const { return good_; }                             // check it before you use what was read
    bool atEnd() const { return at_ == end_; }
    std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }      // [bytes]
    void spoil() { good_ = false; at_ = end_; }                     // make it bad: the caller found something wrong

    std::uint32_t u32() {
        if (!has(4)) return 0;
        std::uint32_t v;
        std::memcpy(&v, at_, 4);
        at_ += 4;
        return swapped(v);
    }
    std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
    std::uint64_t u64() {
        if (!has(8)) return 0;
        std::uint64_t v;
        std::memcpy(&v, at_, 8);
        at_ += 8;
        return swapped(v);
    }
    std::int64_t i64() { return static_cast<std::int64_t>(u64()); }
    template <class... Words> void words(Words&... v) {             // several u32; all are 0 when there are too few
        const char* at = at_;
        if (!has(4 * sizeof...(v))) return ((v = 0), ...), void();
        at_ += 4 * sizeof...(v);
        auto next = [&](std::uint32_t& word) {
            std::memcpy(&word, at, 4);
            word = swapped(word);
            at += 4;
        };
        (next(v), ...);
    }
    bool skipZeros(std::size_t n) {                                 // false: something else is there, and nothing is skipped
        static constexpr char kZeros[16] = {};
        return n <= sizeof kZeros && skipBytes(kZeros, n);
    }
    bool skipBytes(const char* bytes, std::size_t n) {              // likewise
        if (left() < n || std::memcmp(at_, bytes, n) != 0) return false;
        at_ += n;
        return true;
    }
    std::string_view text() {                                       // a view into the record; UTF-8 is not checked
        std::size_t n = u32();
        if (n > left()) return spoil(), std::string_view();         // first: where size_t has 32 bits padding may overflow
        if (!has(XdrWriter::padded(n))) return {};
        std::string_view v(at_, n);
        at_ += XdrWriter::padded(n);
        return v;
    }
    void bytes(std::vector<unsigned char>& out) {
        auto v = text();
        if (v.empty()) return out.clear();                          // which is inline
        auto* p = reinterpret_cast<const unsigned char*>(v.data());
        out.assign(p, p + v.size());
    }
    template <class T> void array64(std::vector<T>& out) {
        static_assert(sizeof(T) == 8);
        std::size_t n = u32();
        if (at_ == hole_) [[unlikely]] return takeApart(out);
        if (n > left() / 8) return spoil();
        if (n == 0) return out.clear();
        out.resize(n);
        swapWords(reinterpret_cast<char*>(out.data()), at_, n);
        at_ += 8 * n;
    }
    void skip64() {                                                 // past counted 64-bit elements
        std::size_t n = u32();
        if (at_ == hole_) return void(hole_ = nullptr);
        if (n > left() / 8) return spoil();
        at_ += 8 * n;
    }
    bool hasApart() const { return apart_; }
    // The count of elements that follow, of which each has at least `least` bytes on the wire. If the record is too short for
    // the count, the reader becomes bad. So no peer can make us reserve memory for elements that do not come.
    std::size_t count(std::size_t least) {
        std::size_t n = u32();
        if (n > left() / least) return spoil(), 0;
        return n;
    }
    void texts(std::vector<std::string>& out) {
        std::size_t n = count(4);
        out.resize(n);
        for (auto& s : out) s = text();
    }
    void text(std::string& out) {
        auto v = text();
        if (v.empty()) out.clear();                                 // which is inline
        else out = v;
    }

    void skip(std::size_t n) {
        if (has(n)) at_ += n;
    }

private:
    bool has(std::size_t n) {
        if (n <= left()) return true;
        spoil();
        return false;
    }
    template <class T> void takeApart(std::vector<T>& out);

    const char* at_;
    const char* end_;
    bool good_ = true;
    const char* hole_ = nullptr;                                    // where the numbers that are apart belong; null: nowhere
    record::Apart* apart_ = nullptr;
};

}  // namespace sorma
