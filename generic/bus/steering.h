// steering.h -- objects that a thread of its own executes, tick after tick, beside the SORM's.
//
// An object that is steered belongs to that thread. Requests that reach it by the SORM are executed by it, between two
// ticks and in order, while the SORM's thread stands still and lends all that it owns: so a request finds everything as
// it always does, and nothing needs a lock. A tick itself borrows nothing, and waits for nobody.
#pragma once

#include <cstdint>
#include <functional>

namespace sorma {

class Service;

class Steering {
public:
    virtual ~Steering() = default;

    // Have work done between two ticks, and return when it is done; it does not throw. Called by the SORM's thread.
    // Fails with SERVICE STUCK when the steering thread does not come to it in time: then it is not done.
    virtual void lend(Service& service, const std::function<void()>& work) = 0;
    // Does this thread own the SORM now, because it is doing work that was lent?
    virtual bool hasLoan() const = 0;
    // An object that is steered takes another one in, to execute it in its own EXEC. Fails when that cannot be steered.
    virtual void adopt(Service& service) = 0;

    static Steering* current() { return current_; }     // of this thread; null: none, as for the SORM's thread
protected:
    static thread_local Steering* current_;
};

// What drives the request that this thread executes, when it is one of a row at a fixed period.
struct Tick {
    std::int64_t time = 0;          // [ns] monotonic clock: when it was due
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
