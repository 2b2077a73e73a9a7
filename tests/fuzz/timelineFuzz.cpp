// timelineFuzz.cpp -- a hostile recording as a time line: each question has an answer, also while the file changes, and all of them agree.
// And marks of one object: after any operations they are where a list of them says.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "fuzz.h"
#include "mend.h"

#include "bus/listText.h"
#include "bus/requestText.h"
#include "recording/writer.h"
#include "recorder/timeline.h"
#include "recorder/track.h"

using namespace sorma;
using namespace sorma::recording;

namespace {

// ---- the file ----

std::string ask(recorder::Timeline& line, const std::vector<std::string>& words, const recorder::Timeline::MayTell& mayTell = {}) {
    std::string out;
    const std::string wrong = line.answer(words, 0, mayTell, out);
    demand(wrong.empty(), wrong.c_str());
    return out;
}
std::string get(const std::string& dict, std::string_view key) {
    const auto words = splitWords(dict);
    for (std::size_t i = 0; i + 1 < words.size(); i += 2)
        if (words[i] == key) return words[i + 1];
    return {};
}
std::string await(recorder::Timeline& line) {
    for (;;) {
        std::string about = ask(line, {"about"});
        if (get(about, "done") == "1") return about;
        std::this_thread::yield();
    }
}
void askAll(recorder::Timeline& line) {
    const std::string about = await(line), first = get(about, "first"), last = get(about, "last");
    std::vector<std::string> rows, draw{"draw", "0", "9000000000", "100"};
    std::size_t marks = 0;
    for (auto& track : splitWords(ask(line, {"tracks"}))) {
        const auto words = splitWords(track);
        demand(words.size() == 5, "words of a track", std::int64_t(words.size()));
        if (words[1].empty()) marks += std::stoul(words[2]);
        if (rows.size() < 20) rows.insert(rows.end(), {words[0], words[1]});
    }
    demand(std::to_string(marks) == get(about, "marks"), "marks of all sources", std::int64_t(marks));
    const recorder::Timeline::MayTell some = [](std::string_view object) { return object.size() % 2 == 0; };
    draw.insert(draw.end(), rows.begin(), rows.end());
    demand(splitWords(ask(line, draw)).size() == rows.size() / 2, "rows drawn");
    ask(line, draw, some);
    // A time before 1970 has no text that is read.
    if (first[0] == '-' || last[0] == '-' || first.size() > 20 || last.size() > 20) return;
    draw[1] = first, draw[2] = last;
    if (first != last) ask(line, draw);
    for (std::size_t i = 0; i < rows.size(); i += 2) {
        ask(line, {"mark", first, "1", rows[i], rows[i + 1]});
        ask(line, {"mark", last, "0", rows[i], rows[i + 1]}, some);
        const std::string next = ask(line, {"next", "0", rows[i], rows[i + 1]});
        if (!next.empty()) demand(get(next, "failed") == "1", "the next one has not failed");
        ask(line, {"previous", last, rows[i], rows[i + 1]}, some);
    }
}

void append(std::string& out, const void* bytes, std::size_t n) { out.append(static_cast<const char*>(bytes), n); }

// Records as the bytes say. With sums that agree, the reader takes whatever is in them.
std::string blockOf(Input& input, std::uint64_t number) {
    static constexpr Kind kKinds[] = {Kind::request, Kind::reply, Kind::request, Kind::reply, Kind::event, Kind::sample, Kind::loss, Kind::note, Kind::state};
    static constexpr const char* kNames[] = {"", "a", "foo.a", "cell", "foo.bar"};
    static constexpr std::int64_t kTimes[] = {0, 1, 1'000'000'000, INT64_MAX, INT64_MIN, 1'800'000'000'000'000'000, -1};
    Block block;
    Message m;
    m.text = "text";
    for (int n = input.below(12); n >= 0 && !input.done(); --n) {
        const std::int64_t time = std::int64_t(std::uint64_t(kTimes[input.below(7)]) + (input.byte() << input.below(24)));
        block.add({.kind = kKinds[input.below(9)], .method = Method::exec, .source = kNames[input.below(5)], .object = kNames[input.below(5)], .word = "w", .code = input.below(3) - 1,
                   .time = time, .number = std::uint64_t(input.below(5)), .span = kTimes[input.below(7)]}, &m);
    }
    BlockHead head;
    head.id = 7;
    head.number = number;
    const std::string& plain = block.finish(head.id, number);
    head.records = block.records();
    head.states = block.states();
    head.first = block.first(), head.last = block.last();
    head.stored = head.plain = std::uint32_t(plain.size());
    std::string out;
    append(out, &head, sizeof head);
    out += plain;
    mend<BlockHead>(out, 0);
    return out;
}

struct File {
    const int fd = memfd_create("recording", 0);
    const std::string name = "/proc/self/fd/" + std::to_string(fd);
    void put(const std::string& bytes) const { demand(ftruncate(fd, 0) == 0 && pwrite(fd, bytes.data(), bytes.size(), 0) == ssize_t(bytes.size()), "written"); }
};

// The file as it comes, then whole blocks that are appended, overwritten or cut meanwhile.
void asFile(Input& input, std::string bytes) {
    static const File file;
    mend<FileHead>(bytes, 0);
    mend<BlockHead>(bytes, sizeof(FileHead));
    file.put(bytes);
    recorder::Timeline line(file.name);
    askAll(line);
    FileHead head;
    head.id = 7;
    bytes.clear();
    append(bytes, &head, sizeof head);
    mend<FileHead>(bytes, 0);
    std::uint64_t number = 0;
    while (!input.done()) {
        const std::string block = blockOf(input, number);
        switch (input.below(6)) {
            case 0: bytes.resize(bytes.size() - std::min<std::size_t>(bytes.size(), input.byte())); break;
            case 1: bytes.replace(std::min<std::size_t>(bytes.size(), sizeof head), block.size(), block), ++number; break;
            case 2: if (!bytes.empty()) bytes[input.byte() * 7919U % bytes.size()] ^= char(input.byte()); break;
            default: bytes += block, ++number;
        }
        file.put(bytes);
        line.more();
        askAll(line);
    }
    // Read anew it has at least what the growing one cannot have lost: an answer to everything.
    recorder::Timeline anew(file.name);
    askAll(anew);
}

// ---- marks of one object ----

void asMarks(Input& input) {
    recorder::Track track;
    std::vector<recorder::Mark> all;
    while (!input.done()) {
        const unsigned operation = input.byte();
        const std::int64_t time = input.byte() * 16 + input.below(16);
        if (operation % 8 < 5) {
            recorder::Mark mark;
            mark.time = time;
            mark.section = std::uint32_t(input.below(3));
            mark.kind = operation % 8 < 2 ? recorder::Mark::open : recorder::Mark::request;
            if (mark.kind == recorder::Mark::request) mark.span = float(input.byte()), mark.failed = input.below(4) == 0;
            // Many of them, so that there are summaries.
            for (int n = input.below(40); n >= 0; --n, mark.time += 3) track.add(mark), all.push_back(mark);
            continue;
        }
        track.settle();
        if (operation % 8 == 5) {
            for (auto& m : all) {
                if (m.kind != recorder::Mark::open || m.time < time) continue;
                m.kind = recorder::Mark::request, m.span = float(input.byte()), m.failed = input.below(2);
                track.complete(m);
                break;
            }
            continue;
        }
        const std::int64_t until = time + 1 + input.byte() * 8;
        std::size_t failed = 0, inside = 0;
        std::int64_t next = -1, before = -1;
        for (auto& m : all) {
            failed += m.failed;
            inside += m.time < until && (m.time >= time || m.end() > time);
            if (m.failed && m.time > time && (next < 0 || m.time < next)) next = m.time;
            if (m.failed && m.time < time) before = std::max(before, m.time);
        }
        demand(track.size() == all.size() && track.failed() == failed, "marks", std::int64_t(failed));
        std::vector<recorder::Mark> listed;
        demand(track.list({time, until, 10}, all.size(), listed) && listed.size() == inside, "marks of a view", std::int64_t(listed.size()));
        const std::size_t after = track.failedAfter(time), earlier = track.failedBefore(time);
        demand((after == track.kNone ? -1 : track.at(after).time) == next, "the next one that has failed", next);
        demand((earlier == track.kNone ? -1 : track.at(earlier).time) == before, "the one before that has failed", before);
        std::vector<recorder::Column> columns(10);
        track.draw({time, until, 10}, columns);
        std::size_t drawn = 0, begun = 0;
        for (auto& c : columns) drawn += c.marks;
        for (auto& m : all) begun += m.time >= time && m.time < until;
        demand(drawn == begun, "marks drawn", std::int64_t(drawn));
        track.nearest(time, until - time);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 2) return 0;
    Input input(data + 1, size - 1);
    if (data[0] % 2) asMarks(input);
    else asFile(input, std::string(reinterpret_cast<const char*>(data), size));
    return 0;
}
