#include "bus/request.h"

#include <algorithm>

#include "bus/call.h"
#include "bus/kept.h"
#include "bus/serviceParts.h"
#include "bus/span.h"

namespace sorma {

namespace {

const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};
const Prototype kNoWords{Severity::error, "REQUEST SYNTAX", 1, "{}: {} needs at least one word, try -help"};

}  // namespace

// ---- rights ----

// Check the author's right to the request. For CTRL and DBX each word is checked when it is read.
void Service::admit(Method method, Message& m) {
    if (isElsewhere()) return;
    if (method != Method::exec) return;
    try {
        need(m.author, class_->execRight());
        if (isDangerous(m)) need(m.author, Right::operate);
        if (!class_->wordKinds().empty()) needWords(m.author, m.words);
    } catch (const Error& e) {
        noteFailure(e.trail);
        throw;
    }
    if (m.author && !class_->doesActOnWords()) m.author.reset();
}

Permit Service::need(const PrincipalPointer& author, Right right) {
    Access& access = sorm_->access;
    if (!author && !access.restricted()) return Permit::owner();
    std::uint64_t principal = author ? author->serial() : 0;
    if (known_.epoch != access.epoch() || known_.principal != principal)
        known_ = {principal, access.epoch(), access.rights(author, name_)};
    if (!(known_.rights & Rights(right))) access.refuse(author, right, name_, name_);
    return Access::known(known_.rights, name_);
}

// ---- the way of a request ----

// Inline: one call less in each request.
[[gnu::always_inline]] inline bool Service::proceed(Method method, Message& m) {
    try {
        enter(method, m);
    } catch (...) {
        if (m.later) std::exchange(m.later, nullptr)->finish();     // taken over, and then refused
        Trail trail = trailOfCurrentException(name_);
        noteFailure(trail);
        throw Error(std::move(trail));
    }
    if (m.later) [[unlikely]] return true;
    if (!m.trail.empty()) [[unlikely]] review(m);
    return false;
}

bool Service::start(Method method, Message& m) {
    if (guard() || method != Method::exec || isSample()) [[unlikely]] return startGuarded(method, m);
    if (m.author) [[unlikely]] admit(method, m);
    return proceed(method, m);
}

// Those that somebody may want to observe, or that may not run at once.
bool Service::startGuarded(Method method, Message& m) {
    if (RealtimeOwner::current()) return startHeld(method, m);
    Observers& observers = sorm_->observers;
    if ((guard() & kObservedBit) && !observers.any()) setGuard(kObservedBit, false);        // not any more
    const Observer::Wish kind = method == Method::ctrl ? Observer::ctrl : method == Method::dbx ? Observer::dbx : Observer::sample;
    const auto wishes = std::uint8_t(Observer::all | (kind != Observer::sample || isSample() ? kind : 0));
    if (!observers.any(wishes)) return startHeld(method, m);
    Observation seen(observers, {this, name_, method, wishes}, m);
    SpanScope span(name_, method, isElsewhere());
    try {
        if (startHeld(method, m)) return span.later(*m.later), seen.later(m.later), true;
    } catch (...) {
        Trail trail = trailOfCurrentException(name_);
        span.failed(trail);
        seen.failed(trail);
        throw Error(std::move(trail));
    }
    seen.answered(m);
    return false;
}

void Service::needFence(const PrincipalPointer& author) {
    try {
        sorm_->fences.need(name_, author);
    } catch (const Error& e) {
        noteFailure(e.trail);
        throw;
    }
}

// What is wrong with an EXEC is told before it is told that it may not run now: waiting would not help.
void Service::checkArguments(const Message& m) {
    if (!(checks_ & Class::undeclared)) return;
    try {
        class_->checkNamed(name_, m);
    } catch (const Error&) {
        Trail trail = trailOfCurrentException(name_);
        noteFailure(trail);
        throw Error(std::move(trail));
    }
}

// The reasons why a request may not run now.
bool Service::startHeld(Method method, Message& m) {
    const bool fenced = (guard() & kFencedBit) && method != Method::dbx;
    const PrincipalPointer author = fenced ? m.author : nullptr;        // admit() may take it away
    if (m.author) admit(method, m);
    if (gone()) failGone();
    if ((guard() & kAskBit) && !m.author) admit(method, m);
    if (fenced) needFence(author);
    if (method == Method::exec) checkArguments(m);
    // CTRL prepares while ticks go on, see configure().
    std::optional<BetweenTicks> between;
    if (realtimeOwner_ && method != Method::ctrl) between.emplace(*this);
    if (method == Method::exec && (guard() & kPartsBit)) needParts();
    if (method == Method::exec && (guard() & kLockBits)) checkLock();
    if (method == Method::exec && (guard() & kBusyBit)) return enqueue(m), true;
    return proceed(method, m);
}

void Service::invoke(Method method, Message& m) {
    if (start(method, m)) [[unlikely]] awaitLater(m);
}

void Service::failCode(int code) const { fail(kCode, name_, code); }

void Service::enter(Method method, Message& m) {
    if (method == Method::exec) [[likely]] {
        const std::uint8_t checks = checks_;
        if (checks & Class::undeclared) class_->checkNamed(name_, m);
        count();
        exec(m);
        if (m.later) [[unlikely]] return;
        if ((checks & Class::replies) && m.code == 0) class_->checkReply(name_, m);
        if (!m.words.empty()) m.words.clear();      // words go in, never out
        if (m.code < 0) [[unlikely]] failCode(m.code);
        return;
    }
    if (m.words.empty()) fail(kNoWords, name_, toText(method));
    if (method == Method::ctrl) ctrl(m);
    else dbx(m);
    m.words.clear();
}

// When the account of who has sent the request is full, only the cause is kept.
void Service::keepTrail(const Trail& trail) {
    auto account = sorm_->budget.ofCaller();
    const bool room = !account || account->fits(trail.entries().size() * 4 * kKeptText);
    const Entry* cause = trail.cause();
    record().trail = Charged<Trail>::forced(std::move(account), Account::Use::records, cutTrail(room || !cause ? trail : Trail(*cause)));
}

void Service::noteFailure(const Trail& trail) {
    ++record().errors;
    keepTrail(trail);
    sorm_->announce(trail);
}

void Service::review(Message& m) {
    if (m.trail.empty()) return;
    auto& entries = m.trail.entries();
    for (auto& e : entries)
        if (e.so.empty()) e.so = name_;
    auto tooQuiet = [&](const Entry& e) {
        return (e.severity == Severity::verbose && verbosity_ < 2) || (e.severity == Severity::warning && verbosity_ < 1);
    };
    std::erase_if(entries, tooQuiet);
    if (!entries.empty()) {
        keepTrail(m.trail);
        sorm_->announce(m.trail);
        if (m.code == 0 && std::any_of(entries.begin(), entries.end(), [](auto& e) { return e.severity != Severity::verbose; }))
            m.code = 1;
    }
}

// ---- observers ----

void Observers::add(Observer* observer) {
    list_.push_back(observer);
    wishes_ |= observer->wishes;
    if (observer->wishes & (Observer::all | Observer::events)) sorm_.markObserved();
}

// Objects lose their mark with the next request.
void Observers::remove(Observer* observer) {
    if (auto found = std::find(list_.begin(), list_.end(), observer); found != list_.end()) list_.erase(found);
    wishes_ = 0;
    for (auto* o : list_) wishes_ |= o->wishes;
}

void Observers::refused(std::string_view name, Method method, const Message& request, const Trail& why) {
    if (any()) Observation(*this, {nullptr, name, method, Observer::all}, request).failed(why);
}

// Each that wants it. The list may change meanwhile.
template <class F> static void tell(const std::vector<Observer*>& list, const Passage& passage, F f) {
    for (std::size_t i = 0; i < list.size(); ++i)
        if (list[i]->wishes & passage.wishes) f(*list[i]);
}

// An event of a tick, which has another thread, is not observed.
void Observers::published(const Event& event) {
    if (!any(Observer::events) || RealtimeOwner::current()) return;
    for (std::size_t i = 0; i < list_.size(); ++i)
        if (list_[i]->wishes & Observer::events) list_[i]->published(event);
}

const std::string& Passage::callers() const {
    if (callersText.empty()) callersText = CallContext::currentCallers();
    return callersText;
}

Observation::Observation(Observers& observers, Passage&& passage, const Message& request) : observers_(observers), passage_(std::move(passage)) {
    passage_.number = ++observers_.number_;
    passage_.begun = monotonicNow();
    tell(observers_.list_, passage_, [&](Observer& o) { o.came(passage_, request); });
}

void Observation::answered(const Message& reply) {
    const std::int64_t ran = monotonicNow() - passage_.begun;
    tell(observers_.list_, passage_, [&](Observer& o) { o.answered(passage_, reply, ran); });
}

void Observation::failed(const Trail& why) {
    Message m;
    m.code = -1;
    m.trail = why;
    answered(m);
}

// The object may be removed meanwhile, and the SORM may end. The one who answers has another context than the one who asked.
void Observation::later(const PendingPointer& pending) {
    if (passage_.wishes & observers_.wishes_ & ~Observer::sample) passage_.callers();
    pending->whenAnswered([&observers = observers_, passage = passage_, name = std::string(passage_.object), p = pending.get()] {
        if (!p->mailbox->owner) return;
        Observation again(observers, passage, name);
        if (p->failed()) again.failed(p->failure);
        else again.answered(p->message);
    });
}

// That request, when it is answered later.
Observation::Observation(Observers& observers, Passage passage, std::string_view name) : observers_(observers), passage_(std::move(passage)) {
    passage_.object = name;
    if (observers_.sorm_.find(name) != passage_.service) passage_.service = nullptr;
}

}  // namespace sorma
