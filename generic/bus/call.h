// call.h -- on whose behalf a piece of work runs, and until when: the call context.
//
// Where a request comes in, its context is put on the stack; what the service calls finds it there and inherits deadline,
// cancellation, client and request number. It says nothing about rights: those are asked of whoever wrote a word
// (Message::author, bus/access.h), and a class's own code does what it does as the owner of this process.
//
// Work that waits (in a mailbox, for a timer, for a reply) takes its context along with keep(), and goes on in it. What an
// event loop calls in the meantime starts fresh: it is somebody else's, wherever on the stack it happens to run.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bus/deadline.h"
#include "bus/principal.h"

namespace sorma {

// Who sent a request. By TCP user, host, program and process are only what he claims.
struct Caller {
    std::string user, host, program, address;   // address: how it reached us, "unix" or "127.0.0.1:40312"
    std::int64_t process = 0;
    std::string known;                          // by TCP: what the kernel says, "192.168.7.21", "anna@127.0.0.1"
    std::string toText() const;                 // user@host program[process]; KNOWN (claims user@host program[process])
    static const Caller& self();                // this process
};

class Client;
using ClientPointer = std::shared_ptr<Client>;      // bus/client.h
class Pending;

// A call context that outlives the stack on which it began. One for each request, shared by all that waits for it.
class KeptCall {
public:
    KeptCall(ClientPointer client, Deadline deadline, std::uint64_t request, std::string behalf)
        : client(std::move(client)), deadline(deadline), request(request), behalf(std::move(behalf)) {}

    const ClientPointer client;                 // null: this process
    const Deadline deadline;
    const std::uint64_t request;
    const std::string behalf;                   // for whom the client says that it asks: its own callers, nearest first

    std::string callers() const;                // as text: the client, and for whom
    bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }   // a hint, it orders nothing
    // The caller has given up. Everything that was begun on his behalf is cancelled too, down to the last process.
    // The SORM's thread.
    void cancel();
    // A request that is made on behalf of this one.
    void begun(const std::shared_ptr<Pending>& pending);
    std::uint32_t subTime = 0;                  // [us] in which it waited for other processes, each of its calls by itself

private:
    std::atomic<bool> cancelled_{false};
    std::vector<std::weak_ptr<Pending>> begun_;
};
using KeptCallPointer = std::shared_ptr<KeptCall>;

class CallContext {
public:
    // A request begins. Nothing is inherited from what runs below on the stack, and that is billed no time.
    // client, null for this process, and behalf are borrowed. request: its number, 0 when it has none yet.
    CallContext(const ClientPointer& client, Deadline deadline, std::uint64_t request, const std::string& behalf);
    // Work that waited goes on. null: fresh.
    explicit CallContext(const KeptCallPointer& kept);
    ~CallContext();
    CallContext(const CallContext&) = delete;
    CallContext& operator=(const CallContext&) = delete;

    // For the length of a block: an event loop runs, and what it calls has nothing to do with the present request.
    class Fresh {
    public:
        Fresh();
        ~Fresh();
        Fresh(const Fresh&) = delete;
        Fresh& operator=(const Fresh&) = delete;
    private:
        CallContext* outer_;
    };

    static CallContext* current();              // null: outside of any request
    static Deadline currentDeadline();
    // Until when a call to another process may take: of what is left something is kept for the way back, so that who asked
    // hears which hop it was that did not answer.
    static Deadline deadlineForCalls(std::int64_t now);
    static const Caller& currentCaller();       // Caller::self() outside of any request
    static std::string currentCallers();        // as text, with those on whose behalf he says that he asks
    static PrincipalPointer currentPrincipal(); // who is to be charged; null: the owner
    static ClientPointer currentClient();       // null when the request comes from this process
    // Its number: the one that its caller has given it, which is also that of the request on whose behalf he made it; else one
    // that is given to it now. 0 outside of any request.
    static std::uint64_t currentRequest();
    static bool currentCancelled();             // by its caller, or because the deadline has passed
    static bool currentGivenUp();               // by its caller
    static KeptCallPointer keep();              // the present one, for work that waits; null outside of any request
    static std::uint64_t newRequest();          // a number that no other request has, here or elsewhere, by all odds

    const ClientPointer& client;
    const Deadline deadline;
    const std::string& behalf;
    std::atomic<bool> cancelled{false};         // the caller has given up: what takes long may look, and stop early
    std::uint32_t subTime = 0;                  // [us] spent in calls to other processes since this began
    std::uint32_t waitedForOthers() const;      // the same of all its parts
    void cancel();                              // by the caller: what was begun on his behalf is cancelled, too. The SORM's thread

private:
    static const ClientPointer kThisProcess;
    static const std::string kNobody;
    std::uint64_t request_;                     // 0: nobody has asked for its number yet
    KeptCallPointer kept_;
    CallContext* outer_;
};

}  // namespace sorma
