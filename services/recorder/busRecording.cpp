#include "busRecording.h"

#include <bus/glob.h>
#include <bus/listText.h>

#include <algorithm>
#include <cmath>

#include "history.h"

namespace recorder {

namespace rec = sorma::recording;

namespace {

const char* toText(rec::Kind kind) {
    switch (kind) {
        case rec::Kind::source: return "source";
        case rec::Kind::request: return "request";
        case rec::Kind::reply: return "reply";
        case rec::Kind::event: return "event";
        case rec::Kind::shape: return "shape";
        case rec::Kind::sample: return "sample";
        case rec::Kind::loss: return "loss";
        default: return "note";
    }
}

}  // namespace

std::string seconds(std::int64_t ns) {
    constexpr std::int64_t kBillion = 1'000'000'000;
    const std::string digits = std::to_string(std::abs(ns % kBillion));
    return (ns < 0 ? "-" : "") + std::to_string(std::abs(ns / kBillion)) + "." + std::string(9 - digits.size(), '0') + digits;
}

std::string textOf(const rec::Record& r, sorma::Message& m) {
    if (!r.read(m)) m.text = "its parts cannot be read";
    std::string text;
    if (r.kind == rec::Kind::request) {
        sorma::appendRequest(text, r.object, r.method.value_or(sorma::Method::exec), m);
    } else if (r.kind == rec::Kind::reply) {
        sorma::appendReply(text, r.object, m);
    } else {
        sorma::appendParts(text, m);
        for (auto& word : m.words) sorma::appendWord(text, word, true);
    }
    return text;
}

std::string dictOf(const rec::Record& r, const std::string& text, const std::string& request) {
    sorma::DictText dict;
    dict.put("kind", toText(r.kind));
    dict.put("time", seconds(r.time));
    dict.put("source", r.source);
    dict.put("number", std::to_string(r.number));
    dict.put("object", r.object);
    dict.put("word", r.word);
    if (r.method) dict.put("method", sorma::toText(*r.method));
    dict.put("code", std::to_string(r.code));
    dict.put("span", seconds(r.span));
    dict.put("text", text);
    if (!request.empty()) dict.put("request", request);
    return dict.text();
}

std::string Search::read(const std::vector<std::string>& words, std::size_t at) {
    for (; at < words.size(); ++at) {
        const std::string& option = words[at];
        if (option == "-failed") {
            failed = true;
            continue;
        }
        const bool known = option == "-name" || option == "-text" || option == "-from" || option == "-until" || option == "-slower";
        if (!known) return "bad option " + sorma::shown(option) + ": must be -failed, -from, -name, -slower, -text, or -until";
        if (++at == words.size()) return "value for " + option + " is missing";
        const std::string& value = words[at];
        if (option == "-name") name = value;
        else if (option == "-text") text = value;
        else {
            constexpr double kMost = 9e9;       // [s]
            double number = 0;
            std::int64_t exact = 0;
            // Times of a recording have more digits than a double.
            if (option != "-slower" && readSeconds(value, exact) && std::abs(exact) <= std::int64_t(kMost * 1e9)) {
                (option == "-from" ? from : until) = exact;
                continue;
            }
            if (!sorma::parseNumber(value, number) || !(std::abs(number) <= kMost)) return option + " expects a number of seconds, got " + sorma::shown(value);
            (option == "-from" ? from : option == "-until" ? until : slower) = std::int64_t(std::llround(number * 1e9));
        }
    }
    return {};
}

// By the index, where there is one: what is not named in a section is not in it.
bool RecordText::mayHave(const rec::Section& s) const {
    if (s.last < search_.from || s.first > search_.until) return false;
    if (!s.named || search_.name == "*") return true;
    return std::any_of(s.names.begin(), s.names.end(), [&](auto n) { return sorma::globMatch(search_.name, reader_.names()[n]); });
}

void RecordText::next(std::string& out, std::size_t most) {
    for (; section_ < reader_.sections().size(); ++section_, begun_ = false) {
        if (!begun_ && !mayHave(reader_.sections()[section_])) continue;
        if (!begun_) reader_.seek(section_);
        begun_ = true;
        for (rec::Record r; reader_.next(r, section_ + 1);) {
            add(out, r);
            if (out.size() >= most) return;
        }
    }
}

void RecordText::await(Key key, std::string request) {
    const std::size_t size = request.size();
    if (!awaited_.emplace(key, std::move(request)).second) return;
    awaitedBytes_ += size;
    order_.push_back(std::move(key));
    while (awaitedBytes_ > kMostAwaited) {
        if (auto found = awaited_.find(order_.front()); found != awaited_.end()) awaitedBytes_ -= found->second.size(), awaited_.erase(found);
        order_.pop_front();
    }
    if (order_.size() > 2 * awaited_.size() + 1000) std::erase_if(order_, [&](auto& k) { return !awaited_.contains(k); });
}

void RecordText::add(std::string& out, const rec::Record& r) {
    if (r.time < search_.from || r.time > search_.until) return;
    if (r.kind == rec::Kind::state || (r.kind == rec::Kind::loss && r.number == 0)) return;         // for History
    const bool named = r.kind == rec::Kind::request || r.kind == rec::Kind::reply || r.kind == rec::Kind::event || r.kind == rec::Kind::sample || r.kind == rec::Kind::shape;
    if (named && search_.name != "*" && !sorma::globMatch(search_.name, r.object)) return;
    if (named && search_.mayTell && !search_.mayTell(r.object)) return;
    std::string request;
    const std::string text = textOf(r, message_);
    const Key key(r.source, r.number);
    if (r.kind == rec::Kind::request) await(key, text);
    if (auto found = awaited_.find(key); r.kind == rec::Kind::reply && found != awaited_.end()) {
        awaitedBytes_ -= found->second.size();
        request = std::move(found->second);
        awaited_.erase(found);
    }
    if ((search_.failed || search_.slower >= 0) && r.kind != rec::Kind::reply) return;
    if (search_.failed && r.code >= 0) return;
    if (r.span < search_.slower) return;
    if (!search_.text.empty() && text.find(search_.text) == text.npos && request.find(search_.text) == request.npos) return;
    sorma::appendListElement(out, dictOf(r, text, request));
}

std::string describe(const std::string& file, bool names) {
    const rec::Reader reader(file);
    std::uint64_t records = 0;
    std::int64_t first = 0, last = 0;
    bool any = false;
    for (auto& s : reader.sections()) {
        records += s.records - s.states;
        first = any ? std::min(first, s.first) : s.first;
        last = any ? std::max(last, s.last) : s.last;
        any = true;
    }
    sorma::DictText dict;
    std::string damages;
    for (auto& d : reader.damages()) sorma::appendListElement(damages, "byte " + std::to_string(d.at) + ": " + d.what);
    dict.put("began", seconds(reader.head().began));
    dict.put("closed", reader.closed() ? "1" : "0");
    dict.put("bytes", std::to_string(reader.bytes()));
    dict.put("records", std::to_string(records));
    dict.put("first", seconds(first));
    dict.put("last", seconds(last));
    if (names) {
        auto all = reader.names();
        std::erase_if(all, [](auto& name) { return name.starts_with(rec::kLook) || name.starts_with(rec::kLooked); });     // the recorder's own marks
        dict.put("names", sorma::listOf(all));
    }
    dict.put("damages", damages);
    return dict.text();
}

}  // namespace recorder
