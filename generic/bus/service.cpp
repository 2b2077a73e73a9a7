#include "bus/service.h"

#include <algorithm>

#include "bus/call.h"
#include "bus/serviceParts.h"
#include "bus/lateSpans.h"
#include "bus/span.h"

namespace sorma {

namespace {

const Prototype kRemoved{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const Prototype kLater{Severity::error, "SERVICE FAILED", 1, "{}: it answers later, and so cannot be a step that others wait for"};
const Prototype kTooLate{Severity::error, "COMM TIMEOUT", 1, "{}: the deadline had passed before the request was started; it was not executed"};

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
        if (o.type != Type::service || !o.spec.part) continue;
        if (Service* s = sorm_->find(std::get<std::string>(o.value(*this, Permit::owner())))) out.emplace_back(s);
    }
    return out;
}

void addTree(const Service& object, std::unordered_set<const Service*>& tree) {
    std::vector<const Service*> waiting{&object};
    while (!waiting.empty()) {
        const Service* next = waiting.back();
        waiting.pop_back();
        if (!tree.insert(next).second) continue;
        for (auto& part : next->parts()) waiting.push_back(&*part);
    }
}

bool Service::hasDangerousPart() const {
    const auto own = parts();
    if (own.empty()) return false;
    std::unordered_set<const Service*> tree{this};
    for (auto& part : own) addTree(*part, tree);
    return std::any_of(tree.begin(), tree.end(), [this](auto* s) { return s != this && s->class_->isDangerous(); });
}

bool Service::isDangerous() const { return class_->isDangerous() || hasDangerousPart(); }
bool Service::isDangerous(const Message& m) const { return class_->isDangerous(m) || hasDangerousPart(); }

bool Service::holdsSecrets() const {
    return std::any_of(class_->options().begin(), class_->options().end(), [](auto& o) { return o.spec.secret; });
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
    if (!m.later) failCode(m.code);
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

// ---- the rights that values of some types carry, and the objects that it uses by name ----

bool Service::mayKeepValues() const {
    for (auto& o : class_->options()) {
        auto& by = author(o.name);
        if (!by || o.type != Type::text) continue;
        const auto value = std::get<std::string>(o.value(*this, Permit::owner()));
        auto needed = rightOf(o.kindOf(value), value, name_);
        if (needed && !(sorm_->access.rights(by, needed->subject) & Rights(needed->right))) return false;
    }
    return true;
}

void Service::needWords(const PrincipalPointer& author, std::span<const std::string> words) const {
    for (auto& word : class_->wordKinds())
        if (word.at < words.size() && (word.verb.empty() || words[0] == word.verb)) needKind(author, word.kind, words[word.at]);
}

bool Service::execWord(Message& m) {
    for (auto& word : class_->wordKinds())
        if (word.body && m.words.size() == 2 && m.words[0] == word.verb) return word.body(*this, m), true;
    return false;
}

std::vector<Service::NamedPart> Service::namedParts() const {
    std::vector<NamedPart> out;
    for (auto& o : class_->options())
        if (o.type == Type::service)
            if (auto name = std::get<std::string>(o.value(*this, Permit::owner())); !name.empty()) out.push_back({std::move(name), author(o.name)});
    return out;
}

void Service::needParts() const {
    for (auto& part : namedParts()) sorm_->needUse(part.author, part.name, name_);
    for (auto& o : class_->options()) {
        if (o.type != Type::text) continue;
        const auto value = std::get<std::string>(o.value(*this, Permit::owner()));
        needKind(author(o.name), o.kindOf(value), value);
    }
}

// Nothing is asked within a tick: while a cycle runs the object, it keeps what it has.
void Service::judgeParts() {
    bool denied = false;
    try {
        if (!realtimeOwner_ && record_)
            for (auto& part : namedParts()) denied |= !sorm_->mayUse(part.author, part.name);
        if (!realtimeOwner_ && record_) denied |= !mayKeepValues();
    } catch (const Error&) {                // no such place any more: EXEC will say so
        denied = true;
    }
    setGuard(kPartsBit, denied);
}

const PrincipalPointer& Service::author(std::string_view option) const {
    static const PrincipalPointer owner;
    int index = class_->findOption(option);
    return record_ && index >= 0 ? record_->sources[std::size_t(index)]->author : owner;
}

void Service::assign(const Option& option, const Value& value, const PrincipalPointer& author) {
    if (option.entrust) {
        auto& text = std::get<std::string>(value);
        return option.entrust(*this, text, option.kindOf(text) == Kind::plain ? nullptr : author);
    }
    if (!option.refer) return option.set(*this, value);
    option.refer(*this, subService(*this, std::get<std::string>(value), author));
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
        if (next) perform(next, Method::exec, true);
        else if (r.streams) r.streams->nextTurn();
    }
}

// A request that stands for itself, with nobody on the stack who waits for it.   again: it was started before, and had to wait.
void Service::perform(const PendingPointer& pending, Method method, bool again) {
    if (pending->answered()) return;
    if (pending->deadline.passed()) return pending->answer(Trail(makeEntry(kTooLate, {MessageArg::of(name_)})));
    if (!pending->own) {
        auto& asker = pending->asker;
        pending->own = std::make_shared<KeptCall>(pending->client(), pending->deadline, pending->number(),
                                                  asker ? asker->behalf : std::string());
        pending->own->span = pending->span;
    }
    CallContext context(pending->own);
    Message m;
    m.swap(pending->message);
    try {
        if (again ? !startHeld(method, m) : !start(method, m)) {
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

// A call that goes on beside its caller: it has a span until it is answered.
static void traceLater(const SpanPointer& caller, Method method, const PendingPointer& pending) {
    pending->span = caller->door && caller->name == pending->who ? caller : caller->call(pending->who, method);
    if (!pending->span) return;
    pending->span->door = true;
    pending->whenAnswered([span = pending->span, p = pending.get()] { span->finish(p->failed() ? &p->failure : nullptr); });
}

Future Service::async(Method method, Message request, Deadline deadline, bool bound) {
    auto asker = CallContext::keep();
    const Deadline most = CallContext::current() ? CallContext::deadlineForCalls(monotonicNow()) : Deadline();
    auto pending = std::make_shared<Pending>(*sorm_, (deadline.none() ? patience() : deadline).earlier(most),
                                             asker, nullptr);
    if (asker) asker->begun(pending);
    pending->who = name_;
    pending->message = std::move(request);
    pending->bound = bound;
    if (CallContext::current() && CallContext::current()->span) traceLater(CallContext::current()->span, method, pending);
    try {
        carry(pending, method);
    } catch (...) {
        pending->answer(trailOfCurrentException(name_));
    }
    Future future(std::move(pending));
    if (asker && asker->cancelled()) future.cancel();       // no cancellation comes any more
    return future;
}

void Service::carry(const PendingPointer& pending, Method method) {
    pending->mailbox->post([pending, method, self = Reference(this)] { self->perform(pending, method); });
    if (sorm_->hasLoop()) pending->expireBy(sorm_->loop());
}

void Service::oneway(Method method, Message request) {
    if (method == Method::exec && (checks_ & Class::undeclared)) class_->checkNamed(name_, request);
    const LeaveScope left(*sorm_, name_, method);
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

// hangs: its real-time owner is in the middle of it, for ever perhaps. A request that is under way there cannot be ended.
void Service::leave(bool hangs) {
    if (guard() & kLockedBit) {
        auto& lock = record().lock;
        if (lock.holder) lock.holder->release(lock.lease);
        setGuard(kLockedBit, false);
    }
    if (record_) {
        for (auto& pending : std::exchange(record_->waiting, {}))
            if (pending) pending->answer(Trail(makeEntry(kRemoved, {MessageArg::of(name_)})));
    }
    if (hangs) return;
    if (record_ && record_->streams) record_->streams->endAll(Trail(makeEntry(kRemoved, {MessageArg::of(name_)})));
    try {
        removing();
    } catch (...) {                     // no caller could get the error
    }
    stream_.reset();
}

std::size_t Service::underWay() const { return record_ ? record_->underWay + record_->waiting.size() : 0; }

void Service::subscribe(Subscriber* subscriber, std::string pattern, const Permit& permit) {
    permit.check(Right::inspect, name_);
    if (gone()) failGone();
    if (!stream_) stream_ = std::make_unique<Stream>();
    std::vector<std::string> words{pattern, subscriber->who()};
    stream_->add(subscriber, std::move(pattern));
    if (!sorm_) return;
    sorm_->listenersChanged(*this);
    sorm_->announceLater("subscription.opened", name_, std::move(words));
}

void Service::replay(Subscriber* subscriber, std::string_view pattern, const Permit& permit) const {
    permit.check(Right::inspect, name_);
    if (stream_) stream_->replay(*this, subscriber, pattern);
}

void Service::publishState(std::string_view event, const Message& m) {
    if (!stream_) stream_ = std::make_unique<Stream>();
    stream_->publish(*this, event, m);
}

void Service::unsubscribe(Subscriber* subscriber) {
    if (!stream_ || !stream_->remove(subscriber) || !sorm_) return;
    sorm_->listenersChanged(*this);
    sorm_->announceLater("subscription.closed", name_, {});
}

namespace {

class LocalListening : public Listening, public Subscriber {
public:
    // latest: it begins with the last one of those that have been published before.
    LocalListening(Reference object, const std::string& pattern, std::shared_ptr<Inbox> inbox, bool latest)
        : object_(std::move(object)), inbox_(std::move(inbox)) {
        object_->subscribe(this, pattern, Permit::owner());
        if (latest) object_->replay(this, pattern, Permit::owner());
    }
    ~LocalListening() override {
        inbox_->close();
        if (object_) object_->unsubscribe(this);
    }
    void event(const Event& e) override {
        inbox_->push({std::string(e.object), std::string(e.name), e.message, ++number_, 0, e.time, e.request, e.origin});
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

}  // namespace sorma
