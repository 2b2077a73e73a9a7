// realtimeOwner.h -- objects that a real-time thread executes at a fixed period, beside the SORM's thread.
//
// The real-time owner of an object is the only one that executes it in ticks. The SORM's thread uses the object between two
// ticks: no tick begins during its request. The slow part of a change (resolving names, making objects, allocating) is done
// before, while ticks go on (Service::prepare). So two threads never use an object at once, and a tick takes no lock and
// never waits.
#pragma once

#include <cstdint>

namespace sorma {

class Service;

// Processor time and waits of a thread so far. A change that took long was slow itself if these grew; otherwise the machine
// ran something else meanwhile.
struct ThreadEffort {
    std::int64_t busy = 0;          // [ns] on a processor
    long waits = 0;                 // voluntary waits: for a lock, for a file

    static ThreadEffort now();      // of the calling thread
};

class RealtimeOwner {
public:
    virtual ~RealtimeOwner() = default;

    // The SORM's thread calls these.

    // Wait until no tick runs; none begins before release(). May be nested; use BetweenTicks.   service: for the message.
    // Fails with SERVICE STUCK when the present tick does not end in time; then nothing is held.
    virtual void hold(Service& service) = 0;
    virtual void release() noexcept = 0;
    // Fails with CYCLE LATE when the present hold makes a tick late by more than a quarter of the period, and the work since
    // then (not the machine) took that long.   since: ThreadEffort::now() when the work began.
    virtual void checkBudget(Service& service, const ThreadEffort& since) const = 0;
    // Become the owner of an object and its parts, to execute them in ticks, while ticks go on. Fails with CYCLE STEP when
    // it cannot be executed in ticks; the message says why.
    virtual void adopt(Service& service) = 0;
    // Objects have other parts now, or objects that were adopted have not become parts. Those that no step needs go back to
    // the SORM's thread.
    virtual void partsChanged() noexcept = 0;
    // For messages: why nobody else can have an object of this owner: "is run by another cycle already".
    virtual const char* claim() const = 0;

    static RealtimeOwner* current() { return current_; }    // the owner whose thread this is; null: another thread
protected:
    static thread_local RealtimeOwner* current_;
};

// While this exists no tick uses the object. Does nothing for an object without a real-time owner, or on the owner's own
// thread. Fails with SERVICE STUCK. Keep it short: a tick may have to wait for it.
class BetweenTicks {
public:
    explicit BetweenTicks(Service& service);
    ~BetweenTicks() {
        if (owner_) owner_->release();
    }
    BetweenTicks(const BetweenTicks&) = delete;
    BetweenTicks& operator=(const BetweenTicks&) = delete;
private:
    RealtimeOwner* owner_ = nullptr;
};

// The tick of a cycle that this thread executes.
struct Tick {
    std::int64_t time = 0;          // [ns] when it was due: monotonic clock, or the clock that the cycle uses
    double period = 0;              // [s]
    std::uint64_t number = 0;

    static const Tick* current();   // null: the request does not come from a cycle
    // Makes a tick the current one of this thread while it exists. The tick must outlive it.
    class Scope {
    public:
        explicit Scope(const Tick& tick);
        ~Scope();
        Scope(const Scope&) = delete;
        Scope& operator=(const Scope&) = delete;
    private:
        const Tick* outer_;
    };
};

}  // namespace sorma
