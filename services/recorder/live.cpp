#include "live.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <utility>

namespace recorder {

namespace rec = sorma::recording;

// ---- the writer ----

LivePieces::LivePieces(sorma::Sorm& sorm, rec::Selection selection, All all) : sorm_(sorm), selection_(std::move(selection)), all_(std::move(all)) {
    all_->insert(this);
}

LivePieces::~LivePieces() { all_->erase(this); }

void LivePieces::take(rec::Block& block, std::int64_t upTo) {
    if (block.empty() && upTo == rec::Recorder::kUnknown) return;
    {
        std::lock_guard lock(mutex_);
        if (block.empty() && !blocks_.empty()) {
            blocks_.back().upTo = upTo;
        } else {
            if (blocks_.size() >= kMost) throw rec::FileError("the reader is too slow");
            blocks_.push_back({block.finish(0, number_), upTo, number_});
            ++number_;
        }
    }
    block.clear();
    wake();
}

bool LivePieces::next(sorma::Message& piece, std::size_t) {
    // The first piece is empty: so the reader learns that it is recorded from now on.
    const bool first = !recorder_;
    if (first) recorder_ = std::make_unique<rec::Recorder>(sorm_, selection_, [this](rec::Block& block, std::int64_t upTo) { take(block, upTo); });
    const std::int64_t offset = recorder_->now() - sorma::monotonicNow();
    if (first) return piece.ints = {0, offset, rec::Recorder::kUnknown}, true;
    std::lock_guard lock(mutex_);
    if (blocks_.empty()) return false;
    const Waiting& next = blocks_.front();
    piece.any.assign(next.bytes.begin(), next.bytes.end());
    piece.ints = {std::int64_t(next.number), offset, next.upTo};
    blocks_.pop_front();
    return true;
}

// ---- the reader ----

Merge::Merge(sorma::Sorm& sorm, const std::vector<std::string>& names, std::vector<std::string> request, const sorma::PrincipalPointer& author,
             rec::Recorder& to)
    : sorm_(sorm), request_(std::move(request)), author_(author), to_(to) {
    for (auto& name : names) {
        sources_.push_back(std::make_unique<Source>());
        sources_.back()->name = name;
    }
    for (auto& source : sources_) open(*source);
    turn();
}

Merge::~Merge() { stop(); }

void Merge::stop() {
    turn_.cancel();
    alive_.reset();
    for (auto& source : sources_) source->retry.cancel(), source->compare.cancel(), source->reading.reset();
    give(INT64_MAX);
}

std::size_t Merge::connected() const {
    return std::size_t(std::count_if(sources_.begin(), sources_.end(), [](auto& s) { return s->heard; }));
}

std::vector<std::pair<std::string, std::string>> Merge::away() const {
    std::vector<std::pair<std::string, std::string>> out;
    for (auto& source : sources_)
        if (!source->lost.empty()) out.emplace_back(source->name, source->lost);
    for (auto& [who, why] : out) std::replace_if(why.begin(), why.end(), [](unsigned char c) { return c < ' '; }, ' ');
    return out;
}

void Merge::open(Source& source) {
    try {
        source.clock.forget();
        source.ahead = 0, source.told = source.floor = source.newest = INT64_MIN;
        source.recorder = sorm_.get(source.name, author_, sorma::Probe::later);
        compare(source);
    } catch (const std::exception& e) {
        lose(source, e.what());
    }
}

void Merge::compare(Source& source) {
    sorma::Message request;
    request.words = {"now"};
    const std::int64_t sent = sorma::monotonicNow();
    source.recorder->async(sorma::Method::exec, std::move(request)).then([this, &source, sent, round = source.round, weak = std::weak_ptr<Merge*>(alive_)](const sorma::Future& answer) {
        if (weak.lock() && source.round == round) compared(source, sent, answer);
    });
}

void Merge::compared(Source& source, std::int64_t sent, const sorma::Future& answer) {
    const std::int64_t back = sorma::monotonicNow();
    try {
        const sorma::Message& m = answer.result();
        if (m.ints.size() != 1) throw std::runtime_error("what it answers is no time");
        const double then = double(m.ints[0]) * 1e-9;
        // After a step of one of the clocks, what was known is forgotten.
        if (!source.clock.add(timing::sampleOf({double(sent) * 1e-9, then, then, double(back) * 1e-9}))) source.told = INT64_MIN;
    } catch (const std::exception& e) {
        return lose(source, e.what());
    }
    setAhead(source);
    if (!source.reading && source.clock.samples() >= kCompares) begin(source);
    if (!source.recorder) return;           // it was lost meanwhile
    if (!source.reading) return compare(source);
    source.compare = sorm_.loop().after(back + kCompare, [this, &source] { compare(source); });
}

// Processes of one host have one clock: their difference is smaller than its error. Small changes are not followed.
void Merge::setAhead(Source& source) {
    const std::int64_t now = sorma::monotonicNow();
    const double mine = double(now) * 1e-9;
    const auto offset = std::int64_t(std::llround(source.clock.offset(mine) * 1e9)), bound = std::int64_t(std::ceil(source.clock.bound(mine) * 1e9));
    const std::int64_t known = source.ahead;
    if (std::abs(offset - known) > bound) {
        source.ahead = offset;
        constexpr std::int64_t kStep = 1'000'000'000;
        source.floor = std::abs(offset - known) < kStep ? source.newest : INT64_MIN;       // its records stay in their order
    }
    if (source.ahead == 0 || source.clock.samples() < kCompares || (source.told != INT64_MIN && now - source.told < kTellClock)) return;
    source.told = now;
    sorma::Message m;
    m.text = source.name;
    if (!source.daemon.empty()) m.words = {source.daemon};
    const std::int64_t wrong = bound + std::abs(offset - source.ahead);
    to_.add({.kind = rec::Kind::source, .source = source.name, .time = to_.now(), .number = std::uint64_t(wrong), .span = source.ahead}, m);
}

void Merge::begin(Source& source) {
    try {
        sorma::Message request;
        request.words = request_;
        source.reading = std::make_unique<sorma::Reading>(source.recorder, request, sorma::Reading::How{.most = sorma::Reading::kMostPiece, .ahead = 4});
        await(source);
    } catch (const std::exception& e) {
        lose(source, e.what());
    }
}

void Merge::await(Source& source) {
    source.reading->coming().then([this, &source, weak = std::weak_ptr<Merge*>(alive_)](const sorma::Future&) {
        if (weak.lock() && source.reading) take(source);
    });
}

void Merge::take(Source& source) {
    try {
        for (sorma::Message piece;;) {
            const auto taken = source.reading->take(piece);
            if (taken == sorma::Reading::Taken::notYet) {
                settle();
                return await(source);
            }
            if (taken == sorma::Reading::Taken::end) return lose(source, "its stream has ended");
            if (!source.lost.empty()) note(source, "found", source.name);
            source.lost.clear();
            source.heard = true;
            absorb(source, piece);
        }
    } catch (const std::exception& e) {
        lose(source, e.what());
    }
}

// The same reason again is no news.
void Merge::lose(Source& source, const std::string& why) {
    source.reading.reset();
    source.recorder = {};
    source.compare.cancel();
    ++source.round;
    source.heard = false;
    if (source.lost != why) note(source, "lost", why);
    source.lost = why;
    source.retry = sorm_.loop().after(sorma::monotonicNow() + kRetry, [this, &source] { open(source); });
}

void Merge::note(const Source& source, std::string_view what, const std::string& text) {
    sorma::Message m;
    m.text = text;
    if (!source.daemon.empty()) m.words = {source.daemon};
    to_.add({.kind = rec::Kind::note, .source = source.name, .word = what, .time = to_.now()}, m);
}

// Its bytes may be anything.
void Merge::absorb(Source& source, sorma::Message& piece) {
    constexpr std::size_t kMostHeld = 64 << 20;
    ++source.pieces;
    if (piece.ints.size() != 3) throw std::runtime_error("what it sends is no piece of a recording");
    const std::int64_t shift = to_.now() - sorma::monotonicNow() - piece.ints[1] - source.ahead;
    rec::BlockReader block(std::string(piece.any.begin(), piece.any.end()), 0, std::uint64_t(piece.ints[0]));
    for (rec::Record r; block.next(r);) {
        Held held{r, std::string(r.source), std::string(r.object), std::string(r.word), {}, r.content.size()};
        if (!r.read(held.message)) continue;
        if (source.daemon != r.source) source.daemon = r.source;
        held.facts.time = std::max(source.floor, std::int64_t(std::uint64_t(r.time) + std::uint64_t(shift)));
        source.newest = std::max(source.newest, held.facts.time);
        heldBytes_ += held.bytes;
        held_.emplace(held.facts.time, std::move(held));
    }
    if (!block.whole()) note(source, "broken", "a piece of its recording is broken behind its first records");
    if (piece.ints[2] != rec::Recorder::kUnknown) source.upTo = std::int64_t(std::uint64_t(piece.ints[2]) + std::uint64_t(shift));
    if (heldBytes_ > kMostHeld) give(INT64_MAX);
}

void Merge::give(std::int64_t until) {
    while (!held_.empty() && held_.begin()->first <= until) {
        Held& held = held_.begin()->second;
        held.facts.source = held.source, held.facts.object = held.object, held.facts.word = held.word;
        to_.add(held.facts, held.message);
        heldBytes_ -= held.bytes;
        held_.erase(held_.begin());
    }
}

// Up to which time do we have all that there is?
std::int64_t Merge::complete() const {
    std::int64_t all = INT64_MAX;
    for (auto& source : sources_)
        if (source->heard) all = std::min(all, source->upTo);
    return all;
}

void Merge::drain() {
    const std::int64_t now = to_.now();
    constexpr int kIdle = 2000, kMost = 60'000;         // [ms]
    const auto most = sorma::Deadline::in(kMost);
    std::uint64_t before = 0;
    for (auto idle = sorma::Deadline::in(kIdle); complete() < now && !idle.passed() && !most.passed();) {
        push();
        sorm_.turn(sorma::Deadline::in(50));
        std::uint64_t pieces = 1;
        for (auto& source : sources_)
            if (source->heard && source->upTo < now) pieces += source->pieces;
        if (std::exchange(before, pieces) != pieces) idle = sorma::Deadline::in(kIdle);
    }
    stop();
}

// Records whose order is known go to the file at once. They have waited for kFlush in their daemon already.
void Merge::settle() {
    const std::int64_t now = to_.now();
    const std::size_t before = held_.size();
    give(std::max(now - kHold, std::min(now, complete())));
    if (held_.size() != before) to_.push();
    if (!held_.empty()) push();
}

// Ask those that rest. A recorder of before does not know the word, and does not rest.
void Merge::push() {
    const std::int64_t late = to_.now() - rec::Recorder::kFlush * 5 / 4;
    for (auto& source : sources_) {
        if (!source->heard || source->upTo >= late || source->pushed >= late) continue;
        source->pushed = to_.now();
        sorma::Message request;
        request.words = {"push"};
        source->recorder->async(sorma::Method::exec, std::move(request)).then([](const sorma::Future&) {});
    }
}

void Merge::turn() {
    settle();
    turn_ = sorm_.loop().after(sorma::monotonicNow() + kTurn, [this] { turn(); });
}

}  // namespace recorder
