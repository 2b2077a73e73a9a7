// record.h -- records in a stream of bytes (RFC 5531 section 11). No other code reads or writes the mark of a record.
//
// A record is one or more pieces. Before each piece stands its mark, one word: the length of the piece in 31 bits, and the
// highest bit in the last piece of a record. We write records of one piece, and clients read nothing else. A daemon reads all.
//
// Threads: no state but the objects'; one object belongs to one thread.
// Errors:  nothing throws but std::bad_alloc. Nothing reads beyond the bytes that it is given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "comm/xdr.h"

namespace sorma::record {

inline constexpr std::uint32_t kLast = 0x80000000;              // in the mark of the last piece
inline constexpr std::size_t kMarkSize = 4;                     // [bytes]
inline constexpr std::size_t kMostWelcome = 1 << 20;            // [bytes] of the first record from a daemon, at most
inline constexpr std::size_t kMostBeforeHello = 64 * 1024;      // [bytes] of a record from a client that is not known yet, at most
inline constexpr int kMostEmpty = 64;                           // empty pieces in one record, at most

// ---- writing ----

// Begin a record at the end of out; close() writes its mark when its length is known. Returns where it begins.
inline std::size_t open(Buffer& out) {
    std::size_t start = out.size();
    out.extend(kMarkSize);
    return start;
}
inline void close(Buffer& out, std::size_t start, std::size_t lent = 0) {          // lent: [bytes] that do not stand there
    XdrWriter::put(out.data() + start, kLast | static_cast<std::uint32_t>(out.size() - start - kMarkSize + lent));
}

// ---- reading ----

// The front of some bytes.
struct Piece {
    bool known = false;             // its mark is there; otherwise nothing else is
    bool last = false;              // it ends its record
    bool whole = false;             // all of it is there
    std::size_t length = 0;         // [bytes] without the mark
    const char* body = nullptr;     // whole: where it is

    std::size_t size() const { return kMarkSize + length; }     // [bytes] with its mark; not known: of the mark
    std::string_view text() const { return {body, length}; }
};
inline Piece front(const char* at, const char* end) {
    const auto left = static_cast<std::size_t>(end - at);
    if (left < kMarkSize) return {};
    const std::uint32_t mark = XdrReader(at, kMarkSize).u32();
    const std::size_t length = mark & ~kLast;
    return {true, (mark & kLast) != 0, left - kMarkSize >= length, length, at + kMarkSize};
}

// Goes through bytes that hold records of one piece each.
class Reader {
public:
    // most: bytes that a record may have.
    Reader(const char* at, std::size_t size, std::size_t most) : at_(at), end_(at + size), most_(most) {}
    explicit Reader(const Buffer& bytes, std::size_t most = SIZE_MAX) : Reader(bytes.data(), bytes.size(), most) {}
    // The next record, without its mark. False: no whole one is there, or what is there is wrong().
    bool next(std::string_view& record) {
        const Piece piece = front(at_, end_);
        wrong_ = piece.known && (!piece.last || piece.length > most_);
        if (wrong_ || !piece.whole) return false;
        record = piece.text();
        at_ += piece.size();
        return true;
    }
    bool wrong() const { return wrong_; }       // no record, or one of several pieces, or one that is too long
    const char* at() const { return at_; }      // behind the last record

private:
    const char* at_;
    const char* end_;
    std::size_t most_;
    bool wrong_ = false;
};

// How many records bytes hold that we have written ourselves, and how many bytes the first ones have that end within size.
std::size_t count(const Buffer& bytes);
std::size_t wholeBefore(const Buffer& bytes, std::size_t size);

// Puts the pieces of records together, and drops records that are refused. For one stream.
class Assembler {
public:
    // Drop what has come of a refused record. Moves at to what follows.
    void drop(const char*& at, const char* end);
    // Refuse the record of which this many bytes follow: drop them as they come.
    void refuse(std::size_t bytes) { dropping_ = bytes; }
    std::size_t dropping() const { return dropping_; }          // [bytes] still to come
    // Add a whole piece. True: it ends a record, which is in the piece or in own.
    bool add(const Piece& piece, Buffer& own, std::string_view& record);
    std::size_t size() const { return pieces_.size(); }         // [bytes] of the record that has begun
    std::size_t capacity() const { return pieces_.capacity(); }
    bool tooEmpty() const { return empties_ > kMostEmpty; }     // its peer sends nothing, and again and again
    bool inside() const { return dropping_ > 0 || pieces_.size() > 0; }     // of a record

private:
    Buffer pieces_;
    int empties_ = 0;
    std::size_t dropping_ = 0;
};

}  // namespace sorma::record
