#include "track.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace recorder {

namespace {

bool earlier(const Mark& a, const Mark& b) { return a.time < b.time; }

}  // namespace

void Track::Sum::add(const Sum& other) {
    end = std::max(end, other.end);
    span = std::max(span, other.span);
    failed += other.failed;
}

void Track::add(const Mark& mark) {
    marks_.push_back(mark);
    failed_ += mark.failed;
    longest_ = std::max(longest_, mark.span);
}

// A request is added when it was answered, so some marks come behind later ones: these few are merged.
void Track::settle() {
    if (sorted_ == marks_.size()) return;
    const auto middle = marks_.begin() + std::ptrdiff_t(sorted_);
    std::stable_sort(middle, marks_.end(), earlier);
    const auto from = std::upper_bound(marks_.begin(), middle, *middle, earlier);
    std::inplace_merge(from, middle, marks_.end(), earlier);
    const auto changed = std::size_t(from - marks_.begin());
    sorted_ = marks_.size();
    rebuild(changed);
}

// Sums of an open mark have nothing but its beginning, so what is new is added.
void Track::complete(const Mark& mark) {
    constexpr std::size_t kMostSame = 10'000;       // of one time: a file may say anything
    const std::size_t begin = first(mark.time);
    for (std::size_t i = begin; i < sorted_ && i - begin < kMostSame && marks_[i].time == mark.time; ++i) {
        if (marks_[i].kind != Mark::open || marks_[i].section != mark.section) continue;
        marks_[i] = mark;
        failed_ += mark.failed;
        longest_ = std::max(longest_, mark.span);
        std::size_t at = i;
        for (auto& sums : levels_) sums[at /= kFan].add(mark);
        return;
    }
}

void Track::rebuild(std::size_t from) {
    std::size_t below = marks_.size();
    for (std::size_t level = 0; below > kFan; ++level) {
        if (levels_.size() == level) levels_.emplace_back();
        auto& sums = levels_[level];
        from /= kFan;
        sums.resize(std::min(from, sums.size()));
        for (std::size_t i = sums.size(); i * kFan < below; ++i) {
            Sum s;
            for (std::size_t k = i * kFan; k < std::min(below, (i + 1) * kFan); ++k)
                if (level == 0) s.add(marks_[k]);
                else s.add(levels_[level - 1][k]);
            sums.push_back(s);
        }
        below = sums.size();
    }
}

// Steps are doubled first: the next column is near.
std::size_t Track::firstFrom(std::size_t i, std::int64_t time) const {
    std::size_t step = 1, low = i;
    while (low + step < sorted_ && marks_[low + step].time < time) low += step, step *= 2;
    const auto end = std::min(low + step, sorted_);
    return std::size_t(std::lower_bound(marks_.begin() + std::ptrdiff_t(low), marks_.begin() + std::ptrdiff_t(end), time, [](const Mark& m, std::int64_t t) { return m.time < t; }) - marks_.begin());
}

Track::Sum Track::sum(std::size_t begin, std::size_t end) const {
    Sum s;
    std::size_t level = 0;              // begin and end count marks, then sums of level - 1
    auto take = [&](std::size_t i) {
        if (level == 0) s.add(marks_[i]);
        else s.add(levels_[level - 1][i]);
    };
    while (begin < end) {
        const bool top = level == levels_.size();
        while (begin < end && (top || begin % kFan != 0)) take(begin++);
        while (begin < end && end % kFan != 0) take(--end);
        begin /= kFan, end /= kFan;
        ++level;
    }
    return s;
}

template <class FitsSum, class FitsMark> std::size_t Track::seekFirst(std::size_t begin, std::size_t end, FitsSum fitsSum, FitsMark fitsMark) const {
    for (std::size_t i = begin; i < end;) {
        // The largest part that begins here, is within, and has none.
        std::size_t skip = 0, size = 1;
        for (auto& sums : levels_) {
            size *= kFan;
            if (i % size != 0 || fitsSum(sums[i / size])) break;
            skip = size;
        }
        if (skip > 0) i += skip;
        else if (fitsMark(marks_[i])) return i;
        else ++i;
    }
    return kNone;
}

template <class FitsSum, class FitsMark> std::size_t Track::seekLast(std::size_t begin, std::size_t end, FitsSum fitsSum, FitsMark fitsMark) const {
    for (std::size_t i = end; i > begin;) {
        std::size_t skip = 0, size = 1;
        for (auto& sums : levels_) {
            size *= kFan;
            if (i % size != 0 || fitsSum(sums[i / size - 1])) break;
            skip = size;
        }
        if (skip > 0) i = i > skip ? i - skip : 0;
        else if (fitsMark(marks_[--i])) return i;
    }
    return kNone;
}

void Track::draw(const View& view, std::vector<Column>& columns) const {
    std::size_t i = first(view.from);
    std::int64_t covered = sum(0, i).end;
    int begun = 0;                      // columns before it are done
    auto cover = [&](int until) {
        for (; begun < until && view.begins(begun) < covered; ++begun) columns[std::size_t(begun)].covered = true;
        begun = until;
    };
    while (i < sorted_ && marks_[i].time < view.until) {
        const int column = std::clamp(int(view.at(marks_[i].time)), begun, view.columns - 1);
        cover(column);
        const std::int64_t next = column + 1 < view.columns ? view.begins(column + 1) : view.until;
        const std::size_t end = std::max(i + 1, firstFrom(i, next));
        const Sum s = sum(i, end);
        Column& c = columns[std::size_t(column)];
        c.marks += std::uint32_t(end - i);
        c.failed += s.failed;
        covered = std::max(covered, s.end);
        i = end;
        begun = column + 1 < view.columns ? column + 1 : column;
    }
    cover(view.columns);
}

bool Track::list(const View& view, std::size_t most, std::vector<Mark>& out) const {
    const std::size_t begin = first(view.from), end = firstFrom(begin, view.until);
    if (end - begin > most) return false;
    const auto lasts = [&](auto& s) { return s.end > view.from; };
    const auto marked = [&](const Mark& m) { return m.end() > view.from; };
    std::vector<Mark> before;
    for (std::size_t i = begin; (i = seekLast(0, i, lasts, marked)) != kNone;) {
        before.push_back(marks_[i]);
        if (before.size() + (end - begin) > most) return false;
    }
    out.insert(out.end(), before.rbegin(), before.rend());
    out.insert(out.end(), marks_.begin() + std::ptrdiff_t(begin), marks_.begin() + std::ptrdiff_t(end));
    return true;
}

std::size_t Track::failedAfter(std::int64_t time) const {
    return seekFirst(first(time + 1), sorted_, [](auto& s) { return s.failed > 0; }, [](const Mark& m) { return m.failed; });
}
std::size_t Track::failedBefore(std::int64_t time) const {
    return seekLast(0, first(time), [](auto& s) { return s.failed > 0; }, [](const Mark& m) { return m.failed; });
}

std::size_t Track::nearest(std::int64_t time, std::int64_t within) const {
    const std::size_t begin = first(time - within), end = firstFrom(begin, time + within + 1);
    const Sum s = sum(begin, end);
    if (s.failed > 0) return seekFirst(begin, end, [](auto& x) { return x.failed > 0; }, [](const Mark& m) { return m.failed; });
    if (begin < end) return seekFirst(begin, end, [&](auto& x) { return x.span >= s.span; }, [&](const Mark& m) { return m.span >= s.span; });
    return seekLast(0, begin, [&](auto& x) { return x.end >= time - within; }, [&](const Mark& m) { return m.end() >= time - within; });
}

// ---- outlines ----

namespace {

void put(std::string& out, double number) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, number, std::chars_format::general, 6).ptr;
    if (!out.empty()) out += ' ';
    out.append(text, end);
}
void put(std::string& out, double x, double y) { put(out, x), put(out, y); }

// heights: of each column, in steps.
template <class Height> void outlineOf(std::size_t columns, int steps, Height height, std::string& out) {
    int now = 0;
    for (std::size_t c = 0; c <= columns; ++c) {
        const int next = c < columns ? height(c) : 0;
        if (next == now) continue;
        put(out, double(c), double(now) / steps);
        put(out, double(c), double(next) / steps);
        now = next;
    }
}

}  // namespace

void outline(const std::vector<Column>& columns, std::string& out) {
    constexpr int kSteps = 20, kCovered = 4, kOne = 8;
    std::uint32_t most = 1;
    for (auto& c : columns) most = std::max(most, c.marks);
    const double all = std::log1p(double(most));
    outlineOf(columns.size(), kSteps, [&](std::size_t i) {
        const Column& c = columns[i];
        if (c.marks == 0) return c.covered ? kCovered : 0;
        return kOne + int(std::lround((kSteps - kOne) * std::log1p(double(c.marks)) / all));
    }, out);
}

void outlineFailed(const std::vector<Column>& columns, std::string& out) {
    outlineOf(columns.size(), 1, [&](std::size_t i) { return columns[i].failed > 0 ? 1 : 0; }, out);
}

}  // namespace recorder
