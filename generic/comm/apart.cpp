#include "comm/apart.h"

#include "comm/record.h"
#include "comm/wire.h"

namespace sorma::record {

namespace {

constexpr std::size_t kStep = 64 * 1024;                    // [bytes] that are put into order while they are in the cache

}  // namespace

// ---- writing ----

std::string_view Source::next() {
    if (begin_ < end_) return {piece_ + begin_, end_ - begin_};
    if (at_ < lent_.at) return {bytes_.data() + at_, lent_.at - at_};
    if (swapped_ == lent_.size()) return {bytes_.data() + at_, bytes_.size() - at_};
    end_ = std::min(kPiece, lent_.size() - swapped_);
    begin_ = 0;
    swapWords(piece_, lent_.data + swapped_, end_ / 8);
    swapped_ += end_;
    return {piece_, end_};
}

void Source::took(std::size_t size) {
    left_ -= size;
    (begin_ < end_ ? begin_ : at_) += size;
}

void Source::appendTo(Buffer& out) {
    out.reserve(out.size() + left_);
    while (left_ > 0) {
        const std::string_view bytes = next();
        out.append(bytes.data(), bytes.size());
        took(bytes.size());
    }
}

// ---- reading ----

bool Apart::begin(Buffer& in, std::size_t at) {
    const Piece piece = front(in.data() + at, in.data() + in.size());
    if (!piece.known || !piece.last || piece.whole || piece.length < kLong) return false;
    XdrReader r(in.data() + at + kMarkSize, in.size() - at - kMarkSize);
    const wire::Numbers found = wire::findNumbers(r);
    const std::size_t here = r.left(), before = in.size() - at - kMarkSize - here, size = 8 * found.count;
    if (size < kLong || here >= size || size > piece.length - before) return false;
    isFloats_ = found.floats;
    count_ = found.count;
    have_ = 0;
    at_ = before;
    for (const char* from = in.data() + in.size() - here; have_ < here;) {
        std::size_t most = here - have_;
        char* to = room(most);
        std::memcpy(to, from + have_, most);
        came(most);
    }
    in.resize(in.size() - here);
    XdrWriter::put(in.data() + at, kLast | std::uint32_t(piece.length - size));
    return true;
}

// Memory is taken for what has come, not for what is said to come: four times as much, and when it is there again.
template <class T> char* Apart::roomIn(std::vector<T>& numbers, std::size_t& size) {
    if (have_ == 0 && numbers.capacity() < count_) numbers.clear();
    if (have_ == 0 && numbers.size() > count_) numbers.resize(count_);
    if (have_ == 8 * numbers.size()) {
        if (numbers.size() == numbers.capacity()) numbers.reserve(std::min(count_, std::max(4 * numbers.size(), kStep / 8)));
        numbers.resize(std::min({count_, numbers.capacity(), numbers.size() + kStep / 8}));
    }
    size = std::min({size, 8 * numbers.size() - have_, kStep});
    return bytes() + have_;
}

char* Apart::room(std::size_t& size) { return isFloats_ ? roomIn(floats_, size) : roomIn(ints_, size); }

void Apart::came(std::size_t size) {
    const std::size_t before = have_ / 8, now = (have_ + size) / 8;
    char* first = bytes() + 8 * before;
    swapWords(first, first, now - before);
    have_ += size;
}

}  // namespace sorma::record
