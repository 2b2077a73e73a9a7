// apart.h -- long numbers of a record, which do not stand among its bytes: they go from the message to the line by themselves, and back.
//
// A record of 200 000 floats as one run of bytes costs a pass through memory more at each end, and the other end waits meanwhile. Here they are
// moved by pieces that stay in the cache, so both ends work at the same time.
//
//     writing    the floats or ints of a message are Lent to the record that is written (xdr.h). Source gives the bytes of both.
//     reading    Apart takes them from the bytes of a record that has begun. The record stays behind as a shorter one, whose mark says so.
//                All that follows is read to room(), until it is full, and XdrReader puts them into the message.
//
// On the wire nothing differs. Memory that both processes share is copied before anybody looks at it; the bytes are put into order afterwards.
//
// Threads: no state but the objects'; one object belongs to one thread.
// Errors:  nothing throws but std::bad_alloc.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "comm/xdr.h"

namespace sorma::record {

// The bytes of records, and of the numbers that are lent to one of them. They must stay as they are.
class Source {
public:
    static constexpr std::size_t kPiece = 32 * 1024;        // [bytes] a multiple of 8
    Source(const Buffer& bytes, const Lent& lent) : bytes_(bytes), lent_(lent), left_(bytes.size() + lent.size()) {}
    std::size_t left() const { return left_; }
    // Returns some of the bytes that come next. They are the same until took() says how many were taken.
    std::string_view next();
    void took(std::size_t size);
    void appendTo(Buffer& out);                             // all that is left

private:
    const Buffer& bytes_;
    const Lent lent_;
    std::size_t left_;
    std::size_t at_ = 0, swapped_ = 0, end_ = 0;            // of bytes_, of lent_, of piece_
    std::size_t begin_ = 0;                                 // of piece_: what was taken
    char piece_[kPiece];
};

class Apart {
public:
    // A record of one piece begins at `at` and is not whole. Are the first of so many numbers here that they are to be read apart? Then they are
    // not in `in` any more, and what comes next is to be read to room().
    bool begin(Buffer& in, std::size_t at);
    bool filling() const { return have_ < size(); }         // its numbers are not all here
    char* room(std::size_t& size);                          // size: how much there is room for, at most so much
    void came(std::size_t size);
    std::size_t size() const { return 8 * count_; }         // [bytes] on the wire; 0: none was begun
    void end() { count_ = have_ = at_ = 0; }                // it was handled, or is lost. The memory stays
    std::size_t capacity() const { return 8 * (floats_.capacity() + ints_.capacity()); }
    // For XdrReader. at: how far in the record they belong. The numbers are exchanged with those that were there.
    std::size_t at() const { return at_; }
    bool give(std::vector<double>& to) { return give(floats_, to, true); }
    bool give(std::vector<std::int64_t>& to) { return give(ints_, to, false); }

private:
    template <class T> bool give(std::vector<T>& from, std::vector<T>& to, bool floats) {
        if (floats != isFloats_ || from.size() != count_) return false;
        from.swap(to);
        return true;
    }
    template <class T> char* roomIn(std::vector<T>& numbers, std::size_t& size);
    char* bytes() { return isFloats_ ? reinterpret_cast<char*>(floats_.data()) : reinterpret_cast<char*>(ints_.data()); }

    std::vector<double> floats_;
    std::vector<std::int64_t> ints_;
    bool isFloats_ = true;
    std::size_t count_ = 0, have_ = 0, at_ = 0;             // numbers; bytes of them that have come
};

}  // namespace sorma::record
