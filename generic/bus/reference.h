// reference.h -- a counted reference to a service object.
#pragma once

#include <utility>

#include "bus/message.h"

namespace sorma {

class Service;
class RealtimeOwner;

// A counted reference to a service object, here or (through its proxy) elsewhere; may be empty. It keeps the object alive.
// When the object is removed from the repository, the reference stays valid, and calls fail with SERVICE GONE.
// Threads: the count has no lock, so copy and delete references only on the SORM's thread.
class Reference {
public:
    Reference() = default;
    explicit Reference(Service* service);
    Reference(const Reference& other) : Reference(other.service_) {}
    Reference(Reference&& other) noexcept : service_(std::exchange(other.service_, nullptr)) {}
    Reference& operator=(Reference other) noexcept {
        std::swap(service_, other.service_);
        return *this;
    }
    ~Reference();

    explicit operator bool() const { return service_ != nullptr; }
    Service* operator->() const { return service_; }
    Service& operator*() const { return *service_; }
    Service* get() const { return service_; }

    // The fastest way to call EXEC: in place, without allocation, lock or clock. The lengths that the class's signature
    // declares are checked. Throws Error. Waits when the object answers later.
    inline void exec(Message& message) const;       // defined in bus/service.h
    // The same for a circuit or a cycle, which executes many objects in a row and has checked the lengths when they were
    // wired. Also throws when the object returns a code < 0, or would answer later in a tick.   here:
    // RealtimeOwner::current().
    inline void step(Message& message, RealtimeOwner* here) const;

private:
    Service* service_ = nullptr;
};

}  // namespace sorma
