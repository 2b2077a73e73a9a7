#include "bus/realtimeOwner.h"

#include "bus/service.h"

namespace sorma {

namespace {

thread_local const Tick* theTick = nullptr;

}  // namespace

thread_local RealtimeOwner* RealtimeOwner::current_ = nullptr;

BetweenTicks::BetweenTicks(Service& service) {
    RealtimeOwner* owner = service.realtimeOwner();
    if (!owner || owner == RealtimeOwner::current()) return;
    owner->hold(service);
    owner_ = owner;
}

const Tick* Tick::current() { return theTick; }
Tick::Scope::Scope(const Tick& tick) : outer_(theTick) { theTick = &tick; }
Tick::Scope::~Scope() { theTick = outer_; }

}  // namespace sorma
