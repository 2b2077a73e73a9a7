#include "recording/recorder.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <utility>

#include "bus/call.h"
#include "bus/deadline.h"
#include "bus/glob.h"
#include "bus/monitor.h"
#include "bus/signalsBlocked.h"
#include "bus/sorm.h"
#include "bus/stream.h"
#include "recording/look.h"

namespace sorma::recording {

namespace {

// Read again when the thread may have waited in between.
std::int64_t wallOffset() {
    std::int64_t offset = 0, narrowest = INT64_MAX;
    for (int i = 0; i < 10; ++i) {
        timespec t;
        const std::int64_t before = monotonicNow();
        clock_gettime(CLOCK_REALTIME, &t);
        const std::int64_t took = monotonicNow() - before;
        if (took >= narrowest) continue;
        narrowest = took;
        offset = std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec - before - took / 2;
    }
    return offset;
}

}  // namespace

bool fits(const std::string& pattern, std::string_view name) { return pattern == "*" || globMatch(pattern, name); }

// The same without the values of secret options, also where a request is inside of a part.
Message masked(const Sorm& sorm, const Message& m) {
    Message out = m;
    out.later = nullptr;
    out.words = sorm.masked(std::move(out.words));
    out.text = sorm.masked(std::move(out.text));
    if (std::string any(out.any.begin(), out.any.end()), safe = sorm.masked(any); safe != any) out.any.assign(safe.begin(), safe.end());
    for (auto& entry : out.trail.entries()) {
        entry.details = sorm.masked(std::move(entry.details));
        entry.request = sorm.masked(std::move(entry.request));
        entry.text = sorm.masked(std::move(entry.text));
    }
    return out;
}

namespace {

// All that is told of a message which may hold any secret.
Message hidden(const Message& m) {
    Message out;
    out.text = kMask;
    out.code = m.code;
    if (auto* cause = m.code < 0 ? m.trail.cause() : nullptr) {
        Entry bare;
        bare.severity = cause->severity, bare.symbol = cause->symbol, bare.time = cause->time;
        bare.text = kMask;
        out.trail.add(std::move(bare));
    }
    return out;
}

}  // namespace

Recorder::Recorder(Sorm& sorm, Selection selection, Sink sink)
    : Observer((selection.requests.empty() ? 0 : all) | (selection.requests.empty() && selection.events.empty() ? 0 : events)), sorm_(sorm), selection_(std::move(selection)),
      allRequests_(selection_.requests == "*" && !selection_.author), offset_(wallOffset()), sink_(std::move(sink)) {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] { run(); });
    sorm_.observers.add(this);
    if (wishes) look();
}

void Recorder::stop() {
    if (!active_) return;
    active_ = false;
    sorm_.observers.remove(this);
    {
        std::lock_guard lock(mutex_);
        stop_ = true;
    }
    work_.notify_one();
    thread_.join();
    alive_.reset();
}

Recorder::Figures Recorder::figures() const {
    std::lock_guard lock(mutex_);
    return figures_;
}

std::int64_t Recorder::now() const { return monotonicNow() + offset_; }

// ---- on the SORM's thread ----

bool recordable(std::string_view object, const Sorm& sorm, const PrincipalPointer& author) {
    return !author || (object != "sorm" && object != "dict" && tellable(std::string(object), sorm, author));
}

bool Recorder::mayTell(std::string_view object) const {
    return object != selection_.without && recordable(object, sorm_, selection_.author);
}

bool Recorder::wants(const Passage& p) const {
    return (allRequests_ || fits(selection_.requests, p.object)) && mayTell(p.object);
}

void Recorder::add(const Facts& facts, const Message& m) {
    try {
        std::lock_guard lock(mutex_);
        if (std::exchange(resting_, false)) work_.notify_one();
        if (!block_.add(facts, &m)) return lose(large, {facts.kind != Kind::state, facts.time, facts.time, facts.kind == Kind::state});
        if (facts.kind == Kind::loss) figures_.lost += facts.number;        // where they come from
        if (facts.kind == Kind::sample) buffers_.insert_or_assign(std::string(facts.object), Mark{facts.number, facts.time});
        if (!block_.full()) [[likely]] return;
        sinceLook_ += block_.size();
        if (wishes && sinceLook_ > mostUnlooked()) lookDue_.store(true, std::memory_order_relaxed);       // the thread may be behind
        if (waiting_.size() >= kWaiting) {
            lose(slow, {block_.records() - block_.states(), block_.first(), block_.last(), block_.states()});
            return block_.clear();
        }
        waiting_.push_back(std::move(block_));
        block_ = Block();
        if (!spares_.empty()) block_ = std::move(spares_.back()), spares_.pop_back();
        work_.notify_one();
    } catch (const std::bad_alloc&) {
        std::lock_guard lock(mutex_);
        lose(memory, {1, facts.time, facts.time});
    }
}

// A request that comes from outside begins a call; all that is done in its course has the same number of the call.
From Recorder::origin(const Passage& p) {
    if (!CallContext::currentClient()) return From::process;
    const std::uint64_t call = CallContext::currentRequest();
    if (!calls_.insert(call).second) return From::inside;
    open_.emplace(p.number, call);
    return From::outside;
}

// A reader with a trigger looks at values ten times a second: that would fill its own file.
bool Recorder::isOfReader(const Passage& p) const {
    return p.object == "sorm" && p.method == Method::dbx && !selection_.reader.empty() && CallContext::currentCaller().toText() == selection_.reader;
}

void Recorder::came(const Passage& p, const Message& m) {
    if (!wants(p)) return;
    if (isOfReader(p)) return void(leftOut_.insert(p.number));
    const bool local = !CallContext::current();         // then the text of the caller is always the same
    static const std::string self = Caller::self().toText();
    const auto from = local ? From::process : origin(p);
    const Facts facts{Kind::request, p.method, selection_.source, p.object, local ? self : p.callers(), int(from), p.begun + offset_, p.number};
    beginRequest(p.number, facts.time);
    if (!sorm_.hasSecrets()) [[likely]] return add(facts, m);
    const bool awaits = p.method == Method::ctrl && p.service && sorm_.awaitsSecrets(p.service->name());
    add(facts, awaits ? hidden(m) : masked(sorm_, m));
}

void Recorder::answered(const Passage& p, const Message& m, std::int64_t ran) {
    if (!leftOut_.empty() && leftOut_.erase(p.number)) return;
    if (!open_.empty())
        if (auto found = open_.find(p.number); found != open_.end()) calls_.erase(found->second), open_.erase(found);
    endRequest(p, m, p.begun + ran + offset_);
    if (!wants(p)) return;
    const Facts facts{Kind::reply, p.method, selection_.source, p.object, {}, m.code, p.begun + ran + offset_, p.number, ran};
    if (!sorm_.hasSecrets()) [[likely]] return add(facts, m);
    const bool tells = p.method != Method::exec || p.object == "sorm" || p.object == "dict";
    Service* object = tells ? sorm_.find(p.object) : nullptr;
    add(facts, object && sorm_.holdsSecrets(*object) ? hidden(m) : masked(sorm_, m));
}

void Recorder::published(const Event& e) {
    if (e.object == "sorm") tellChange(e);
    if (!fits(selection_.events, e.object) || e.object == selection_.without || concealed(e, sorm_, selection_.author)) return;
    if (e.object != "sorm" && !mayTell(e.object)) return;
    const Facts facts{Kind::event, {}, selection_.source, e.object, e.name, e.message.code, now(), e.serial};
    if (sorm_.hasSecrets()) add(facts, masked(sorm_, e.message));
    else add(facts, e.message);
}

// With the lock.
void Recorder::lose(Why why, const Loss& loss) {
    Loss& all = losses_[why];
    const bool none = all.records + all.states == 0;
    all.first = none ? loss.first : std::min(all.first, loss.first);
    all.last = none ? loss.last : std::max(all.last, loss.last);
    all.records += loss.records;
    all.states += loss.states;
    lookAgain_ |= loss.states > 0;
    figures_.lost += loss.records;
}

// ---- on the recorder's thread ----

void Recorder::run() {
    const std::chrono::nanoseconds rest(selection_.lookTime > 0 ? std::min(selection_.lookTime, kRest) : kRest);
    const auto due = [this] { return stop_ || asked_ != done_ || !waiting_.empty(); };
    int quiet = 0;
    for (std::unique_lock lock(mutex_);;) {
        resting_ = quiet >= kQuiet;
        if (resting_) work_.wait_for(lock, rest, [&] { return !resting_ || due(); });
        resting_ = false;
        work_.wait_for(lock, std::chrono::nanoseconds(kFlush), due);
        const bool last = stop_;
        const std::uint64_t asked = asked_;
        const std::int64_t upTo = now();
        std::deque<Block> blocks = std::exchange(waiting_, {});
        if (!block_.empty() && (blocks.empty() || last || asked != done_)) {
            sinceLook_ += block_.size();
            blocks.push_back(std::move(block_));
            block_ = Block();
        }
        quiet = blocks.empty() && asked == done_ ? quiet + 1 : 0;
        lock.unlock();
        for (auto& block : blocks) {
            giveLosses();
            give(block);
        }
        // While losses are not told, not all has been given.
        const bool told = giveLosses();
        Block none;
        give(none, told ? upTo : kUnknown);
        judgeLook();
        lock.lock();
        done_ = asked;
        flushed_.notify_all();
        for (auto& block : blocks)
            if (spares_.size() < 2) spares_.push_back(std::move(block));
        if (last) return;
    }
}

// The block is empty then.
void Recorder::give(Block& block, std::int64_t upTo) {
    const Loss all{block.records() - block.states(), block.first(), block.last(), block.states()};
    std::string error;
    try {
        sink_(block, upTo);
    } catch (const std::exception& e) {
        error = e.what();
        block.clear();
    }
    std::lock_guard lock(mutex_);
    if (error.empty()) figures_.records += all.records;
    else if (all.records + all.states > 0) figures_.error = error, lose(refused, all);
}

// A record for each reason. False: the sink does not take these; they are told later.
bool Recorder::giveLosses() {
    std::array<Loss, kWhys> losses{};
    {
        std::lock_guard lock(mutex_);
        losses.swap(losses_);
    }
    Block block;
    for (int why = 0; why < kWhys; ++why)
        if (auto& loss = losses[why]; loss.records + loss.states > 0)
            block.add({.kind = Kind::loss, .source = selection_.source, .word = kReasons[why], .code = int(loss.states), .time = loss.first, .number = loss.records, .span = loss.last - loss.first});
    try {
        if (!block.empty()) sink_(block, kUnknown);
        return true;
    } catch (const std::exception&) {
    }
    std::lock_guard lock(mutex_);
    for (int why = 0; why < kWhys; ++why) {
        figures_.lost -= losses[why].records;           // counted before
        if (losses[why].records + losses[why].states > 0) lose(Why(why), losses[why]);
    }
    return false;
}

}  // namespace sorma::recording
