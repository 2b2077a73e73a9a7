#include "timeline.h"

#include <bus/listText.h>

#include <algorithm>
#include <cmath>

#include "busRecording.h"
#include "history.h"

namespace recorder {

namespace rec = sorma::recording;

namespace {

constexpr std::size_t kMostRows = 1000, kMostList = 300;
constexpr int kMostColumns = 20'000;

// As a mark has it; a file may say anything.
float spanOf(std::int64_t ns) { return std::clamp(float(ns), 0.0F, 2e18F); }
std::int64_t within(std::int64_t time) { return std::clamp(time, View::kLeast, View::kMost); }

// Is a record a failure by its kind?
bool hasFailed(const rec::Record& r) {
    return r.kind == rec::Kind::loss || (r.kind == rec::Kind::reply && r.code < 0) || (r.kind == rec::Kind::note && (r.word == "lost" || r.word == "broken"));
}

const char* toText(unsigned kind) {
    constexpr const char* kTexts[] = {"request", "open", "answer", "event", "sample", "loss", "note"};
    return kTexts[std::min<std::size_t>(kind, std::size(kTexts) - 1)];
}

}  // namespace

Timeline::Timeline(std::string file, std::optional<rec::Index> index) : file_(std::move(file)), index_(std::move(index)), thread_([this] { run(false); }) {}

Timeline::~Timeline() {
    stop_ = true;
    thread_.join();
}

void Timeline::more() {
    {
        std::lock_guard lock(mutex_);
        if (!ended_) return;
        ended_ = false;
    }
    thread_.join();
    thread_ = std::thread([this] { run(true); });
}

// ---- the thread ----

std::uint32_t Timeline::Names::of(std::string_view text) {
    auto found = known.find(text);
    if (found == known.end()) {
        found = known.emplace(std::string(text), std::uint32_t(texts.size())).first;
        texts.push_back(&found->first);
    }
    return found->second;
}

void Timeline::forget() {
    {
        std::scoped_lock both(mutex_, reading_);
        reader_.reset();
        sources_.clear();
        error_.clear();
        sections_ = done_ = marks_ = tracks_ = 0;
        first_ = View::kMost, last_ = View::kLeast;
        full_ = false;
        ++version_;
    }
    names_ = {};
    places_.clear();
    found_.clear();
    awaited_.clear();
    waiting_ = 0;
}

// Returns the first section that was not read.
std::size_t Timeline::open(bool more) {
    if (more) {
        std::lock_guard lock(reading_);
        const std::size_t before = reader_ ? reader_->sections().size() : 0;
        if (reader_ && reader_->grow()) return before;
    }
    forget();
    refused_ = versionOf(file_);
    auto reader = index_ ? std::make_unique<rec::Reader>(file_, std::move(*index_)) : std::make_unique<rec::Reader>(file_);
    index_.reset();
    refused_.clear();
    std::lock_guard lock(reading_);
    reader_ = std::move(reader);
    return 0;
}

void Timeline::run(bool more) {
    std::string why;
    try {
        if (more && !refused_.empty() && versionOf(file_) == refused_) {
            std::lock_guard lock(mutex_);
            ended_ = true;
            return;
        }
        std::size_t s = open(more), sections = 0;
        {
            std::lock_guard lock(reading_);
            sections = std::min<std::size_t>(reader_->sections().size(), Mark::kMostSection);
        }
        {
            std::lock_guard lock(mutex_);
            sections_ = sections;
            done_ = s;
        }
        for (; s < sections && !stop_ && !full_; ++s) {
            read(s);
            merge();
        }
        tellOpen();
        merge();
    } catch (const std::exception& e) {
        why = e.what();
    }
    std::lock_guard lock(mutex_);
    error_ = why;
    ended_ = true;
}

void Timeline::read(std::size_t section) {
    std::lock_guard lock(reading_);
    reader_->seek(section);
    for (rec::Record r; reader_->next(r, section + 1);) take(r, std::uint32_t(section));
}

void Timeline::take(const Record& r, std::uint32_t section) {
    Mark mark;
    mark.section = section;
    mark.time = within(r.time);
    mark.failed = hasFailed(r);
    switch (r.kind) {
        case rec::Kind::request: {
            if (waiting_ >= kMostAwaited) giveUp();
            waiting_ += awaited_[names_.of(r.source)].emplace(r.number, Awaited{mark.time, names_.of(r.object), section, false}).second;
            return;
        }
        case rec::Kind::reply: {
            const std::uint32_t source = names_.of(r.source);
            auto& awaited = awaited_[source];
            auto found = awaited.find(r.number);
            if (found == awaited.end()) {
                mark.kind = Mark::answer;
                mark.span = spanOf(r.span);
                mark.time = within(mark.time - std::int64_t(mark.span));
                found_.push_back({source, names_.of(r.object), mark});
                return;
            }
            mark.span = spanOf(mark.time - found->second.time);
            mark.time = found->second.time;
            mark.section = found->second.section;
            found_.push_back({source, found->second.object, mark, found->second.told});
            awaited.erase(found);
            --waiting_;
            return;
        }
        case rec::Kind::event: mark.kind = Mark::event; break;
        case rec::Kind::sample: mark.kind = Mark::sample; break;
        case rec::Kind::loss:
            if (r.number == 0) return;          // states alone are missing: for History
            mark.kind = Mark::loss;
            break;
        case rec::Kind::note: mark.kind = Mark::note; break;
        default: return;
    }
    found_.push_back({names_.of(r.source), names_.of(r.object), mark});
}

// Requests without a reply so far become marks of their own. A reply that comes later completes them.
void Timeline::tellOpen() {
    for (auto& [source, awaited] : awaited_)
        for (auto& [number, a] : awaited) {
            if (a.told) continue;
            Mark mark;
            mark.time = a.time;
            mark.section = a.section;
            mark.kind = Mark::open;
            found_.push_back({source, a.object, mark});
            a.told = true;
        }
}

void Timeline::giveUp() {
    tellOpen();
    awaited_.clear();
    waiting_ = 0;
}

void Timeline::merge() {
    std::lock_guard lock(mutex_);
    for (auto& f : found_) {
        if (!f.completes && marks_ >= kMostMarks) full_ = true;
        if (f.completes || full_) continue;
        Place& place = places_[std::uint64_t(f.source) << 32 | f.object];
        if (!place.source) {
            place.source = &sources_[*names_.texts[f.source]];
            const std::string& object = *names_.texts[f.object];
            auto& objects = place.source->objects;
            const bool own = object.empty() || (tracks_ >= kMostTracks && !objects.contains(object));
            tracks_ += !own && !objects.contains(object);
            place.track = own ? &place.source->own : &objects[object];
        }
        place.source->all.add(f.mark);
        place.track->add(f.mark);
        ++marks_;
    }
    // Here, and not by the next question: what is in order already costs little.
    for (auto& f : found_) {
        const auto found = places_.find(std::uint64_t(f.source) << 32 | f.object);
        if (found == places_.end()) continue;
        for (Track* track : {&found->second.source->all, found->second.track}) {
            track->settle();
            if (f.completes) track->complete(f.mark);
        }
        first_ = std::min(first_, f.mark.time);
        last_ = std::max(last_, f.mark.end());
    }
    version_ += !found_.empty();
    found_.clear();
    ++done_;
}

// ---- answers ----

void Timeline::each(Source& source, std::string_view object, const MayTell& mayTell, const std::function<void(std::string_view, Track&)>& body) {
    if (!object.empty()) {
        auto found = source.objects.find(object);
        if (found != source.objects.end() && (!mayTell || mayTell(object))) body(object, found->second);
    } else if (!mayTell) {
        body({}, source.all);
    } else {
        // With too many objects, those that have no track of their own are there.
        if (tracks_ < kMostTracks) body({}, source.own);
        for (auto& [name, track] : source.objects)
            if (mayTell(name)) body(name, track);
    }
}

std::string Timeline::answer(const std::vector<std::string>& words, std::size_t at, const MayTell& mayTell, std::string& out) {
    const std::string what = at < words.size() ? words[at] : "about";
    const std::size_t n = words.size() - std::min(words.size(), at + 1);        // of the words that follow
    const auto number = [&](std::size_t i) -> const std::string& { return words[at + 1 + i]; };
    std::lock_guard lock(mutex_);
    if (what == "about" && n == 0) return about(mayTell, out), std::string();
    if (what == "tracks" && n == 0) return tracks(mayTell, out), std::string();
    const bool draws = what == "draw" && n >= 3 && n % 2 == 1, seeks = (what == "next" || what == "previous") && n >= 1 && n % 2 == 1;
    if (!draws && !seeks && !(what == "mark" && n == 4))
        return "expected about, draw FROM UNTIL COLUMNS SOURCE OBJECT ..., mark TIME WITHIN SOURCE OBJECT, next TIME SOURCE OBJECT ..., previous TIME SOURCE OBJECT ..., or tracks";
    if (n > 3 + 2 * kMostRows && draws) return "at most " + std::to_string(kMostRows) + " rows are drawn";
    std::int64_t time = 0, other = 0;
    if (!readSeconds(number(0), time) || ((draws || what == "mark") && !readSeconds(number(1), other))) return "a time is a number of seconds";
    time = within(time), other = within(other);
    if (draws) {
        std::int64_t columns = 0;
        if (other <= time || !sorma::parseNumber(number(2), columns) || columns < 1 || columns > kMostColumns)
            return "draw expects a time, a later one, and a number of columns from 1 to " + std::to_string(kMostColumns);
        const View view{time, other, int(columns)};
        const std::size_t most = kMostList * 5 / std::max<std::size_t>(5, (n - 3) / 2);
        for (std::size_t i = 3; i + 1 < n; i += 2) {
            std::string row;
            if (auto found = sources_.find(number(i)); found != sources_.end()) draw(view, found->second, number(i + 1), most, mayTell, row);
            sorma::appendListElement(out, row);
        }
        return {};
    }
    if (what == "mark") {
        if (auto found = sources_.find(number(2)); found != sources_.end()) describe(number(2), number(3), time, std::max<std::int64_t>(0, other), mayTell, out);
        return {};
    }
    const bool next = what == "next";
    const Mark* best = nullptr;
    std::string source, object;
    for (std::size_t i = 1; i + 1 < n; i += 2) {
        auto found = sources_.find(number(i));
        if (found == sources_.end()) continue;
        each(found->second, number(i + 1), mayTell, [&](std::string_view, Track& track) {
            const std::size_t m = next ? track.failedAfter(time) : track.failedBefore(time);
            if (m == Track::kNone || (best && (next ? track.at(m).time >= best->time : track.at(m).time <= best->time))) return;
            best = &track.at(m);
            source = number(i), object = number(i + 1);
        });
    }
    if (best) tellMark(source, object, *best, out);
    return {};
}

void Timeline::about(const MayTell& mayTell, std::string& out) const {
    sorma::DictText dict;
    const double part = ended_ ? 1 : std::min(1.0, double(done_) / double(std::max<std::size_t>(1, sections_)));
    dict.put("done", ended_ ? "1" : std::to_string(std::min(part, 0.999)));
    dict.put("error", error_);
    dict.put("first", seconds(marks_ ? first_ : 0));
    dict.put("last", seconds(marks_ ? last_ : 0));
    dict.put("tracks", std::to_string(tracks_));
    dict.put("complete", full_ ? "0" : "1");
    dict.put("version", std::to_string(version_));
    if (!mayTell) dict.put("marks", std::to_string(marks_));
    out = dict.text();
}

void Timeline::tracks(const MayTell& mayTell, std::string& out) const {
    const auto add = [&](const std::string& source, std::string_view object, const Track& track) {
        sorma::appendListElement(out, sorma::listOf({source, std::string(object), std::to_string(track.size()), std::to_string(track.failed()), seconds(std::int64_t(track.longest()))}));
    };
    for (auto& [name, source] : sources_) {
        add(name, {}, mayTell ? Track() : source.all);
        for (auto& [object, track] : source.objects)
            if (!mayTell || mayTell(object)) add(name, object, track);
    }
}

// A row: few marks one by one, more of them as outlines.
void Timeline::draw(const View& view, Source& source, std::string_view object, std::size_t most, const MayTell& mayTell, std::string& out) {
    std::vector<Mark> marks;
    std::vector<Column> columns;
    each(source, object, mayTell, [&](std::string_view, Track& track) {
        if (columns.empty() && track.list(view, most - std::min(most, marks.size()), marks)) return;
        columns.resize(std::size_t(view.columns));
        track.draw(view, columns);
    });
    sorma::DictText dict;
    if (columns.empty()) {
        std::string list;
        for (auto& m : marks) {
            const double begin = std::clamp(view.at(m.time), -10.0, view.columns + 10.0), end = std::clamp(view.at(within(m.end())), -10.0, view.columns + 10.0);
            for (auto& text : {std::to_string(begin), std::to_string(end), std::string(m.failed ? "failed" : toText(m.kind))}) sorma::appendListElement(list, text);
        }
        dict.put("list", list);
    } else {
        // Those of the objects that came before.
        for (auto& m : marks)
            if (m.time >= view.from) {
                Column& c = columns[std::size_t(std::clamp(int(view.at(m.time)), 0, view.columns - 1))];
                ++c.marks, c.failed += m.failed;
            }
        std::string shape, failed;
        outline(columns, shape);
        outlineFailed(columns, failed);
        dict.put("shape", shape);
        dict.put("failed", failed);
    }
    out = dict.text();
}

void Timeline::describe(const std::string& source, std::string_view row, std::int64_t time, std::int64_t slack, const MayTell& mayTell, std::string& out) {
    slack = std::min(slack, View::kMost / 4);
    const auto distance = [&](const Mark& m) { return std::abs(double(m.time) - double(time)); };
    const Mark* best = nullptr;
    std::string object(row);
    each(sources_.find(source)->second, row, mayTell, [&](std::string_view name, Track& track) {
        const std::size_t m = track.nearest(std::clamp(time, View::kLeast / 2, View::kMost / 2), slack);
        if (m == Track::kNone) return;
        const Mark& mark = track.at(m);
        if (best && (mark.failed < best->failed || (mark.failed == best->failed && distance(mark) >= distance(*best)))) return;
        best = &mark;
        object = name;
    });
    if (!best) return;
    tellMark(source, row, *best, out);
    const std::string records = recordsOf(source, object, *best, mayTell);
    sorma::appendListElement(out, "records");
    sorma::appendListElement(out, records);
}

// Its record or, of a request, that and the reply: the texts stand in the file alone.
std::string Timeline::recordsOf(const std::string& source, std::string_view object, const Mark& mark, const MayTell& mayTell) {
    constexpr rec::Kind kKinds[] = {rec::Kind::request, rec::Kind::request, rec::Kind::reply, rec::Kind::event, rec::Kind::sample, rec::Kind::loss, rec::Kind::note};
    std::lock_guard lock(reading_);
    sorma::Message m;
    std::string out, request;
    const rec::Kind kind = kKinds[mark.kind];
    std::uint64_t number = 0;
    bool found = false;
    const bool all = object.empty() && !mayTell;        // the track is that of all objects
    reader_->seek(mark.section);
    for (rec::Record r; !found && reader_->next(r, mark.section + 1);) {
        if (r.kind != kind || r.source != source || (!all && r.object != object)) continue;
        const std::int64_t time = mark.kind == Mark::answer ? within(within(r.time) - std::int64_t(spanOf(r.span))) : within(r.time);
        if (time != mark.time) continue;
        found = true;
        number = r.number;
        request = textOf(r, m);
        sorma::appendListElement(out, dictOf(r, request));
    }
    if (!found || mark.kind != Mark::request) return out;
    // The time of its reply is known to seven digits.
    const std::int64_t end = mark.end(), about = std::int64_t(double(mark.span) * 1e-6) + 2;
    const auto& sections = reader_->sections();
    for (std::size_t s = mark.section; s < sections.size(); ++s) {
        if (sections[s].last < end - about || sections[s].first > end + about) continue;
        reader_->seek(s);
        for (rec::Record r; reader_->next(r, s + 1);)
            if (r.kind == rec::Kind::reply && r.number == number && r.source == source) {
                const std::string text = textOf(r, m);
                sorma::appendListElement(out, dictOf(r, text, request));
                return out;
            }
    }
    return out;
}

void Timeline::tellMark(std::string_view source, std::string_view object, const Mark& mark, std::string& out) {
    sorma::DictText dict;
    dict.put("time", seconds(mark.time));
    dict.put("span", seconds(std::int64_t(mark.span)));
    dict.put("kind", toText(mark.kind));
    dict.put("failed", mark.failed ? "1" : "0");
    dict.put("source", source);
    dict.put("object", object);
    out = dict.text();
}

}  // namespace recorder
