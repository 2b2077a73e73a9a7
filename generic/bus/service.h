// service.h -- a service object: the functions that its author implements, and those that every object has from its class's
// table.
//
// Threads:  a service object belongs to the thread of its SORM, or to a thread that executes it in ticks
//           (bus/realtimeOwner.h). It is never used by two threads at once. References are counted without locks.
// Errors:   each virtual function may throw Error, or any std::exception; the caller gets it as SERVICE FAILED unless it is
//           an Error.
// Re-entry: exec, ctrl and dbx may make requests and run the event loop. Then other requests may come in on top, also for
//           this object, and it may be removed; it stays alive until they have returned.
// Owner:    the repository and References share an object. It is deleted when the last of them is.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>
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
class Pieces;

class Service {
public:
    Service();
    virtual ~Service();
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    // ---- for the author of a class ----

    // Do the work: m is the request, and becomes the result. Throw (fail) to refuse; then the object's state must be as
    // before, and m may be anything. If it takes long, take the request over with later(m), see reply.h.
    virtual void exec(Message& m) = 0;

    // Called once before the first request: the recipe has been applied, and the name is known. Throw to refuse; then there
    // is no object.
    virtual void born() {}

    // Returns the writer of a reply that is wanted in pieces, see bus/pieces.h. It begins its work at Pieces::next: also a serial object
    // may be at work now. Null: exec answers, and its reply is cut. Rights and lock have been checked, as for exec. Throw to refuse.
    virtual std::unique_ptr<Pieces> inPieces(Message& request);

    // Options are about to change. Do the slow part here: resolve names, make objects, allocate. The object goes on with its
    // present options meanwhile, perhaps in a cycle. Called on the SORM's thread, so do not change anything that EXEC uses.
    // The function that you return is called between two ticks, when the options have been set; it must be short. Throw to
    // refuse the change. Not called for the recipe (see born).
    virtual Commit prepare(const Change& change) { return (void)change, nullptr; }

    // These options have new values. Must be short, since no tick begins meanwhile. When it makes a tick late by more than a
    // quarter of the period, the change is undone, and this is called again. Throw to refuse: all of them are undone. Not
    // called for the recipe.
    virtual void changed(std::span<const Option* const> options) { (void)options; }

    // A request has set these options. Make what they stand for follow, which may take long: an instrument, another program. Runs as an
    // action of that request, before its other ones. Throw, or answer with an error: the request fails, but the options keep the values.
    virtual void settle(std::span<const Option* const> options, Message& m) { (void)options, (void)m; }

    // Test yourself. Throw what is wrong, or return the result as text.
    virtual std::string selftest() { return "ok"; }
    // The same for a test that takes long: appends a line to m.text, or takes the request over with later(m).
    virtual void answerSelftest(Message& m);

    // The object was removed from the repository. End all that is under way: a reply that is not answered keeps the object
    // alive. An error in it is ignored.
    virtual void removing() {}
    // The process ends, and objects are not removed. End threads that use libraries: those take down what is static soon.
    virtual void processEnds() {}

    // Append state that is not in the options, in lines "# name value", for -dump.
    virtual void dumpState(std::string& out) const { (void)out; }

    // The pins to which a circuit can wire it. pin, length: that pin has so many elements; lengths of other pins may follow
    // from it.
    // Default: from the signature.
    virtual std::vector<Pin> pins(std::string_view pin = {}, std::size_t length = Pin::kOpen) const;

    // The objects that it executes in its own EXEC. They have its real-time owner. Default: those of its options, as far
    // as these are declared to be parts.
    virtual std::vector<Reference> parts() const;

    // Does an EXEC of it move, power or fire something: as its class says, or as a part of it does?
    bool isDangerous() const;

    // The objects that it uses by name, and who wrote the names. If a change of the policy takes an author's right away,
    // EXEC is refused until the right is back or another name is set. Default: those of its options.
    struct NamedPart {
        std::string name;
        PrincipalPointer author;            // null: the owner
    };
    virtual std::vector<NamedPart> namedParts() const;

    // ---- requests with words; only a proxy overrides these ----
    virtual void ctrl(Message& m);
    virtual void dbx(Message& m);
    virtual std::string location() const { return "self"; }
    // True for a proxy: the other process checks rights and signature.
    virtual bool isElsewhere() const { return false; }
    virtual bool holdsSecrets() const;      // has it options that are secret?

    // ---- for callers ----
    const std::string& name() const { return name_; }
    const Class& type() const { return *class_; }
    Sorm& sorm() const { return *sorm_; }
    bool gone() const { return guard() & kGoneBit; }                    // it was removed
    RealtimeOwner* realtimeOwner() const { return realtimeOwner_; }     // null: it belongs to the SORM's thread
    // Give the object to a real-time thread, or back (null). Call it on the SORM's thread, while the other one does not
    // execute it.
    void setRealtimeOwner(RealtimeOwner* owner);
    // Fails with COMM DENIED when an author of its namedParts() has no right to use that part, by the present policy.
    void needParts() const;
    // Fails with COMM DENIED when the author of the words of an EXEC lacks the right that the type of one of them needs.
    void needWords(const PrincipalPointer& author, std::span<const std::string> words) const;

    // Execute a request, as the dispatcher, the Tcl command and the server do: the one entrance, see bus/request.h. It checks
    // rights and signature, counts, tells observers, reduces the trail to the object's verbosity, and names this object in
    // errors. Throws Error.
    // True: the answer comes later, in m.later, and m is empty.
    bool start(Method method, Message& m);
    // The same, and wait for the answer.
    void invoke(Method method, Message& m);
    // Begin a request without waiting. For an object of this process it starts when the event loop or wait() gets to it.
    // Never throws: errors are the future's. Without a deadline: Settings::timeout for remote objects, none for others.
    // bound: do not send it to another daemon. When the one that is connected now ends, it fails with COMM LOST, sent or not.
    Future async(Method method, Message request, Deadline deadline = {}, bool bound = false);
    // Send a request without an answer. Errors that come later are lost. May throw, and for a remote object block: see
    // Connection::oneway.
    virtual void oneway(Method method, Message request);

    std::int64_t lastRun = INT64_MAX;       // [ns] duration of the last request that a daemon served; INT64_MAX: none yet
    std::uint64_t calls() const { return calls_.load(std::memory_order_relaxed); }     // any thread
    std::uint32_t references() const { return references_; }
    // Subscribe to its events whose names match a pattern, as Tcl's string match. keep: events that are kept until the
    // listener runs; then the oldest are lost. The listener is called from the loop, until the result is deleted. Throws
    // when the object refuses.
    virtual std::unique_ptr<Listening> listen(std::string pattern, std::size_t keep, Listener listener);
    // The same without a queue: the subscriber is called inside publish(), and gone() when the object is removed.
    // permit: to inspect the object.
    void subscribe(Subscriber* subscriber, std::string pattern, const Permit& permit);
    void unsubscribe(Subscriber* subscriber);
    // Give a new subscriber the last events that match: those since somebody first listened, and states.
    void replay(Subscriber* subscriber, std::string_view pattern, const Permit& permit) const;
    const Stream* stream() const { return stream_.get(); }      // of its events; null: nobody has listened yet
    bool isMonitored() const { return stream_ && stream_->monitored(); }     // of the object `sorm`: bus/monitor.h
    // Requests that it has taken over, and those that wait for them.
    std::size_t underWay() const;
    // Lines "-option value" of the options that can be set, then state lines "# ...". What is secret is kMask, unless the
    // permit includes the right to configure.   permit: to inspect the object.
    std::string dump(const Permit& permit) const;
    std::string shown(const Option& option, const Permit& permit) const;        // its value in the same way
    std::string recipe(const Permit& permit) const;     // options that differ from their defaults, as words of CTRL
    // Fails with COMM DENIED if the author has not this right to this object; what it knows of the last author is kept.
    Permit need(const PrincipalPointer& author, Right right);

    // The author of the present value of an option, also inside changed(); null: the owner. If the value names a thing, the
    // object uses it with the author's rights.
    const PrincipalPointer& author(std::string_view option) const;
    // The author of its recipe in the dictionary, else whoever used the name first; null: the owner. If the name
    // itself says what the object uses, it uses that with the rights of the maker.
    const PrincipalPointer& maker() const { return maker_; }
    // Fails with COMM DENIED when somebody may not write such a value, see bus/named.h.
    Permit needKind(const PrincipalPointer& author, Kind kind, const std::string& value) const { return sorma::needKind(*this, author, kind, value); }

protected:
    void count() { calls_.store(calls() + 1, std::memory_order_relaxed); }      // count a request
    void review(Message& m);                // of an answer: note its trail, and reduce it to the verbosity
    // For exec: does the request begin with a word that Class::word has given a body? Then that has done it.
    bool execWord(Message& m);
    // Take over the request of exec: its content moves into the reply's message. Then return from exec, and answer through
    // the reply, at any time, from any thread.
    Reply later(Message& m);
    // Send an event to the subscribers of this object. event: words separated by dots. Costs next to nothing when there are
    // none.
    void publish(std::string_view event, const Message& m) const {
        if (stream_) [[unlikely]] stream_->publish(*this, event, m);
    }
    // The same for a state, or for an event that is rare. The last one is always kept: later subscribers can ask for it
    // (sorma::subscribe -latest).
    void publishState(std::string_view event, const Message& m);
    // Execute a request of async; a proxy gives it to its connection.
    virtual void carry(const PendingPointer& pending, Method method);
    virtual Deadline patience() const { return {}; }        // default deadline of async

private:
    friend class Reference;
    friend class Pending;
    friend class Sorm;
    friend struct CommonRequests;           // -help, -dump, -why ... that every class has
    friend struct Bookkeeping;              // what -stats and -audit show
    friend class OpenPieces;                // streams: -stream

    struct Record;                          // see serviceParts.h; made when first needed
    Record& record();
    void configure(const std::vector<DictionaryWord>& words, bool birth, Message* reply);
    struct Applying;
    void apply(Applying& a);
    Change::Setting conditionOf(Args args, const PrincipalPointer& author) const;
    void needConditions(const Applying& a) const;
    void settleFirst(const Applying& a, Message* reply, bool last);
    [[noreturn]] void failGone() const;
    void admit(Method method, Message& m);
    void needFence(const PrincipalPointer& author);
    void checkArguments(const Message& m);
    void admitStream(Message& m);           // an EXEC whose reply is read in pieces: at its beginning, and at each piece
    bool isDangerous(const Message& m) const;           // does this EXEC of it?
    bool hasDangerousPart() const;
    void assign(const Option& option, const Value& value, const PrincipalPointer& author);
    void needArguments(const Action& action, Args args, const PrincipalPointer& author);
    void recall(const std::vector<std::string>* given);   // the values that are remembered, but for those of the words given
    void rememberOnly(const std::string& which, const PrincipalPointer& author, bool write);
    void remember(const std::vector<const Option*>& options);
    bool mayKeepValues() const;             // may the authors of its values keep them, by the present policy?
    void judgeParts();                      // check needParts() by the present policy, and set kPartsBit
    bool startGuarded(Method method, Message& m);
    bool startHeld(Method method, Message& m);
    [[noreturn]] void failCode(int code) const;
    bool proceed(Method method, Message& m);
    void enter(Method method, Message& m);
    void keepTrail(const Trail& trail);
    void noteFailure(const Trail& trail);
    void enqueue(Message& m);
    void perform(const PendingPointer& pending, Method method, bool again = false);
    void released();                        // a request that it had taken over is finished: start the next one
    void checkLock();                       // fails with SERVICE LOCKED, UNLOCKED
    void expireLock();                      // end it if its time is over
    void leave(bool hangs);
    void left();                            // it was removed: it takes no more requests, and those that wait fail
    void awaitLater(Message& m);            // wait for an answer that comes later

    // The thread to which the object belongs writes calls_. Other threads may read it at any time, and change bits of guard_;
    // memory order is relaxed, since no other data depends on them.
    std::uint16_t guard() const { return guard_.load(std::memory_order_relaxed); }
    bool isSample() const { return (calls() & 63) == 0; }      // its next EXEC is the one in 64 that statistics measure
    void setGuard(std::uint16_t bit, bool on) {
        if (on) guard_.fetch_or(bit, std::memory_order_relaxed);
        else guard_.fetch_and(std::uint16_t(~bit), std::memory_order_relaxed);
    }
    void invokeInPlace(Message& m);         // Reference::exec when guard_ is not 0
    void unusable(Message& m);              // Reference::step got no usable answer

    // Each request touches these: they stand first, within 64 bytes.
    std::atomic<std::uint64_t> calls_{0};   // EXECs
    Sorm* sorm_ = nullptr;
    RealtimeOwner* realtimeOwner_ = nullptr;    // while guard_ has kOwnedBit
    std::uint32_t references_ = 0;
    std::uint32_t names_ = 0;               // names in the repository, second names included
    static constexpr std::uint16_t kGoneBit = 1, kBusyBit = 2, kLockedBit = 4, kOwnedBit = 8;
    static constexpr std::uint16_t kAskBit = 16;     // the SORM is a safe interpreter's: its own requests need rights, too
    static constexpr std::uint16_t kPartsBit = 32;   // the author of a named part has lost the right to use it
    static constexpr std::uint16_t kObservedBit = 64;    // an observer wants all its requests: bus/request.h
    static constexpr std::uint16_t kFormerBit = 128; // a client is to be told that its lock has ended
    static constexpr std::uint16_t kFencedBit = 256;    // for others it obeys only as a fence says: bus/fence.h
    static constexpr std::uint16_t kLockBits = kLockedBit | kFormerBit;
    std::atomic<std::uint16_t> guard_{0};   // 0: a request may run at once; else the reasons why it may not
    std::uint8_t checks_ = 0;               // class_->checks()
    std::uint8_t verbosity_ = 1;            // 0: errors; 1: and warnings; 2: and verbose
    Charge charge_;                         // for the object itself
    std::string name_;
    PrincipalPointer maker_;
    std::shared_ptr<const Class> class_;
    std::unique_ptr<Record> record_;
    std::unique_ptr<Stream> stream_;        // since somebody first listened, or a state was published
    // The rights of the principal of the last request; valid for that principal and that epoch of the policy.
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
    const int guard = s.guard();
    if (guard && ((guard & ~(Service::kObservedBit | Service::kFencedBit)) != Service::kOwnedBit || s.realtimeOwner_ != here)) [[unlikely]] return s.invokeInPlace(message);
    s.count();
    s.exec(message);
    if (message.later || message.code < 0) [[unlikely]] s.unusable(message);
}

// Adds the object and all that is executed in its EXEC, by its parts and theirs. Objects that are in the tree already are
// passed by.
void addTree(const Service& object, std::unordered_set<const Service*>& tree);

// For Class::service: finds or makes an object by its name. Fails with SERVICE CYCLE when it needs the object that asks.
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
