// track.h -- when something happened at one object, for a time line: ten million marks, drawn in some hundred columns.
//
// Marks are kept in the order of time. Above them stand levels of summaries, each of kFan entries below. So what a column of pixels
// shows costs some steps, however many marks are in it.
//
// Threads: none of its own; an object belongs to one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace recorder {

// A request with its reply, or something else that was recorded.
struct Mark {
    enum Kind : std::uint8_t {
        request,        // with its reply
        open,           // its reply is not in the recording
        answer,         // its request is not
        event,
        sample,
        loss,           // so counts as failed
        note,
    };
    static constexpr std::uint32_t kMostSection = (1u << 28) - 1;
    std::int64_t time = 0;              // when it began [ns since 1970]
    float span = 0;                     // until its reply [ns]
    std::uint32_t section : 28 = 0;     // of the file, where its first record stands
    std::uint32_t kind : 3 = request;
    std::uint32_t failed : 1 = 0;
    std::int64_t end() const { return time + std::int64_t(span); }
};
static_assert(sizeof(Mark) == 16);

// A window of time, and in how many columns it is drawn. Its times are within kLeast and kMost, and until is later than from.
struct View {
    static constexpr std::int64_t kLeast = -(std::int64_t(1) << 62), kMost = (std::int64_t(1) << 62) - 1;      // their difference is a number, too
    std::int64_t from = 0, until = 1;   // [ns since 1970]
    int columns = 1;
    double at(std::int64_t time) const { return double(time - from) * columns / double(until - from); }
    std::int64_t begins(int column) const { return from + std::int64_t(double(until - from) * column / columns); }
};

// The marks of a column. covered: by a request that began before it.
struct Column {
    std::uint32_t marks = 0, failed = 0;
    bool covered = false;
};

class Track {
public:
    static constexpr std::size_t kNone = SIZE_MAX;
    void add(const Mark& mark);         // in any order; mostly in that of time is quick
    std::size_t size() const { return marks_.size(); }
    std::size_t failed() const { return failed_; }
    float longest() const { return longest_; }
    const Mark& at(std::size_t i) const { return marks_[i]; }
    std::size_t bytes() const { return marks_.capacity() * sizeof(Mark); }

    // The others need the order of time: settle() makes it.
    void settle();
    // The reply of an open mark came: that of this time and section becomes this one.
    void complete(const Mark& mark);
    // Add what it has in these columns to what is in them.
    void draw(const View& view, std::vector<Column>& columns) const;
    // The marks that are seen in a view, the oldest first. False: they are more than most.
    bool list(const View& view, std::size_t most, std::vector<Mark>& out) const;
    // The next one that has failed, behind a time, or before it; kNone: there is none.
    std::size_t failedAfter(std::int64_t time) const;
    std::size_t failedBefore(std::int64_t time) const;
    // The mark at a time, within so many ns, for a person with a pointer. One that has failed comes first. Then comes the longest one of
    // those that begin there, and then the last one that began before and goes on until then.
    std::size_t nearest(std::int64_t time, std::int64_t within) const;

private:
    static constexpr std::size_t kFan = 32;
    // Of consecutive marks.
    struct Sum {
        std::int64_t end = INT64_MIN;
        float span = -1;
        std::uint32_t failed = 0;
        void add(const Sum& other);
        void add(const Mark& mark) { add(Sum{mark.end(), mark.span, mark.failed}); }
    };
    std::size_t first(std::int64_t time) const { return firstFrom(0, time); }
    std::size_t firstFrom(std::size_t i, std::int64_t time) const;      // the first mark from i on that is not before time
    Sum sum(std::size_t begin, std::size_t end) const;
    void rebuild(std::size_t from);
    // The first mark, or the last one, in [begin, end) that fits. fits(sum): may one below it?
    template <class FitsSum, class FitsMark> std::size_t seekFirst(std::size_t begin, std::size_t end, FitsSum fitsSum, FitsMark fitsMark) const;
    template <class FitsSum, class FitsMark> std::size_t seekLast(std::size_t begin, std::size_t end, FitsSum fitsSum, FitsMark fitsMark) const;

    std::vector<Mark> marks_;
    std::size_t sorted_ = 0;            // so many are in order, and in the summaries
    std::vector<std::vector<Sum>> levels_;      // the finest first
    std::size_t failed_ = 0;
    float longest_ = 0;
};

// The outline of columns, for a polygon: x in columns, y from 0, the bottom, to 1. Grows with the logarithm of the marks. Empty: nothing is there.
void outline(const std::vector<Column>& columns, std::string& out);
// The same of those alone in which something has failed, as high as it goes.
void outlineFailed(const std::vector<Column>& columns, std::string& out);

}  // namespace recorder
