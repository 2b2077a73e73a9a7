#include "recording/look.h"

#include <algorithm>
#include <chrono>

#include "bus/deadline.h"
#include "bus/glob.h"
#include "bus/realtimeOwner.h"
#include "bus/stream.h"
#include "recording/recorder.h"

namespace sorma::recording {

// ---- on the SORM's thread ----

bool Recorder::tracks(std::string_view object) const {
    return (fits(selection_.requests, object) || fits(selection_.events, object)) && mayTell(object);
}

void Recorder::addState(State state, std::string_view object, std::string_view word, Message& m, std::int64_t time, std::int64_t span) {
    const Facts facts{Kind::state, {}, selection_.source, object, word, int(state), time, 0, span};
    lookSize_ += sizeof(RecordHead);
    for (auto& w : m.words) lookSize_ += sizeof(std::uint32_t) + w.size();
    if (sorm_.hasSecrets()) add(facts, masked(sorm_, m));
    else add(facts, m);
}

void Recorder::tellWhole(std::string_view object) {
    Service* s = sorm_.find(object);
    if (!s || s->isElsewhere() || s->name() != object || !tracks(object)) return;
    Message m;
    try {
        const BetweenTicks between(*s);
        for (auto& o : s->type().options()) {
            m.words.push_back(o.name);
            m.words.push_back(o.spec.secret ? std::string(kMask) : toText(o.value(*s, Permit::owner())));
        }
    } catch (const std::exception&) {       // its tick is stuck: it is told with the next look
        return;
    }
    if (auto trail = trails_.find(s->name()); trail != trails_.end()) m.ints = {std::int64_t(trail->second.number), trail->second.time};
    addState(State::whole, object, s->type().name(), m, now());
}

// An event of sorm, which may tell that an object is another one now.
void Recorder::tellChange(const Event& e) {
    const std::string& object = e.message.text;
    if (e.name == "object.made") return tellWhole(object);
    const bool gone = e.name == "object.removed";
    if (gone) trails_.erase(object);
    if ((!gone && e.name != "object.changed") || !tracks(object)) return;
    Message m;
    // Its words are the name, options with their values, and by whom.
    if (!gone && e.message.words.size() > 3) m.words.assign(e.message.words.begin() + 1, e.message.words.end() - 1);
    addState(gone ? State::gone : State::told, object, {}, m, now());
}

void Recorder::beginRequest(std::uint64_t number, std::int64_t time) { underWay_.push_back({number, time}); }

// Mostly it is the last one that has come. Others are marked, and leave when nothing older is under way.
void Recorder::endRequest(const Passage& p, const Message& reply, std::int64_t time) {
    auto found = std::lower_bound(underWay_.begin(), underWay_.end(), p.number, [](const Mark& m, std::uint64_t n) { return m.number < n; });
    if (found != underWay_.end() && found->number == p.number) found->time = 0;
    while (!underWay_.empty() && underWay_.back().time == 0) underWay_.pop_back();
    while (!underWay_.empty() && underWay_.front().time == 0) underWay_.pop_front();
    if (!reply.trail.empty() && p.service && !p.service->isElsewhere()) trails_.insert_or_assign(std::string(p.object), Mark{p.number, time});
    if (lookDue_.load(std::memory_order_relaxed)) [[unlikely]] look();
}

// One slice of a look, or its beginning.
void Recorder::look() {
    lookDue_ = false;
    if (!active_) return;
    const std::int64_t until = monotonicNow() + kSlice;
    Message m;
    if (lookBegan_ == 0) {
        lookBegan_ = now();
        toLook_ = sorm_.names();
        looked_ = 0;
        lookSize_ = 0;
        std::erase_if(underWay_, [](auto& mark) { return mark.time == 0; });
        for (auto& mark : underWay_) m.ints.insert(m.ints.end(), {std::int64_t(mark.number), mark.time});
        addState(State::look, {}, std::string(kLook) + selection_.source, m, lookBegan_);
    }
    while (looked_ < toLook_.size()) {
        tellWhole(toLook_[looked_++]);
        if (looked_ % 16 == 0 && monotonicNow() > until) return askForLook();
    }
    const std::int64_t end = now();
    m.clear();
    addState(State::looked, {}, std::string(kLooked) + selection_.source, m, end, end - lookBegan_);
    lookBegan_ = 0;
    toLook_.clear();
    std::lock_guard lock(mutex_);
    lookBytes_ = lookSize_;
    sinceLook_ = 0;
    lookDue_ = false;
    lookEnded_ = monotonicNow();
}

void Recorder::lookAtAll() {
    const auto until = monotonicNow() + 10 * kSlice;
    if (!wishes) return;
    do look();
    while (lookBegan_ != 0 && monotonicNow() < until);
}

// ---- any thread ----

void Recorder::tellEnd() { add({Kind::state, {}, selection_.source, {}, {}, int(State::end), now()}, Message()); }

// With the next answer, or when the loop has its turn.
void Recorder::askForLook() {
    lookDue_ = true;
    sorm_.mailbox()->post([weak = std::weak_ptr<Recorder*>(alive_)] {
        if (auto self = weak.lock(); self && (*self)->lookDue_) (*self)->look();
    });
}

// ---- on the recorder's thread ----

// Bytes of records between two looks. With the lock.
std::size_t Recorder::mostUnlooked() const {
    const std::size_t bytes = std::max(kLookBytes, 4 * lookBytes_);
    return selection_.lookBytes > 0 ? std::min(bytes, selection_.lookBytes) : bytes;
}

void Recorder::judgeLook() {
    bool due = false;
    {
        std::lock_guard lock(mutex_);
        const std::int64_t passed = monotonicNow() - lookEnded_;
        constexpr std::int64_t kAgain = 1'000'000'000, kPerByte = 50'000;        // [ns]: looks of a quiet process are 20 kB/s at most
        const std::int64_t time = std::max(kLookTime, kPerByte * std::int64_t(lookBytes_));
        due = sinceLook_ > mostUnlooked() || passed > (selection_.lookTime > 0 ? std::min(time, selection_.lookTime) : time) || (lookAgain_ && passed > kAgain);
        if (!due || stop_) return;
        lookAgain_ = false;
        // Until it has ended no other one is due.
        sinceLook_ = 0;
        lookEnded_ = monotonicNow();
    }
    tellBuffers();
    if (wishes) askForLook();
}

void Recorder::tellBuffers() {
    std::map<std::string, Mark, std::less<>> newest;
    {
        std::lock_guard lock(mutex_);
        newest = buffers_;
    }
    Message m;
    for (auto& [key, mark] : newest) {
        m.ints = {std::int64_t(mark.number), mark.time};
        add({Kind::state, {}, selection_.source, key, {}, int(State::buffer), now()}, m);
    }
}

bool Recorder::flush() {
    const std::uint64_t mine = push();
    std::unique_lock lock(mutex_);
    return flushed_.wait_for(lock, std::chrono::seconds(1), [&] { return done_ >= mine || stop_; });
}

std::uint64_t Recorder::push() {
    std::lock_guard lock(mutex_);
    work_.notify_one();
    return ++asked_;
}

}  // namespace sorma::recording
