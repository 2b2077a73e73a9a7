// realtimeOwner.h -- objects that a thread of its own executes, tick after tick, beside the SORM's thread.
//
// Such a thread is the real-time owner of its objects: it alone executes them in its ticks. The SORM's thread uses them
// between two ticks: for the length of a request no tick begins. What a change needs in preparation (names to be resolved,
// objects to be made, memory) is done before, while ticks go on (Service::prepare). So an object never sees two threads at
// once, and a tick locks nothing and waits for nobody.
#pragma once

#include <cstdint>

namespace sorma {

class Service;

// What a thread has spent so far. It tells a change that is slow from one during which the machine took the processor away.
struct ThreadEffort {
    std::int64_t busy = 0;          // [ns] on a processor
    long waits = 0;                 // times that it waited of its own accord: for a lock, for a file

    static ThreadEffort now();
};

class RealtimeOwner {
public:
    virtual ~RealtimeOwner() = default;

    // Called by the SORM's thread, through BetweenTicks. Returns when no tick runs; none begins before release(). May be
    // nested. service: what is going to be used. Fails with SERVICE STUCK when the present tick does not end in time; then
    // nothing is held.
    virtual void hold(Service& service) = 0;
    virtual void release() noexcept = 0;
    // Fails with CYCLE LATE when the present hold makes a tick late by more than a quarter of the period, and what was done
    // in it since then is what took so long.
    virtual void checkBudget(Service& service, const ThreadEffort& since) const = 0;
    // Take an object in, and its parts, to execute them in ticks. The SORM's thread, while ticks go on.
    // Fails with CYCLE STEP when it cannot be executed so; it says why.
    virtual void adopt(Service& service) = 0;
    // Objects have other parts now, or adopted ones have not become parts: those that no step needs are given back.
    virtual void partsChanged() noexcept = 0;
    // Why nobody else can have this object: "is run by another cycle already".
    virtual const char* claim() const = 0;

    static RealtimeOwner* current() { return current_; }    // whose thread this is; null: a SORM's, or any other
protected:
    static thread_local RealtimeOwner* current_;
};

// For the length of a block no tick uses this object. Nothing to do for an object without a real-time owner, or on its
// owner's own thread. Fails with SERVICE STUCK.
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

// What drives the request that this thread executes, when it is one of a row at a fixed period.
struct Tick {
    std::int64_t time = 0;          // [ns] when it was due: monotonic clock, or the one that the cycle goes by
    double period = 0;              // [s]
    std::uint64_t number = 0;

    static const Tick* current();   // null: the request stands alone
    // For the length of a block. The tick must outlive it.
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
