// slots.h -- the calls of one client that a daemon may execute at a time, each in its slot, with its number.
//
// A slot has a sequence number, which goes up by one with each call. Its bytes are kept until the reply has come: after a
// broken connection they are sent again, and the daemon executes nothing twice.
//
//     free > taken > unsent > sent > done > free
//                                \ unwanted: nobody waits; free as soon as no reply can come
//
// Threads: none of its own; belongs to whoever has it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/reply.h"
#include "comm/link.h"
#include "comm/wire.h"

namespace sorma {

inline constexpr std::uint32_t kNoTicket = UINT32_MAX;          // Pending::ticket of a call that has no slot yet

struct Slot {
    enum class State : std::uint8_t { free, unsent, sent, done, unwanted };     // taken counts as done
    State state = State::free;
    std::uint32_t sequence = 0;
    std::string name;
    Deadline deadline;
    std::int64_t budget = 0;        // [ns] time left to the deadline when it was written
    Buffer request;                 // the record, kept until the reply has come
    record::Lent lent;              // numbers of it, which the caller keeps that long
    Message* into = nullptr;        // where a blocking caller wants the reply; null: in result
    Message result;
    Trail failure;                  // when failed: why, on this side of the wire
    bool failed = false;
    bool orphan = false;            // cancelled, but it still has to be sent since a part of it was
    bool cut = false;               // a part of it was sent on a connection that broke
    bool unsure = false;            // failed, though its daemon may still execute it: see Slots::fail
    SpanPointer span;               // of the trace that wants its spans; null: none does
    PendingPointer pending;         // of a call that was begun: it gets the reply

    bool awaited() const { return state == State::sent || state == State::unsent; }
    Message& reply() { return pending ? pending->message : into ? *into : result; }
};

class Slots {
public:
    // The xid of a record: the low bits of the sequence number, then the slot. kControl: no call.
    static constexpr std::uint32_t kBits = 16, kControl = (1u << kBits) - 1;
    static std::uint32_t xidOf(std::uint32_t slot, std::uint32_t sequence) { return sequence << kBits | slot; }

    Slots(Link& link, const Settings& settings) : link_(link), settings_(settings) {}

    Slot& operator[](std::uint32_t index) { return *slots_[index]; }
    std::uint32_t size() const { return static_cast<std::uint32_t>(slots_.size()); }
    std::size_t taken() const { return slots_.size() - free_.size(); }
    std::size_t inFlight() const { return inFlight_; }          // sent, and no reply has come, wanted or not
    std::size_t most() const;                                   // as many as the daemon takes
    bool none() const { return free_.empty() && slots_.size() >= most(); }
    // Does somebody wait for the reply to a call that was sent?
    bool awaited() const;
    // Are all that are in use unwanted? A daemon that is only slow answers them in the end. But if a record was damaged on its
    // way, that answer never comes, or we cannot read it.
    bool exhausted() const;

    std::uint32_t take(std::string_view name, Deadline deadline);       // there must be one
    void give(std::uint32_t index) {                    // the caller needs it no more
        Slot& slot = *slots_[index];
        slot.into = nullptr;
        if (slot.state == Slot::State::done && !slot.unsure) [[likely]] free(index);
        else abandon(index);
    }
    // Encode a call into its slot. Throws COMM TOO_BIG.   lend: m stays as it is until the reply has come, and is not copied where it is long.
    void write(std::uint32_t index, Method method, const Message& m, std::int64_t now, const wire::Behalf* behalf, bool lend = false);
    void sent(std::uint32_t index) {
        Slot& slot = *slots_[index];
        if (slot.state != Slot::State::unsent) return;  // sent again after a broken connection
        slot.state = slot.orphan ? Slot::State::unwanted : Slot::State::sent;
        ++inFlight_;
    }
    // The reply to a call that is awaited has this xid: its slot. kNoTicket: late, and nobody waits; or it was unwanted, and is
    // free now.
    std::uint32_t answered(std::uint32_t xid);
    void fail(std::uint32_t index, Trail why);          // it is done, with this error
    // It was sent and will get no reply. ended: its daemon is known to have ended.
    void drop(std::uint32_t index, bool ended, Trail why);
    void free(std::uint32_t index) {
        Slot& slot = *slots_[index];
        slot.state = Slot::State::free;
        if (slot.span) [[unlikely]] slot.span.reset();
        if (slot.request.capacity() > kKeepBuffer) slot.request.release();
        free_.push_back(index);
    }
    void clear(std::uint32_t index) { --inFlight_, free(index); }       // it was unwanted, and its daemon has ended
    bool toResend(std::uint32_t index);                 // on a new connection: is there something to send again?
    void forgetAnswers() { heard_ = false; }
    std::uint64_t calls() const { return calls_; }

private:
    static constexpr std::size_t kKeepBuffer = 4 << 20;         // [bytes] a longer request's memory is given back
    void abandon(std::uint32_t index);
    void probe(std::uint32_t index);

    Link& link_;
    const Settings& settings_;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::vector<std::uint32_t> free_;
    std::size_t inFlight_ = 0;
    bool heard_ = false;                // a call was answered on this connection
    std::uint64_t calls_ = 0;
    std::int64_t clockSaid_ = 0;        // [ns] when the daemon was last sent the time of our clock
};

}  // namespace sorma
