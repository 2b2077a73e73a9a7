#include "bus/service.h"

#include "bus/call.h"
#include "bus/serviceParts.h"

namespace sorma {

namespace {

const Prototype kRemoved{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};
const Prototype kLater{Severity::error, "SERVICE FAILED", 1, "{}: it answers later, and so cannot be a step that others wait for"};
const Prototype kTooLate{Severity::error, "COMM TIMEOUT", 1, "{}: the deadline had passed before the request was started; it was not executed"};
const Prototype kNoWords{Severity::error, "REQUEST SYNTAX", 1, "{}: {} needs at least one word, try -help"};
const Prototype kLockedBy{Severity::error, "SERVICE LOCKED", 1, "{}: locked by {} since {}; it is freed by CTRL -unlock there, or when that client ends"};

}  // namespace

Service::Service() = default;
Service::~Service() = default;

std::vector<Pin> Service::pins(std::string_view, std::size_t) const {
    std::vector<Pin> out;
    auto add = [&](const std::vector<Part>& parts, bool input) {
        for (auto& p : parts)
            if (p.field == Field::floats)
                out.push_back({input ? "in" : "out", input, 0, p.count.low == p.count.high ? p.count.low : Pin::kOpen, p.unit, p.help});
    };
    add(class_->reads(), true);
    add(class_->writes(), false);
    return out;
}

std::vector<Reference> Service::parts() const {
    std::vector<Reference> out;
    for (auto& o : class_->options()) {
        if (o.type != Type::service) continue;
        if (Service* s = sorm_->find(std::get<std::string>(o.get(*this)))) out.emplace_back(s);
    }
    return out;
}

// Make the data now that both threads may read.
void Service::setRealtimeOwner(RealtimeOwner* owner) {
    record();
    realtimeOwner_ = owner;
    setGuard(kOwnedBit, owner != nullptr);
    judgeParts();
}

// A step that cannot be taken as it is.
void Service::unusable(Message& m) {
    if (!m.later) fail(kCode, name_, m.code);
    if (!realtimeOwner_) return awaitLater(m);
    std::exchange(m.later, nullptr)->cancel(Trail());
    fail(kLater, name_);
}

Service::Record& Service::record() {
    if (!record_) {
        record_ = std::make_unique<Record>();
        record_->sources.resize(class_->options().size());
    }
    return *record_;
}

void Service::failGone() const { fail(kRemoved, name_); }

// ---- rights ----

// Check the author's right to the request. For CTRL and DBX each word is checked when it is read.
void Service::admit(Method method, Message& m) {
    if (isElsewhere()) return;
    if (method != Method::exec) return;
    try {
        need(m.author, class_->execRight());
    } catch (const Error& e) {
        noteFailure(e.trail);
        throw;
    }
    if (m.author && !class_->doesActOnWords()) m.author.reset();
}

void Service::need(const PrincipalPointer& author, Right right) {
    Access& access = sorm_->access;
    if (!author && !access.restricted()) return;
    std::uint64_t principal = author ? author->serial() : 0;
    if (known_.epoch != access.epoch() || known_.principal != principal)
        known_ = {principal, access.epoch(), access.rights(author, name_)};
    if (!(known_.rights & Rights(right))) access.refuse(author, right, name_, name_);
}

std::vector<Service::NamedPart> Service::namedParts() const {
    std::vector<NamedPart> out;
    for (auto& o : class_->options())
        if (o.type == Type::service)
            if (auto name = std::get<std::string>(o.get(*this)); !name.empty()) out.push_back({std::move(name), author(o.name)});
    return out;
}

void Service::needParts() const {
    for (auto& part : namedParts()) sorm_->needUse(part.author, part.name, name_);
}

// Nothing is asked within a tick: while a cycle runs the object, it keeps what it has.
void Service::judgeParts() {
    bool denied = false;
    try {
        if (!realtimeOwner_ && record_)
            for (auto& part : namedParts()) denied |= !sorm_->mayUse(part.author, part.name);
    } catch (const Error&) {                // no such place any more: EXEC will say so
        denied = true;
    }
    setGuard(kPartsBit, denied);
}

const PrincipalPointer& Service::author(std::string_view option) const {
    static const PrincipalPointer owner;
    int index = class_->findOption(option);
    return record_ && index >= 0 ? record_->sources[std::size_t(index)].author : owner;
}

void Service::assign(const Option& option, const Value& value, const PrincipalPointer& author) {
    if (!option.refer) return option.set(*this, value);
    option.refer(*this, subService(*this, std::get<std::string>(value), author));
}

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
    if (m.author) [[unlikely]] admit(method, m);
    return guard() ? startGuarded(method, m) : proceed(method, m);
}

// The reasons why a request may not run now.
bool Service::startGuarded(Method method, Message& m) {
    if (gone()) failGone();
    if ((guard() & kAskBit) && !m.author) admit(method, m);
    // CTRL prepares while ticks go on, see configure().
    std::optional<BetweenTicks> between;
    if (realtimeOwner_ && method != Method::ctrl) between.emplace(*this);
    if (method == Method::exec && (guard() & kPartsBit)) needParts();
    if (method == Method::exec && (guard() & kLockedBit)) checkLock();
    if (method == Method::exec && (guard() & kBusyBit)) return enqueue(m), true;
    return proceed(method, m);
}

void Service::invoke(Method method, Message& m) {
    if (start(method, m)) [[unlikely]] awaitLater(m);
}

// By reference, parts that an earlier call has left in the message are no part of the request, and are ignored.
void Service::invokeInPlace(Message& m) {
    class_->dropUndeclared(m);
    invoke(Method::exec, m);
}

void Service::awaitLater(Message& m) {
    Future future(std::exchange(m.later, nullptr));
    m.swap(future.wait());
}

// ---- requests that take their time ----

Reply Service::later(Message& m) {
    auto pending = std::make_shared<Pending>(*sorm_, CallContext::currentDeadline(), nullptr, CallContext::keep());
    pending->who = name_;
    pending->service = Reference(this);
    pending->message.swap(m);
    m.later = pending;
    ++record().underWay;
    if (class_->concurrency() != Concurrency::concurrent) setGuard(kBusyBit, true);
    return Reply(std::move(pending));
}

void Service::enqueue(Message& m) {
    auto pending = std::make_shared<Pending>(*sorm_, CallContext::currentDeadline(), nullptr, CallContext::keep());
    pending->who = name_;
    pending->message.swap(m);
    m.later = pending;
    record().waiting.push_back(std::move(pending));
}

void Service::released() {
    auto& r = record();
    if (--r.underWay > 0 || class_->concurrency() == Concurrency::concurrent) return;
    setGuard(kBusyBit, false);
    Reference keep(this);
    while (!(guard() & (kBusyBit | kGoneBit)) && !r.waiting.empty()) {
        auto next = std::move(r.waiting.front());
        r.waiting.pop_front();
        perform(next, Method::exec);
    }
}

// A request that stands for itself, with nobody on the stack who waits for it.
void Service::perform(const PendingPointer& pending, Method method) {
    if (pending->answered()) return;
    if (pending->deadline.passed()) return pending->answer(Trail(makeEntry(kTooLate, {MessageArg::of(name_)})));
    if (!pending->own) {
        auto& asker = pending->asker;
        pending->own = std::make_shared<KeptCall>(pending->client(), pending->deadline, pending->number(),
                                                  asker ? asker->behalf : std::string());
    }
    CallContext context(pending->own);
    Message m;
    m.swap(pending->message);
    try {
        if (!start(method, m)) {
            pending->message.swap(m);
            return pending->answer();
        }
        auto inner = std::exchange(m.later, nullptr);
        // Not held: each would keep the other one, for ever when the SORM ends before the answer.
        pending->onCancel([weak = std::weak_ptr(inner)] {
            if (auto p = weak.lock()) Future(p).cancel();
        });
        inner->whenAnswered([pending, from = inner.get()] {
            if (from->failed()) return pending->answer(from->failure);
            pending->message.swap(from->message);
            pending->answer();
        });
    } catch (...) {
        pending->answer(trailOfCurrentException(name_));
    }
}

Future Service::async(Method method, Message request, Deadline deadline) {
    auto asker = CallContext::keep();
    const Deadline most = CallContext::current() ? CallContext::deadlineForCalls(monotonicNow()) : Deadline();
    auto pending = std::make_shared<Pending>(*sorm_, (deadline.none() ? patience() : deadline).earlier(most),
                                             asker, nullptr);
    if (asker) asker->begun(pending);
    pending->who = name_;
    pending->message = std::move(request);
    try {
        carry(pending, method);
    } catch (...) {
        pending->answer(trailOfCurrentException(name_));
    }
    return Future(std::move(pending));
}

void Service::carry(const PendingPointer& pending, Method method) {
    pending->mailbox->post([pending, method, self = Reference(this)] { self->perform(pending, method); });
    if (pending->deadline.none() || pending->deadline.when() == INT64_MAX || !sorm_->hasLoop()) return;
    pending->timer = sorm_->loop().after(pending->deadline.when(), [weak = std::weak_ptr(pending)] {
        if (auto p = weak.lock()) p->expire();
    });
}

void Service::oneway(Method method, Message request) {
    if (method == Method::exec && (checks_ & Class::undeclared)) class_->checkNamed(name_, request);
    async(method, std::move(request));
}

void Service::left() {
    setGuard(kGoneBit, true);
    Reference keep(this);
    std::optional<BetweenTicks> between;
    bool hangs = false;
    try {
        between.emplace(*this);
    } catch (const Error&) {
        hangs = true;
    }
    leave(hangs);
}

// hangs: its real-time owner is in the middle of it, for ever perhaps. What is under way there cannot be ended.
void Service::leave(bool hangs) {
    if (guard() & kLockedBit) {
        auto& lock = record().lock;
        if (lock.holder) lock.holder->release(lock.lease);
        setGuard(kLockedBit, false);
    }
    if (record_) {
        for (auto& pending : std::exchange(record_->waiting, {})) pending->answer(Trail(makeEntry(kRemoved, {MessageArg::of(name_)})));
    }
    if (hangs) return;
    try {
        removing();
    } catch (...) {                     // no caller could get the error
    }
    stream_.reset();
}

std::size_t Service::underWay() const { return record_ ? record_->underWay + record_->waiting.size() : 0; }

void Service::subscribe(Subscriber* subscriber, std::string pattern) {
    if (gone()) failGone();
    if (!stream_) stream_ = std::make_unique<Stream>();
    std::vector<std::string> words{pattern, subscriber->who()};
    stream_->add(subscriber, std::move(pattern));
    if (sorm_) sorm_->announceLater("subscription.opened", name_, std::move(words));
}

void Service::replay(Subscriber* subscriber, std::string_view pattern) const {
    if (stream_) stream_->replay(*this, subscriber, pattern);
}

void Service::publishState(std::string_view event, const Message& m) {
    if (!stream_) stream_ = std::make_unique<Stream>();
    stream_->publish(*this, event, m);
}

void Service::unsubscribe(Subscriber* subscriber) {
    if (stream_ && stream_->remove(subscriber) && sorm_) sorm_->announceLater("subscription.closed", name_, {});
}

namespace {

class LocalListening : public Listening, public Subscriber {
public:
    // latest: it begins with the last one of those that have been published before.
    LocalListening(Reference object, const std::string& pattern, std::shared_ptr<Inbox> inbox, bool latest)
        : object_(std::move(object)), inbox_(std::move(inbox)) {
        object_->subscribe(this, pattern);
        if (latest) object_->replay(this, pattern);
    }
    ~LocalListening() override {
        inbox_->close();
        if (object_) object_->unsubscribe(this);
    }
    void event(const Event& e) override {
        inbox_->push({std::string(e.object), std::string(e.name), e.message, ++number_, 0, e.time, e.request});
    }
    void gone() override {
        Reference was = std::exchange(object_, Reference());
        inbox_->push({was->name(), "sorma.gone", {}, ++number_, 0, wallNow()});
    }

private:
    Reference object_;
    std::shared_ptr<Inbox> inbox_;
    std::uint64_t number_ = 0;
};

}  // namespace

std::unique_ptr<Listening> Service::listen(std::string pattern, std::size_t keep, Listener listener) {
    auto inbox = std::make_shared<Inbox>(sorm_->mailbox(), keep, std::move(listener));
    return std::make_unique<LocalListening>(Reference(this), pattern, std::move(inbox), keep == 1);
}

// ---- locks: a client keeps others from EXEC and from setting options; what stops or inspects stays open to all ----

void Service::checkLock() const {
    auto& lock = record_->lock;
    if (lock.holder != CallContext::currentClient()) fail(kLockedBy, name_, lock.by, clockText(lock.since));
}

void Service::enter(Method method, Message& m) {
    if (method == Method::exec) [[likely]] {
        const std::uint8_t checks = checks_;
        if (checks & Class::undeclared) class_->checkNamed(name_, m);
        count();
        if ((calls() & 63) == 1) [[unlikely]] timed(method, m);
        else exec(m);
        if (m.later) [[unlikely]] return;
        if ((checks & Class::replies) && m.code == 0) class_->checkReply(name_, m);
        if (!m.words.empty()) m.words.clear();      // words go in, never out
        if (m.code < 0) [[unlikely]] fail(kCode, name_, m.code);
        return;
    }
    if (m.words.empty()) fail(kNoWords, name_, toText(method));
    if (method == Method::ctrl) {
        ++record().ctrls;
        ctrl(m);
    } else {
        ++record().dbxs;
        dbx(m);
    }
    m.words.clear();
}

// The clock costs as much as the call, so only one call in 64 pays for it.
void Service::timed(Method, Message& m) {
    std::int64_t start = monotonicNow();
    exec(m);
    record().times.add(monotonicNow() - start);
}

void Service::noteFailure(const Trail& trail) {
    Record& r = record();
    ++r.errors;
    r.trail = trail;
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
        record().trail = m.trail;
        sorm_->announce(m.trail);
        if (m.code == 0 && std::any_of(entries.begin(), entries.end(), [](auto& e) { return e.severity != Severity::verbose; }))
            m.code = 1;
    }
}

}  // namespace sorma
