// call.h -- the call context: for which client a piece of work runs, and until when.
//
// When a request comes in, its context is put on the stack. The calls that the service makes inherit from it the deadline,
// cancellation, client and request number. It says nothing about rights. Those belong to the author of a word
// (Message::author, bus/access.h); the code of a class acts as the owner of this process.
//
// Work that waits (in a mailbox, for a timer, for a reply) takes its context along with keep(), and continues in it. An
// event loop that runs meanwhile calls work of other requests: that starts without a context (CallContext::Fresh).
//
// Threads: each thread has its own stack of contexts. cancelled() may be read by any thread; all else belongs to the SORM's.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bus/deadline.h"
#include "bus/principal.h"

namespace sorma {

// The process that sent a request. By TCP user, host, program and process are only what it claims.
struct Caller {
    std::string user, host, program, address;   // address: how it reached us, "unix" or "127.0.0.1:40312"
    std::int64_t process = 0;
    std::string known;                          // by TCP, what the kernel says: "192.168.7.21", "anna@127.0.0.1"
    std::string toText() const;                 // user@host program[process]; or KNOWN (claims user@host program[process])
    static const Caller& self();                // this process
};

// A client has come by a name; it has heard this of the name's owner: see bus/fence.h.
struct HeardEpoch {
    std::uint64_t fence = 0;                    // Fence::serial; 0: of none
    std::int64_t epoch = 0;                     // 0: nothing
};

class Client;
using ClientPointer = std::shared_ptr<Client>;      // bus/client.h
class Pending;
class Span;                         // bus/span.h

// A call context that outlives the stack on which it began. There is one for each request; all work that waits for it shares
// it.
class KeptCall {
public:
    KeptCall(ClientPointer client, Deadline deadline, std::uint64_t request, std::string behalf)
        : client(std::move(client)), deadline(deadline), request(request), behalf(std::move(behalf)) {}

    const ClientPointer client;                 // null: this process
    const Deadline deadline;
    const std::uint64_t request;
    const std::string behalf;                   // the client's own callers, as it says, nearest first

    std::string callers() const;                // for people: the client, and its callers
    // Has the caller cancelled it? Any thread. Memory order is relaxed, since no other data depends on it.
    bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
    // Cancel it, and all requests that were begun for it, also in other processes. May run callbacks of services.
    void cancel();
    // Note a request that is made for this one, so that it is cancelled with it.
    void begun(const std::shared_ptr<Pending>& pending);
    std::uint32_t subTime = 0;                  // [us] that its calls to other processes took, added up
    std::shared_ptr<Span> span;                 // of its trace; null: it has none
    HeardEpoch heard;

private:
    std::atomic<bool> cancelled_{false};
    std::vector<std::weak_ptr<Pending>> begun_;
};
using KeptCallPointer = std::shared_ptr<KeptCall>;

// The context of the code that runs while this exists. It lives on the stack.
class CallContext {
public:
    // A request begins. It inherits nothing from the requests below it on the stack.
    // client: null for this process; client and behalf must outlive this.   request: its number, 0: it has none yet.
    CallContext(const ClientPointer& client, Deadline deadline, std::uint64_t request, const std::string& behalf);
    CallContext(ClientPointer&& client, Deadline deadline, std::uint64_t request, const std::string& behalf) = delete;
    CallContext(const ClientPointer& client, Deadline deadline, std::uint64_t request, std::string&& behalf) = delete;
    // Work that waited continues. null: outside of any request.
    explicit CallContext(const KeptCallPointer& kept);
    ~CallContext();
    CallContext(const CallContext&) = delete;
    CallContext& operator=(const CallContext&) = delete;

    // While this exists there is no context. For event loops: the work that they call has nothing to do with the present
    // request.
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
    static Deadline currentDeadline();          // none outside of any request
    // The deadline for a call to another process: a little earlier than the request's (a tenth of the time left, 0.1 s at
    // most). So this process can still report which daemon did not answer.   now: [ns]
    static Deadline deadlineForCalls(std::int64_t now);
    static const Caller& currentCaller();       // Caller::self() outside of any request
    static std::string currentCallers();        // for people: the caller, and its callers as it says
    static PrincipalPointer currentPrincipal(); // who is charged; null: the owner
    static ClientPointer currentClient();       // null when the request comes from this process
    // The request's number. A request that is made for another one has the number of that one. A request without a number
    // gets one now. 0 outside of any request.
    static std::uint64_t currentRequest();
    static bool currentCancelled();             // the caller has cancelled it, or its deadline has passed
    static bool currentGivenUp();               // the caller has cancelled it
    static KeptCallPointer keep();              // the present context, for work that waits; null outside of any request
    static std::uint64_t newRequest();          // a number that almost certainly no other request has, here or elsewhere

    const ClientPointer& client;
    const Deadline deadline;
    const std::string& behalf;
    std::atomic<bool> cancelled{false};         // the caller has cancelled it. Work that takes long may read it and stop early
    std::uint32_t subTime = 0;                  // [us] spent in calls to other processes since this began
    std::shared_ptr<Span> span;                 // of its trace: calls that are made now are below it; null: it has none
    HeardEpoch heard;
    bool elsewhere = false;                     // a fence has refused it: the client should look for another daemon
    std::uint32_t waitedForOthers() const;      // [us] the same, with the time of its parts that waited
    void cancel();                              // by the caller; as KeptCall::cancel

private:
    static const ClientPointer kThisProcess;
    static const std::string kNobody;
    std::uint64_t request_;                     // 0: nobody has asked for its number yet
    KeptCallPointer kept_;
    CallContext* outer_;
};

}  // namespace sorma
