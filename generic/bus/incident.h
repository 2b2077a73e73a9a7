// incident.h -- what goes wrong in ticks without an error: counted there, told by the cycle (services/cycle).
//
// A unit that reads something from outside must not fail in a tick when that is late, wrong or missing. It goes on without
// it, and counts that. The cycle that executes the unit collects the counts, lists them (DBX -incidents), and names new
// ones in the trail.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

namespace sorma {

class Service;

// A number that one thread counts up, and any thread reads.
class Tally {
public:
    Tally() = default;
    Tally& operator++() noexcept { return *this += 1; }
    Tally& operator+=(std::uint64_t n) noexcept {
        count_.store(*this + n, std::memory_order_relaxed);
        return *this;
    }
    void clear() noexcept { count_.store(0, std::memory_order_relaxed); }
    operator std::uint64_t() const noexcept { return count_.load(std::memory_order_relaxed); }

private:
    std::atomic<std::uint64_t> count_{0};       // relaxed: no other data depends on it
};

struct Incident {
    std::string object, kind;
    std::uint64_t count = 0;            // since the object was made; may begin again
    bool told = false;                  // the object reports it itself, in the trail
};
using Incidents = std::vector<Incident>;

// A class of services that counts incidents derives from this, too.
class HasIncidents {
public:
    virtual ~HasIncidents();
    // Append all kinds that it knows, also those that have not happened. Called on the SORM's thread while ticks go on.
    virtual void tellIncidents(Incidents& out) const = 0;
};

// The same for any object; of a class that counts none nothing is appended.
void tellIncidents(const Service& service, Incidents& out);

}  // namespace sorma
