// service.h -- a service object: what its author implements, and what every object gets from its class's table.
//
// Threads: a service object belongs to the thread of its SORM, or to one that executes it in ticks (bus/realtimeOwner.h).
// References are counted without locks.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/budget.h"
#include "bus/change.h"
#include "bus/dictionary.h"
#include "bus/message.h"
#include "bus/option.h"
#include "bus/pin.h"
#include "bus/realtimeOwner.h"
#include "bus/reference.h"
#include "bus/reply.h"
#include "bus/stream.h"

namespace sorma {

class Sorm;

class Service {
public:
    Service();
    virtual ~Service();
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    // ---- what an author implements ----

    // Do the job: the request comes in m, the result leaves in m. Throw (fail) to refuse; then the caller's message
    // is unspecified, the object's state must be as before. What takes long is taken over with later(m), see reply.h.
    virtual void exec(Message& m) = 0;

    // The recipe has been applied, the name is known; the object is about to be called for the first time.
    virtual void born() {}

    // Options are about to be set, while the object goes on with their present values, in a cycle perhaps: do here what takes
    // time. Called on the SORM's thread: change nothing that EXEC uses. What is returned is called between two ticks, when the
    // options have been set; it must be short. Throw to refuse. Not called for the recipe (see born).
    virtual Commit prepare(const Change& change) { return (void)change, nullptr; }

    // These options have new values. Short as well: no tick begins meanwhile, and what makes one late by more than a quarter of
    // its period is taken back (this is called again then). Throw to refuse: all of them are put back. Not called for the recipe.
    virtual void changed(std::span<const Option* const> options) { (void)options; }

    // Check yourself; throw what is wrong, or return a verdict in clear text.
    virtual std::string selftest() { return "ok"; }
    // The same, answering by itself: one more line of m.text. A check that takes its time is taken over with later(m).
    virtual void answerSelftest(Message& m);

    // The object has left the repository. End what is under way: replies that are still owed keep the object alive.
    virtual void leaving() {}

    // State that is not in the options, appended line by line as "# name value" for -dump.
    virtual void dumpState(std::string& out) const { (void)out; }

    // The pins by which a circuit wires it. pin, length: one of its pins has been found to have that many elements; a
    // class whose other lengths follow from it tells them then. From the signature, unless a class knows better.
    virtual std::vector<Pin> pins(std::string_view pin = {}, std::size_t length = Pin::kOpen) const;

    // Objects that it executes in its own EXEC, and whose real-time owner is its own: those of its options, unless it knows
    // better.
    virtual std::vector<Reference> parts() const;

    // Objects that it uses by a name, and who wrote it. When a change of the policy takes the right from him, EXEC is refused
    // until he has it again, or somebody sets another name. Those of its options, unless it knows better.
    struct NamedPart {
        std::string name;
        PrincipalPointer author;            // null: the owner
    };
    virtual std::vector<NamedPart> namedParts() const;

    // ---- requests with words; a proxy forwards them, others leave them as they are ----
    virtual void ctrl(Message& m);
    virtual void dbx(Message& m);
    virtual std::string location() const { return "self"; }
    // A proxy: others judge what is asked of it.
    virtual bool isElsewhere() const { return false; }

    // ---- what callers use ----
    const std::string& name() const { return name_; }
    const Class& type() const { return *class_; }
    Sorm& sorm() const { return *sorm_; }
    bool gone() const { return guard() & kGoneBit; }
    RealtimeOwner* realtimeOwner() const { return realtimeOwner_; }     // null: it belongs to the SORM's thread
    // Hand the object over to a thread, or with null back. By the SORM's thread, while the other one does not run it.
    void setRealtimeOwner(RealtimeOwner* owner);
    // Fails with COMM DENIED when somebody has named a part of it (namedParts) that he may not use, by the present policy.
    void needParts() const;

    // A request of any method, as the dispatcher, the Tcl command and the server make it: checks, counts, times one
    // call in 64, keeps the trail within the object's verbosity, and names this object in what is thrown. True: the
    // answer comes later, in m.later; m itself is empty.
    bool start(Method method, Message& m);
    // The same, and wait for the answer.
    void invoke(Method method, Message& m);
    // Begin a request whose answer may take its time. Of an object of this process it starts when the event loop, or
    // wait(), gets to it. Never throws: failures are the future's. Without a deadline: -timeout for remote objects.
    Future async(Method method, Message request, Deadline deadline = {});
    // Send a request whose answer, or failure, nobody wants to know.
    virtual void oneway(Method method, Message request);

    std::int64_t lastRun = INT64_MAX;       // [ns] of the last request that a daemon served, INT64_MAX before
    std::uint64_t calls() const { return calls_.load(std::memory_order_relaxed); }
    std::uint32_t references() const { return references_; }
    // Listen to what it publishes: events whose names match a pattern, as Tcl's string match; of those not taken yet the
    // last `keep` are kept. The listener is called from the loop. Throws when the object cannot be listened to.
    virtual std::unique_ptr<Listening> listen(std::string pattern, std::size_t keep, Listener listener);
    // The same, closer: the subscriber is called in the middle of whatever publishes, and hears gone() when the object goes.
    void subscribe(Subscriber* subscriber, std::string pattern);
    void unsubscribe(Subscriber* subscriber);
    // Hand the last events that match to a new subscriber: of what was published since somebody first listened, and of states.
    void replay(Subscriber* subscriber, std::string_view pattern) const;
    bool isMonitored() const { return stream_ && stream_->monitored(); }     // of the SO `sorm`: bus/monitor.h
    // Requests that it has taken over, and those that wait for them.
    std::size_t underWay() const;
    std::string dump() const;               // settable part: "-option value" lines; then state lines "# ..."
    std::string recipe() const;             // options that differ from their defaults, as CTRL words

    // Who wrote the present value of an option, also while changed() looks at it; null: the owner. A value that names
    // something is acted on with his rights.
    const PrincipalPointer& author(std::string_view option) const;

protected:
    void count() { calls_.store(calls() + 1, std::memory_order_relaxed); }      // a request
    void review(Message& m);                // the trail of an answer
    // Take over the request that exec was called with: its content moves into the reply's message, exec returns, and
    // the answer is given through the reply, any time, by any thread.
    Reply later(Message& m);
    // Tell those who have subscribed to this object. event: words separated by dots. Costs next to nothing without.
    void publish(std::string_view event, const Message& m) const {
        if (stream_) [[unlikely]] stream_->publish(*this, event, m);
    }
    // The same of a state, or of anything that is rare: it is kept from the first on, for those who subscribe later and want the
    // last value (sorma::subscribe -latest).
    void publishState(std::string_view event, const Message& m);
    // Bring a request forward; a proxy gives it to its connection.
    virtual void carry(const PendingPointer& pending, Method method);
    virtual Deadline patience() const { return {}; }        // of async, unless its caller says another one

private:
    friend class Reference;
    friend class Pending;
    friend class Sorm;
    friend struct CommonRequests;           // -help, -dump, -why ... of every class

    struct Record;                          // origins, undo, audit, statistics: made when first needed
    Record& record();
    void configure(const std::vector<DictionaryWord>& words, bool birth, const std::string& request, Message* reply);
    struct Applying;
    void apply(Applying& a);
    [[noreturn]] void failGone() const;
    void admit(Method method, Message& m);
    void need(const PrincipalPointer& author, Right right);
    void assign(const Option& option, const Value& value, const PrincipalPointer& author);
    void judgeParts();                      // by the present policy
    bool startGuarded(Method method, Message& m);
    bool proceed(Method method, Message& m);
    void enter(Method method, Message& m);
    void timed(Method method, Message& m);
    void noteFailure(const Trail& trail);
    void enqueue(Message& m);
    void perform(const PendingPointer& pending, Method method);
    void released();                        // one of the requests that it had taken over has ended
    void checkLock() const;
    void leave(bool hangs);
    void left();                            // the repository: no more requests, those that wait are refused
    void awaitLater(Message& m);

    // Both are written by the thread that the object belongs to, and may be looked at by another one any time; they order
    // nothing.
    std::uint8_t guard() const { return guard_.load(std::memory_order_relaxed); }
    void setGuard(std::uint8_t bit, bool on) {
        guard_.store(std::uint8_t(on ? guard() | bit : guard() & ~bit), std::memory_order_relaxed);
    }
    void invokeInPlace(Message& m);         // EXEC by reference, the long way
    void unusable(Message& m);

    Charge charge_;                         // for being there
    std::string name_;
    const Class* class_ = nullptr;
    Sorm* sorm_ = nullptr;
    std::unique_ptr<Record> record_;
    RealtimeOwner* realtimeOwner_ = nullptr;    // while guard_ has kOwnedBit
    std::atomic<std::uint64_t> calls_{0};   // EXECs
    std::uint32_t references_ = 0;
    std::uint32_t names_ = 0;               // in the repository, second names included
    std::unique_ptr<Stream> stream_;        // while somebody listens
    static constexpr std::uint8_t kGoneBit = 1, kBusyBit = 2, kLockedBit = 4, kOwnedBit = 8;
    static constexpr std::uint8_t kAskBit = 16;     // the SORM is a safe interpreter's: its own requests are asked, too
    static constexpr std::uint8_t kPartsBit = 32;   // a part of it was named by somebody who may not use it any more
    std::atomic<std::uint8_t> guard_{0};    // what stands in the way of a request
    std::uint8_t checks_ = 0;               // class_->checks()
    std::uint8_t verbosity_ = 1;            // 0 errors, 1 and warnings, 2 and verbose
    // What whoever asked last may do with this object: good for that principal, and for that state of the policy.
    struct Known {
        std::uint64_t principal = 0;
        std::uint32_t epoch = 0;
        Rights rights = 0;
    } known_;
};

inline Reference::Reference(Service* service) : service_(service) {
    if (service_) ++service_->references_;
}

[[gnu::always_inline]] inline Reference::~Reference() {
    if (service_ && --service_->references_ == 0) delete service_;
}

inline void Reference::exec(Message& message) const {
    Service& s = *service_;
    if (s.guard()) [[unlikely]] return s.invokeInPlace(message);
    if (s.checks_ & Class::lengths) s.class_->checkRequest(s.name_, message);
    s.count();
    s.exec(message);
    if (message.later) [[unlikely]] s.awaitLater(message);
}

inline void Reference::step(Message& message, RealtimeOwner* here) const {
    Service& s = *service_;
    std::uint8_t guard = s.guard();
    if (guard && (guard != Service::kOwnedBit || s.realtimeOwner_ != here)) [[unlikely]] return s.invokeInPlace(message);
    s.count();
    s.exec(message);
    if (message.later || message.code < 0) [[unlikely]] s.unusable(message);
}

// Used by Class::service: resolves a name through the SORM of the object, so that cycles are noticed.
Reference subService(Service& user, const std::string& name, const PrincipalPointer& author = nullptr);

template <class S> Class& Class::service(std::string name, Reference S::*member, Spec spec) {
    return option({std::move(name), Type::service, std::move(spec), {},
                   [member](const Service& s) {
                       const Reference& r = static_cast<const S&>(s).*member;
                       return Value(r ? r->name() : std::string());
                   },
                   nullptr,
                   [member](Service& s, Reference r) { static_cast<S&>(s).*member = std::move(r); }});
}

}  // namespace sorma
