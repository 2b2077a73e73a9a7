#include "history.h"

#include <sys/stat.h>

#include <bus/glob.h>
#include <bus/listText.h>
#include <bus/nearest.h>
#include <bus/statistics.h>

#include <algorithm>
#include <set>

namespace recorder {

namespace rec = sorma::recording;

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
// Without an index not all sources may be known: they have looks, too, about a minute apart.
constexpr std::int64_t kSurely = 130 * kSecond;

std::string clockText(std::int64_t ns) { return sorma::clockText(ns / 1000); }

rec::State stateOf(const rec::Record& r) { return rec::State(r.code); }

}  // namespace

std::string versionOf(const std::string& file) {
    struct stat s{};
    if (::stat(file.c_str(), &s) != 0) return {};
    std::string out;
    for (auto part : {std::uint64_t(s.st_dev), std::uint64_t(s.st_ino), std::uint64_t(s.st_size), std::uint64_t(s.st_mtim.tv_sec), std::uint64_t(s.st_mtim.tv_nsec)})
        out += std::to_string(part) + " ";
    return out;
}

bool readSeconds(std::string_view text, std::int64_t& ns) {
    constexpr std::size_t kDigits = 9;
    const auto dot = text.find('.');
    std::string fraction(dot == text.npos ? std::string_view() : text.substr(dot + 1));
    const std::string whole(text.substr(0, dot));
    auto digits = [](const std::string& t) { return std::all_of(t.begin(), t.end(), [](char c) { return c >= '0' && c <= '9'; }); };
    if (whole.empty() || whole.size() > 10 || !digits(whole) || !digits(fraction)) return false;
    fraction.resize(kDigits, '0');
    const std::int64_t seconds = std::stoll(whole);
    if (seconds >= INT64_MAX / kSecond) return false;
    ns = seconds * kSecond + std::stoll(fraction);
    return true;
}

History::History(std::unique_ptr<rec::Reader> reader, std::optional<std::int64_t> until) : reader_(std::move(reader)) {
    for (auto& s : reader_->sections()) {
        first_ = std::min(first_, s.first), last_ = std::max(last_, s.last);
        lastUpTo_.push_back(last_);
    }
    if (until) last_ = std::max(last_, *until);
    const std::set<std::string, std::less<>> words{"lost", "found", rec::kReasons[0], rec::kReasons[1], rec::kReasons[2], rec::kReasons[3]};
    for (std::uint32_t i = 0; i < reader_->names().size(); ++i) {
        const std::string& name = reader_->names()[i];
        if (words.contains(name)) marks_.push_back(i);
        if (name.starts_with(rec::kLooked)) looks_.emplace(name.substr(rec::kLooked.size()), i);
    }
    for (auto& s : reader_->sections()) indexed_ = indexed_ && s.named;
}

// ---- ways through the file ----

History::Place History::placeOf(std::string_view name) const {
    const auto found = std::find(reader_->names().begin(), reader_->names().end(), name);
    return found == reader_->names().end() ? Place() : Place(std::uint32_t(found - reader_->names().begin()));
}

// May it have losses, or what became of a source?
bool History::tells(const rec::Section& s) const {
    return !s.named || std::any_of(marks_.begin(), marks_.end(), [&](auto n) { return std::binary_search(s.names.begin(), s.names.end(), n); });
}

// Take records up to that time. The newest section comes first, but within a section the oldest record.
// enough: does nothing older than this time matter? It is asked before each section.
template <class Wants, class Enough> void History::back(std::int64_t time, Wants wants, Enough enough, const Take& take) {
    for (std::size_t i = reader_->sections().size(); i-- > 0;) {
        const rec::Section& s = reader_->sections()[i];
        if (enough(lastUpTo_[i])) return;
        if (s.first > time || !wants(s)) continue;
        reader_->seek(i);
        for (rec::Record r; reader_->next(r, i + 1);)
            if (r.time <= time) take(r);
    }
}

// Records behind that time, the oldest section first.   enough: is asked before each section.
template <class Wants, class Enough> void History::forth(std::int64_t time, Wants wants, Enough enough, const Take& take) {
    for (std::size_t i = 0; i < reader_->sections().size() && !enough(); ++i) {
        const rec::Section& s = reader_->sections()[i];
        if (s.last <= time || !wants(s)) continue;
        reader_->seek(i);
        for (rec::Record r; reader_->next(r, i + 1);)
            if (r.time > time) take(r);
    }
}

// Find one record of that time.
bool History::fetch(std::int64_t time, const std::function<bool(const Record&)>& is, const Take& take) {
    for (std::size_t i = 0; i < reader_->sections().size(); ++i) {
        const rec::Section& s = reader_->sections()[i];
        if (s.first > time || s.last < time) continue;
        reader_->seek(i);
        for (rec::Record r; reader_->next(r, i + 1);)
            if (r.time == time && is(r)) return take(r), true;
    }
    return false;
}

// ---- sources ----

// Looks, losses, lost and found daemons. Records come in no order: the latest counts.
void History::note(const Record& r) {
    if (r.kind == rec::Kind::state && stateOf(r) == rec::State::look) {
        Source& s = sources_[std::string(r.source)];
        if ((s.look && r.time < *s.look) || !r.read(message_)) return;
        s.look = r.time;
        s.underWay.clear();
        for (std::size_t i = 0; i + 1 < message_.ints.size(); i += 2) s.underWay.push_back({std::uint64_t(message_.ints[i]), message_.ints[i + 1]});
    } else if (r.kind == rec::Kind::state && stateOf(r) == rec::State::looked) {
        Source& s = sources_[std::string(r.source)];
        const std::int64_t began = r.time - std::clamp<std::int64_t>(r.span, 0, 3600 * kSecond);
        if (!s.looked || began > *s.looked) s.looked = began;
    } else if (r.kind == rec::Kind::loss) {
        sources_[std::string(r.source)].missing.push_back({r.time, r.time + std::max<std::int64_t>(0, r.span), r.number});
    } else if (r.kind == rec::Kind::note && (r.word == "lost" || r.word == "found") && r.read(message_) && message_.words.size() == 1) {
        Source& s = sources_[message_.words[0]];
        if (r.word == "found") s.found = std::max(s.found, r.time);
        else if (r.time >= s.lost) s.lost = r.time, s.why = message_.text;
    }
}

// Is the moment in the recording?
void History::need(std::int64_t time) const {
    if (reader_->sections().empty()) throw Unknown("the recording is empty");
    if (time < first_) throw Unknown(clockText(time) + " is not in the recording: it begins at " + clockText(first_));
    if (time > last_) throw Unknown(clockText(time) + " is not in the recording: it ends at " + clockText(last_));
}

std::string History::like(const std::string& name) const { return sorma::didYouMean(name, reader_->names()); }

// ---- options ----

History::Known History::know(const Subject& subject, std::int64_t time, std::string& source) {
    std::map<std::string, Known, std::less<>> known;
    const Place place = placeOf(subject.name);
    // A source is settled when all records that matter are newer: it has told all of this object, or that it has none, or was lost.
    auto isSettled = [&](const std::string& name, std::int64_t newest) {
        auto met = sources_.find(name);
        if (met == sources_.end()) return false;
        const Source& s = met->second;
        if (subject.source.empty() && s.lost > s.found && newest < s.lost) return true;
        auto found = known.find(name);
        const auto since = std::max(found != known.end() && found->second.whole ? *found->second.whole : INT64_MIN, s.looked.value_or(INT64_MIN));
        return newest < since;
    };
    auto enough = [&](std::int64_t newest) {
        if (!subject.source.empty()) return isSettled(subject.source, newest);
        if (!indexed_ && (sources_.empty() || newest > time - kSurely)) return false;
        for (auto& [name, word] : looks_)
            if (!isSettled(name, newest)) return false;
        return std::all_of(sources_.begin(), sources_.end(), [&](auto& s) { return looks_.contains(s.first) || !s.second.look || isSettled(s.first, newest); });
    };
    auto wants = [&](const rec::Section& s) {
        if (tells(s) || has(s, place)) return true;
        for (auto& [name, word] : looks_)
            if ((subject.source.empty() || name == subject.source) && !isSettled(name, s.last) && has(s, word)) return true;
        return false;
    };
    back(time, wants, enough, [&](const Record& r) {
        note(r);
        if (r.object != subject.name || (!subject.source.empty() && r.source != subject.source)) return;
        if (r.kind == rec::Kind::reply && (r.parts & rec::RecordHead::trail)) {
            Known& k = known[std::string(r.source)];
            if (r.time >= k.trail.time) k.trail = {r.number, r.time};
        }
        if (r.kind != rec::Kind::state || !r.read(message_)) return;
        Known& k = known[std::string(r.source)];
        if (stateOf(r) == rec::State::gone) k.gone = std::max(k.gone.value_or(INT64_MIN), r.time);
        if (stateOf(r) == rec::State::told)
            for (std::size_t i = 0; i + 1 < message_.words.size(); i += 2)
                if (auto& told = k.told[message_.words[i]]; told.first <= r.time) told = {r.time, message_.words[i + 1]};
        if (stateOf(r) != rec::State::whole || (k.whole && r.time < *k.whole)) return;
        k.whole = r.time;
        k.type = r.word;
        k.values.clear();
        for (std::size_t i = 0; i + 1 < message_.words.size(); i += 2) k.values.emplace_back(message_.words[i], message_.words[i + 1]);
        if (message_.ints.size() == 2 && message_.ints[1] >= k.trail.time) k.trail = {std::uint64_t(message_.ints[0]), message_.ints[1]};
    });
    std::string all;
    std::size_t alive = 0;
    for (auto& [name, k] : known) {
        if (!k.whole && !k.gone && k.told.empty()) continue;
        const bool gone = k.gone && *k.gone >= k.whole.value_or(INT64_MIN);
        if (!gone || source.empty()) source = alive == 0 || !gone ? name : source;
        alive += !gone;
        if (!gone) all += (all.empty() ? "" : ", ") + subject.name + "@" + name;
    }
    if (alive > 1) throw Unknown("several sources had " + subject.name + ": say " + all);
    return source.empty() ? Known() : known[source];
}

// Fails when the recording does not know what the object was like.
void History::judge(const Subject& subject, const std::string& source, const Known& k, std::int64_t time) const {
    const std::string& name = subject.name;
    if (k.gone && *k.gone >= k.whole.value_or(INT64_MIN)) throw Unknown("there was no " + name + " at " + clockText(time) + ": it was removed at " + clockText(*k.gone));
    auto found = sources_.find(source.empty() ? subject.source : source);
    if (!k.whole && (found == sources_.end() || !found->second.looked)) {
        if (!subject.source.empty() && found == sources_.end()) throw Unknown("nothing of " + subject.source + " is in the recording at " + clockText(time));
        // One source alone has no name to look it up by.
        const bool any = std::any_of(sources_.begin(), sources_.end(), [](auto& s) { return s.second.looked.has_value(); });
        if (!any) throw Unknown("what objects were like at " + clockText(time) + " is not in the recording: it has looked at them later, or has lost that");
    }
    if (!k.whole) throw Unknown("no object " + name + " is in the recording at " + clockText(time) + like(name));
    const Source& s = found->second;
    if (s.looked && *s.looked > *k.whole)
        throw Unknown(name + " is not in the recording at " + clockText(time) + ": at the last look, " + clockText(*s.looked) + ", it was not there or could not be told");
    if (s.lost > s.found && s.lost >= *k.whole) throw Unknown(source + " is not in the recording at " + clockText(time) + ": it was lost at " + clockText(s.lost) + ": " + s.why);
    for (auto& m : s.missing)
        if (m.last >= *k.whole)
            throw Unknown("what " + name + " was like at " + clockText(time) + " is not certain: records of " + source + " are missing, from " + clockText(m.first) + " to " +
                          clockText(m.last) + ", " + std::to_string(m.records) + " of them; before, its options are known of " + clockText(*k.whole));
}

// Nobody tells when an object changes a value by itself. The next look sees it.
void History::needSame(const std::string& name, const std::string& source, std::vector<Value> values, std::int64_t time) {
    auto wants = [&, place = placeOf(name)](const rec::Section& s) { return has(s, place); };
    auto enough = [&] { return values.empty(); };
    forth(time, wants, enough, [&](const Record& r) {
        if (values.empty() || r.kind != rec::Kind::state || r.object != name || r.source != source || !r.read(message_)) return;
        const auto state = stateOf(r);
        if (state == rec::State::gone) return values.clear();
        if (state != rec::State::told && state != rec::State::whole) return;
        for (std::size_t i = 0; i + 1 < message_.words.size(); i += 2) {
            const std::string &option = message_.words[i], &then = message_.words[i + 1];
            auto v = std::find_if(values.begin(), values.end(), [&](auto& v) { return v.option == option; });
            if (v == values.end()) continue;
            if (state == rec::State::whole && v->value != then)
                throw Unknown(name + " has changed " + option + " by itself between " + clockText(v->since) + " and " + clockText(r.time) + ", from " + sorma::shown(v->value) +
                              " to " + sorma::shown(then) + ": when is not in the recording");
            values.erase(v);
        }
        if (state == rec::State::whole) values.clear();
    });
}

// option: this one; empty: all.
std::vector<History::Value> History::valuesOf(const Subject& subject, std::string_view option, std::int64_t time) {
    std::string source = subject.source;
    const Known k = know(subject, time, source);
    judge(subject, source, k, time);
    std::vector<Value> values;
    std::vector<std::string> names;
    for (auto& [name, value] : k.values) {
        names.push_back(name);
        if (!option.empty() && name != option) continue;
        auto told = k.told.find(name);
        const bool later = told != k.told.end() && told->second.first >= *k.whole;
        values.push_back({name, later ? told->second.second : value, later ? told->second.first : *k.whole});
    }
    if (values.empty() && !option.empty())
        throw Unknown(subject.name + " had no option " + std::string(option) + " at " + clockText(time) + sorma::didYouMean(option, names));
    needSame(subject.name, source, values, time);
    return values;
}

// ---- trails, buffers, requests ----

void History::trail(const Subject& subject, std::int64_t time, sorma::Message& out) {
    std::string source = subject.source;
    const Known k = know(subject, time, source);
    judge(subject, source, k, time);
    if (k.trail.time == 0) return;
    const bool found = fetch(k.trail.time, [&](const Record& r) { return r.kind == rec::Kind::reply && r.number == k.trail.number && r.source == source; }, [&](const Record& r) {
        if (r.read(message_)) out.text = message_.trail.toText();
    });
    if (!found) throw Unknown("the reply with the last trail of " + subject.name + ", of " + clockText(k.trail.time) + ", is not in the recording any more");
}

void History::buffer(const std::string& key, std::int64_t time, sorma::Message& out) {
    std::int64_t newest = INT64_MIN;
    Mark told;
    std::int64_t toldAt = INT64_MIN;
    auto wants = [&, place = placeOf(key)](const rec::Section& s) { return has(s, place); };
    auto enough = [&](std::int64_t before) { return before < std::max(newest, toldAt); };
    back(time, wants, enough, [&](const Record& r) {
        if (r.object != key) return;
        if (r.kind == rec::Kind::sample && r.time >= newest && r.read(out)) newest = r.time;
        if (r.kind == rec::Kind::state && stateOf(r) == rec::State::buffer && r.time >= toldAt && r.read(message_) && message_.ints.size() == 2)
            toldAt = r.time, told = {std::uint64_t(message_.ints[0]), message_.ints[1]};
    });
    if (newest == INT64_MIN && toldAt != INT64_MIN) {
        const bool found = fetch(told.time, [&](const Record& r) { return r.kind == rec::Kind::sample && r.object == key && r.number == told.number; }, [&](const Record& r) { r.read(out); });
        if (!found) throw Unknown("the last record of " + key + ", of " + clockText(told.time) + ", is not in the recording any more");
        return;
    }
    if (newest == INT64_MIN) throw Unknown("no record of a buffer " + key + " up to " + clockText(time) + " is in the recording" + like(key));
}

void History::underWay(const std::string& pattern, std::int64_t time, const std::function<bool(std::string_view)>& mayTell, sorma::Message& out) {
    using Key = std::pair<std::string, std::uint64_t>;
    std::map<Key, std::string> requests;        // as dicts
    std::set<Key> answered;
    auto dictOf = [&](const Record& r) {
        std::string text;
        sorma::appendRequest(text, r.object, r.method.value_or(sorma::Method::exec), message_);
        sorma::DictText dict;
        dict.put("source", r.source), dict.put("object", r.object), dict.put("caller", r.word);
        dict.put("since", clockText(r.time)), dict.put("text", text);
        return dict.text();
    };
    auto wanted = [&](const Record& r) { return (pattern == "*" || sorma::globMatch(pattern, r.object)) && (!mayTell || mayTell(r.object)); };
    auto enough = [&](std::int64_t newest) {
        const bool all = indexed_ ? std::all_of(looks_.begin(), looks_.end(), [&](auto& l) { return sources_.contains(l.first); }) : newest <= time - kSurely;
        return !sources_.empty() && all && std::all_of(sources_.begin(), sources_.end(), [&](auto& s) { return (s.second.lost > s.second.found && newest < s.second.lost) || (s.second.look && newest < *s.second.look) || !looks_.contains(s.first); });
    };
    auto any = [](const rec::Section&) { return true; };
    back(time, any, enough, [&](const Record& r) {
        note(r);
        const Key key(r.source, r.number);
        if (r.kind == rec::Kind::reply) {
            if (!requests.erase(key)) answered.insert(key);
        } else if (r.kind == rec::Kind::request && !answered.erase(key) && wanted(r) && r.read(message_)) {
            requests[key] = dictOf(r);
        }
    });
    for (auto& [name, s] : sources_) {
        if (!s.look || (s.lost > s.found && s.lost >= *s.look)) continue;
        for (auto& m : s.missing)
            if (m.last >= *s.look)
                throw Unknown("what was under way at " + clockText(time) + " is not certain: " + std::to_string(m.records) + " records of " + name + " are missing, from " +
                              clockText(m.first) + " to " + clockText(m.last));
        for (auto& mark : s.underWay) {
            const Key key(name, mark.number);
            if (answered.contains(key) || requests.contains(key)) continue;
            fetch(mark.time, [&, &source = name](const Record& r) { return r.kind == rec::Kind::request && r.number == mark.number && r.source == source; }, [&](const Record& r) {
                if (wanted(r) && r.read(message_)) requests[key] = dictOf(r);
            });
        }
    }
    if (std::none_of(sources_.begin(), sources_.end(), [](auto& s) { return s.second.look.has_value(); }))
        throw Unknown("what was under way at " + clockText(time) + " is not in the recording: it has no requests of before");
    for (auto& [key, dict] : requests) sorma::appendListElement(out.text, dict);
}

// ---- the question ----

void History::answer(std::int64_t time, const std::vector<std::string>& q, const std::function<bool(std::string_view)>& mayTell, sorma::Message& out) {
    need(time);
    sources_.clear();
    auto is = [&](std::size_t n, std::initializer_list<const char*> words) {
        std::size_t i = 1;
        for (auto* w : words)
            if (i >= q.size() || q[i++] != w) return false;
        return q.size() == n;
    };
    const auto at = q.empty() ? std::string::npos : q[0].find('@');
    Subject subject{q.empty() ? std::string() : q[0].substr(0, at), at == std::string::npos ? std::string() : q[0].substr(at + 1)};
    const std::string reader = "shmem_r.";
    if (q.size() <= 2 && !q.empty() && q[0] == "underway") return underWay(q.size() == 2 ? q[1] : "*", time, mayTell, out);
    const bool buffers = q.size() == 2 && (q[0] == "buffer" || (q[1] == "EXEC" && q[0].starts_with(reader)));
    if (buffers) subject.name = q[0] == "buffer" ? q[1] : q[0].substr(reader.size());
    if (mayTell && !mayTell(subject.name)) throw Unknown("you may not inspect " + subject.name);
    if (buffers) return buffer(subject.name, time, out);
    if ((is(3, {"cget"}) || is(4, {"DBX", "-get"})) && q.back().empty()) throw Unknown("the name of the option is empty");
    if (is(3, {"cget"}) || is(4, {"DBX", "-get"})) {
        out.text = valuesOf(subject, q.back(), time)[0].value;
    } else if (is(2, {"configure"})) {
        for (auto& [option, value, since] : valuesOf(subject, {}, time)) sorma::appendListElement(out.text, option), sorma::appendListElement(out.text, value);
    } else if (is(3, {"DBX", "-dump"})) {
        for (auto& [option, value, since] : valuesOf(subject, {}, time)) {
            out.text += (out.text.empty() ? "" : "\n") + option;
            sorma::appendWord(out.text, value);
        }
    } else if (is(3, {"DBX", "-trail"})) {
        trail(subject, time, out);
    } else {
        std::string all;
        for (auto& word : q) sorma::appendWord(all, word, true);
        throw Unknown("a recording cannot answer " + sorma::shown(all) +
                      ": ask NAME cget -option, NAME configure, NAME DBX -get -option, NAME DBX -dump, NAME DBX -trail, buffer KEY, or underway ?PATTERN?");
    }
}

}  // namespace recorder
