// reference.h -- a counted reference to a service object.
#pragma once

#include <utility>

#include "bus/message.h"

namespace sorma {

class Service;
class RealtimeOwner;

// A counted reference to a service object, here or (through its proxy) elsewhere. It stays valid when the object is
// removed: calls then fail with SERVICE GONE.
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

    // Time-optimal invocation: EXEC in place. No allocation, no lock, no clock; the class's signature is checked
    // where it demands something. Throws Error.
    inline void exec(Message& message) const;       // defined in bus/service.h
    // The same for one who executes many in a row, a circuit or a cycle: lengths have been checked when they were wired.
    // here: RealtimeOwner::current().
    inline void step(Message& message, RealtimeOwner* here) const;

private:
    Service* service_ = nullptr;
};

}  // namespace sorma
