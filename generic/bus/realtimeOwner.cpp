#include "bus/realtimeOwner.h"

#include <sys/resource.h>
#include <time.h>

#include "bus/service.h"

namespace sorma {

namespace {

thread_local const Tick* theTick = nullptr;

}  // namespace

thread_local RealtimeOwner* RealtimeOwner::current_ = nullptr;

ThreadEffort ThreadEffort::now() {
    timespec busy{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &busy);
    rusage usage{};
    getrusage(RUSAGE_THREAD, &usage);
    return {busy.tv_sec * 1'000'000'000LL + busy.tv_nsec, usage.ru_nvcsw};
}

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
