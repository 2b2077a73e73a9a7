// Locks of objects whose class is exclusive: a client keeps others from EXEC and from setting options, for a time. All may
// still stop and inspect it.
#include "bus/serviceParts.h"

namespace sorma {

namespace {

const Prototype kNotLocked{Severity::error, "SERVICE LOCKED", 1, "{}: this client holds no lock of it"};
const Prototype kLockedBy{Severity::error, "SERVICE LOCKED", 1,
    "{}: locked by {} since {}, until {}; it is freed by CTRL -unlock there, or when that client ends; its owner may break it: CTRL -unlock break"};
const Prototype kEnded{Severity::error, "SERVICE UNLOCKED", 1, "{}: the lock of this client has ended: {}; lock it again"};
const Prototype kLease{Severity::error, "OPTION RANGE", 2, "{}: {} {} is outside 1 .. 3600 s"};
const Prototype kBreak{Severity::error, "OPTION UNKNOWN", 2, "{}: unknown word \"{}\": must be break, after -unlock"};

constexpr std::int64_t kDefaultLease = 60;      // [s]
constexpr std::int64_t kLongestLease = 3600;
constexpr std::size_t kMostFormer = 16;         // holders that are still to be told

std::string clockAfter(std::int64_t seconds) { return clockText(wallNow() + seconds * 1'000'000); }

}  // namespace

// Other clients are told by an event; a holder that has not ended it itself by its next request, which is refused.
void CommonRequests::endLock(Service& s, const std::string& why, bool told) {
    auto& r = s.record();
    auto was = std::exchange(r.lock, {});
    s.setGuard(Service::kLockedBit, false);
    if (was.holder) was.holder->release(was.lease);
    if (!told) {
        std::erase_if(r.formerHolders, [](auto& f) { return !f.local && f.client.expired(); });
        if (r.formerHolders.size() == kMostFormer) r.formerHolders.erase(r.formerHolders.begin());
        r.formerHolders.push_back({was.holder, !was.holder, why});
        s.setGuard(Service::kFormerBit, true);
    }
    Message event;
    event.text = why;
    event.words = {was.by};
    s.publish("lock.ended", event);
}

void CommonRequests::lock(Service& s, Args args, Message& reply) {
    std::int64_t seconds = kDefaultLease;
    if (!args.empty() && (!parseNumber(args[0], seconds) || seconds < 1 || seconds > kLongestLease)) fail(kLease, s.name(), "-lock", args[0]);
    auto& r = s.record();
    const auto client = CallContext::currentClient();
    if (s.guard() & Service::kLockedBit) {
        s.checkLock();                              // it may have run out
        if (r.lock.holder) r.lock.holder->release(r.lock.lease);
    }
    std::erase_if(r.formerHolders, [&](auto& f) { return f.is(client); });
    s.setGuard(Service::kFormerBit, !r.formerHolders.empty());
    auto& lock = r.lock;
    if (!(s.guard() & Service::kLockedBit)) {
        lock.by = CallContext::currentCallers();
        lock.since = wallNow();
    }
    lock.holder = client;
    lock.until = clockAfter(seconds);
    lock.ends = monotonicNow() + seconds * 1'000'000'000;
    s.setGuard(Service::kLockedBit, true);
    if (s.sorm().hasLoop()) lock.timer = s.sorm().loop().after(lock.ends, [&s] { s.expireLock(); });
    if (client)
        lock.lease = client->hold(s.name(), [self = Reference(&s)] {
            if (!(self->guard() & Service::kLockedBit)) return;
            const bool ended = self->record().lock.holder->ended();
            CommonRequests::endLock(*self, ended ? "its holder has ended" : "the policy does not allow it any more", ended);
        }, Right::configure);
    Message event;
    event.text = "until " + lock.until;
    event.words = {lock.by};
    s.publish("lock.taken", event);
    addLine(reply, "locked by " + lock.by + " until " + lock.until);
}

void CommonRequests::unlock(Service& s, Args args, Message& reply) {
    if (!args.empty() && args[0] != "break") fail(kBreak, s.name(), args[0]);
    s.expireLock();
    if (!(s.guard() & Service::kLockedBit)) fail(kNotLocked, s.name());
    auto& lock = s.record().lock;
    const std::string who = CallContext::currentCallers();
    if (lock.holder == CallContext::currentClient()) return endLock(s, "unlocked by " + who, true);
    if (args.empty()) s.checkLock();
    s.sorm().access.need(reply.author, Right::policy, "policy", s.name());
    addLine(reply, "broke the lock of " + lock.by + ", held since " + clockText(lock.since));
    endLock(s, "broken by " + who + " at " + clockAfter(0), false);
}

void Service::expireLock() {
    if (!(guard() & kLockedBit) || monotonicNow() < record_->lock.ends) return;
    CommonRequests::endLock(*this, "it ran out at " + record_->lock.until, false);
}

// May the present client call it and set its options?
void Service::checkLock() {
    expireLock();
    auto client = CallContext::currentClient();
    auto& former = record_->formerHolders;
    auto at = std::find_if(former.begin(), former.end(), [&](auto& f) { return f.is(client); });
    if (at != former.end() && !RealtimeOwner::current()) {
        std::string why = std::move(at->why);
        former.erase(at);
        setGuard(kFormerBit, !former.empty());
        fail(kEnded, name_, why);
    }
    auto& lock = record_->lock;
    if ((guard() & kLockedBit) && lock.holder != client) fail(kLockedBy, name_, lock.by, clockText(lock.since), lock.until);
}

}  // namespace sorma
