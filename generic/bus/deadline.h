// deadline.h -- until when a call may take, on the monotonic clock, and who asked for it.
//
// Deadlines travel between processes as time left, so clocks need not agree. A call made while another is executed
// inherits that one's deadline when it is the earlier of the two.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

namespace sorma {

std::int64_t monotonicNow();    // nanoseconds, CLOCK_MONOTONIC
std::int64_t wallNow();         // microseconds since 1970

class Deadline {
public:
    Deadline() = default;       // none
    static Deadline in(std::int64_t milliseconds) {     // 0 = none
        return milliseconds > 0 ? Deadline(monotonicNow() + milliseconds * 1'000'000) : Deadline();
    }
    static Deadline at(std::int64_t monotonicNanoseconds) { return Deadline(monotonicNanoseconds); }

    bool none() const { return at_ == 0; }
    bool passed() const { return at_ != 0 && monotonicNow() >= at_; }
    std::int64_t when() const { return at_; }               // [ns], 0 = none
    std::int64_t left() const {                             // [ns]; a century when there is none, 0 when passed
        if (at_ == 0) return std::int64_t{3'155'760'000} * 1'000'000'000;
        std::int64_t rest = at_ - monotonicNow();
        return rest > 0 ? rest : 0;
    }
    Deadline earlier(Deadline other) const {
        if (none()) return other;
        if (other.none()) return *this;
        return at_ < other.at_ ? *this : other;
    }

private:
    explicit Deadline(std::int64_t at) : at_(at) {}
    std::int64_t at_ = 0;
};

// Who sent a request.
struct Caller {
    std::string user, host, program, address;   // address: how it reached us, "unix" or "127.0.0.1:40312"
    std::int64_t process = 0;
    std::string toText() const;                 // user@host program[process]
    static const Caller& self();                // this process
};

class Client;
using ClientPointer = std::shared_ptr<Client>;      // bus/client.h

// What surrounds the request that is executed on this thread. Entry points (server, dispatcher) set it up on their
// stack; services and proxies look at it.
class Call {
public:
    // client: null for this process. Both references must outlive the call.
    Call(const Caller& caller, Deadline deadline, const ClientPointer& client = kThisProcess);
    ~Call();
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;

    // On a thread that executes a request for another one, which waits for it: makes that one's call its own.
    class Lent {
    public:
        explicit Lent(Call* call);
        ~Lent();
        Lent(const Lent&) = delete;
        Lent& operator=(const Lent&) = delete;
    private:
        Call* own_;
    };

    static Call* current();                     // null outside of any request
    static Deadline currentDeadline();
    static const Caller& currentCaller();       // Caller::self() outside of any request
    static ClientPointer currentClient();       // null when the request comes from this process

    const Caller& caller;
    const Deadline deadline;
    const ClientPointer& client;
    std::atomic<bool> cancelled{false};         // the caller has given up: what takes long may look, and stop early
    std::int64_t subTime = 0;                   // [ns] spent in calls to other processes
private:
    static const ClientPointer kThisProcess;
    Call* outer_;
};

}  // namespace sorma
