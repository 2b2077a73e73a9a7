#include "bus/reply.h"

#include "bus/catalogue.h"
#include "bus/service.h"
#include "bus/sorm.h"
#include "bus/statistics.h"

namespace sorma {

namespace {

const Prototype kDropped{Severity::error, "SERVICE FAILED", 1, "{}: the service has ended the request without an answer"};
const Prototype kOther{Severity::error, "SERVICE FAILED", 1, "{}: {}"};
const Prototype kCancelled{Severity::error, "COMM CANCELLED", 1, "{}: the call was cancelled by its caller; it may have run"};
const Prototype kPassed{Severity::error, "COMM TIMEOUT", 1, "{}: no answer in time; the request goes on"};
const Prototype kOverdue{Severity::error, "COMM TIMEOUT", 1, "{}: no answer by the deadline; the service was told to stop"};
const Prototype kEnded{Severity::error, "SERVICE GONE", 1, "{}: the SORM has ended"};
const Prototype kNotYet{Severity::error, "FUTURE PENDING", 1, "{}: the answer is not there yet; use wait, or then"};
const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};

}  // namespace

Pending::Pending(Sorm& sorm, Deadline deadline, KeptCallPointer asker, KeptCallPointer own)
    : deadline(deadline), asker(std::move(asker)), own(std::move(own)), mailbox(sorm.mailbox()) {}

const ClientPointer& Pending::client() const {
    static const ClientPointer thisProcess;
    return own ? own->client : asker ? asker->client : thisProcess;
}

std::uint64_t Pending::number() {
    if (own) return own->request;
    if (asker) return asker->request;
    if (number_ == 0) number_ = CallContext::newRequest();
    return number_;
}

Pending::~Pending() = default;

void Pending::answer() {
    if (answered_) return;
    if (service && message.code == 0 && (service->checks_ & Class::replies)) {
        try {
            service->class_->checkReply(who, message);
        } catch (const Error& e) {
            return answer(e.trail);
        }
    }
    if (service) service->review(message);
    if (message.code < 0) {
        Trail trail = std::move(message.trail);
        if (trail.cause() == nullptr || trail.cause()->severity != Severity::error)
            trail.add(makeEntry(kCode, {MessageArg::of(who), MessageArg::of(message.code)}));
        return answer(std::move(trail));
    }
    runCallbacks();
}

void Pending::answer(Trail trail) {
    if (answered_) return;
    for (auto& e : trail.entries())
        if (e.so.empty()) e.so = who;
    if (service) service->noteFailure(trail);
    failure = std::move(trail);
    runCallbacks();
}

void Pending::runCallbacks() {
    answered_ = true;
    timer.cancel();
    if (asker && sent != 0) asker->subTime += static_cast<std::uint32_t>((monotonicNow() - sent) / 1000);
    charge.clear();
    onCancel_ = nullptr;
    auto callbacks = std::move(whenAnswered_);
    auto keep = shared_from_this();
    for (auto& callback : callbacks) callback();
}

void Pending::whenAnswered(std::function<void()> callback) {
    if (answered_) return callback();
    whenAnswered_.push_back(std::move(callback));
}

bool Pending::cancel(Trail why) {
    if (answered_) return false;
    auto keep = shared_from_this();
    cancelled_.store(true, std::memory_order_relaxed);
    auto tell = std::exchange(onCancel_, nullptr);
    answer(std::move(why));             // first: what the service has to say of it comes too late
    if (carrier) carrier->cancelled(*this);
    if (own) own->cancel();
    if (tell) (*tell)();
    return true;
}

void Pending::expire() { cancel(carrier ? carrier->overdue(*this) : Trail(makeEntry(kOverdue, {MessageArg::of(who)}))); }

void Pending::expireBy(Loop& loop) {
    if (deadline.none() || deadline.when() == INT64_MAX) return;
    timer = loop.after(deadline.when(), [weak = weak_from_this()] {
        if (auto p = weak.lock()) p->expire();
    });
}

void Pending::onCancel(std::function<void()> callback) {
    if (cancelled()) return callback();
    onCancel_ = std::make_unique<std::function<void()>>(std::move(callback));
}

void Pending::finish() {
    Reference owner = std::move(service);
    service = Reference();
    if (owner) owner->released();
}

// ---- the service's side ----

struct Reply::Promise {
    PendingPointer pending;
    std::atomic<bool> kept{false};
    explicit Promise(PendingPointer p) : pending(std::move(p)) {}
    ~Promise() {
        if (!kept) keep(Trail(makeEntry(kDropped, {MessageArg::of(pending->who)})));
    }
    // Hand the result over to the SORM's thread. The mailbox's lock orders it.
    void keep(Trail failure) {
        if (kept.exchange(true)) return;
        auto& box = *pending->mailbox;
        box.post([p = pending, failure = std::move(failure)]() mutable {
            if (failure.empty()) p->answer();
            else p->answer(std::move(failure));
            p->finish();
        });
    }
};

Reply::Reply(PendingPointer pending) : promise_(std::make_shared<Promise>(std::move(pending))) {}

Message& Reply::message() const { return promise_->pending->message; }
void Reply::complete() const { promise_->keep({}); }
void Reply::fail(const std::exception& error) const {
    if (auto* ours = dynamic_cast<const Error*>(&error)) return promise_->keep(ours->trail);
    std::string what = error.what();
    promise_->keep(Trail(makeEntry(kOther, {MessageArg::of(promise_->pending->who), MessageArg::of(what)})));
}
bool Reply::cancelled() const { return promise_->pending->cancelled(); }
void Reply::onCancel(std::function<void()> callback) const { promise_->pending->onCancel(std::move(callback)); }
void Reply::ask(const Reference& object, Message request, std::function<void(Message&)> then, const Trail& context) const {
    Future under = object->async(Method::exec, std::move(request));
    onCancel([under] { under.cancel(); });
    under.then([reply = *this, then = std::move(then), context](Future answered) {
        try {
            then(answered.result());
        } catch (const Error& e) {
            Trail trail = e.trail;
            trail.append(context);
            reply.fail(Error(std::move(trail)));
        } catch (const std::exception& e) {
            reply.fail(e);
        }
    });
}
bool Reply::answered() const { return promise_->pending->answered(); }
Deadline Reply::deadline() const { return promise_->pending->deadline; }
const ClientPointer& Reply::client() const { return promise_->pending->client(); }

// ---- the caller's side ----

Message& Future::wait(Deadline deadline) const {
    Pending& p = *pending_;
    Deadline end = deadline.earlier(p.deadline);
    while (!p.answered()) {
        p.mailbox->run();
        if (p.answered()) break;
        Sorm* sorm = p.mailbox->owner;
        if (!sorm) fail(kEnded, p.who);
        if (end.passed()) {
            if (!p.deadline.passed()) fail(kPassed, p.who);
            p.expire();
            break;
        }
        if (p.carrier) p.carrier->drive(p, end);
        else sorm->turn(end);
    }
    return result();
}

Message& Future::result() const {
    Pending& p = *pending_;
    if (!p.answered()) fail(kNotYet, p.who);
    if (p.failed()) throw Error(p.failure);
    return p.message;
}

bool Future::cancel() const { return pending_->cancel(Trail(makeEntry(kCancelled, {MessageArg::of(pending_->who)}))); }

void Future::then(std::function<void(Future)> callback) const {
    pending_->whenAnswered([callback = std::move(callback), p = pending_.get()] {
        p->mailbox->post([callback, keep = p->shared_from_this()] { callback(Future(keep)); });
    });
}

}  // namespace sorma
