// fence.h -- objects that obey others only while a condition outside of this process holds: comm/ownership.h.
//
// It is asked at the one entrance, Service::start, so every door is behind it: calls of peers, SCPI, VXI-11, streams, pipes. An object that
// calls another one for its client comes there, too. It is asked for EXEC and CTRL, and when the first use of a name would make such an
// object. It is not asked for DBX of an object that is there, for what this process does for itself, and in a tick of a cycle.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "bus/call.h"
#include "bus/principal.h"

namespace sorma {

class Sorm;

class Fence {
public:
    Fence();
    virtual ~Fence() = default;
    Fence(const Fence&) = delete;
    Fence& operator=(const Fence&) = delete;
    const std::uint64_t serial;                 // of no other fence of this process; for HeardEpoch::fence
    virtual bool covers(std::string_view object) const = 0;
    // Returns when such an object may obey now. Else throws why it may not. epoch: that the client has heard; 0: none.
    // trusted: the caller may call the object. elsewhere: the client should look for another daemon.
    virtual void need(std::string_view object, std::int64_t epoch, bool trusted, bool& elsewhere) = 0;
};

// The fences of one SORM.
class Fences {
public:
    explicit Fences(Sorm& sorm) : sorm_(sorm) {}
    void add(Fence* fence);                     // it must be removed before it is deleted
    void remove(Fence* fence);
    bool cover(std::string_view object) const;
    // For a request to an object, or for making it. Throws as Fence::need; of several fences that cover the object all must let it through.
    void need(std::string_view object, const PrincipalPointer& author) const;

private:
    Sorm& sorm_;
    std::vector<Fence*> list_;
};

}  // namespace sorma
