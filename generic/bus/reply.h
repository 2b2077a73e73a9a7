// reply.h -- a request whose answer comes later: Reply for the service that owes it, Future for the caller who waits.
//
// A service that needs time takes the request over, returns from exec, and completes it when it can:
//
//     void exec(Message& m) override {
//         Reply reply = later(m);                     // m has moved into reply.message()
//         reply.onCancel([this] { arm_.halt(); });    // the caller gave up, died, or its deadline has passed
//         arm_.whenThere([reply] { reply.message().floats = ...; reply.complete(); });    // event, timer, thread
//     }
//
// A caller has many requests under way at once:
//
//     Future a = left->async(Method::exec, request), b = right->async(Method::exec, request);
//     a.wait(), b.wait();                             // or a.then([](Future f) { ... });
//
// Threads: complete, fail and cancelled may be used by any thread, and the message by the one that is going to complete;
// everything else belongs to the SORM's thread, where all callbacks run.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "bus/budget.h"
#include "bus/client.h"
#include "bus/call.h"
#include "bus/loop.h"
#include "bus/message.h"
#include "bus/reference.h"

namespace sorma {

class Sorm;

// What both sides share.
class Pending : public std::enable_shared_from_this<Pending> {
public:
    // Brings a request of the caller's forward that something else than our own loop completes: a connection.
    class Carrier {
    public:
        virtual ~Carrier() = default;
        virtual void drive(Pending& pending, Deadline deadline) = 0;    // block until it is answered, or the deadline
        virtual void cancelled(Pending& pending) = 0;                   // tell those who execute it
        virtual int descriptor() const = 0;     // readable when there is something to drive; -1: not now
        virtual Trail overdue(Pending& pending) = 0;                    // what to say when its deadline has passed
    };

    // asker: the request on whose behalf it is made; null: none. own: the context in which it is executed, when there is
    // one already; it is cancelled with this.
    Pending(Sorm& sorm, Deadline deadline, KeptCallPointer asker, KeptCallPointer own);
    ~Pending();

    Message message;                    // the request; when it is answered, the result
    Trail failure;                      // why it failed, when it did
    const Deadline deadline;
    const KeptCallPointer asker;
    KeptCallPointer own;
    const ClientPointer& client() const;            // null: this process
    // Of the request: what its service publishes meanwhile carries it, in other processes as well when somebody in this one
    // listened when it was begun. A request on behalf of another one has that one's.
    std::uint64_t number();
    std::int64_t sent = 0;              // [ns] when it went to another process, for the times of its asker; 0: it did not
    Charge charge;                      // for what it makes a daemon keep; it ends with the answer
    Timer timer;                        // of its deadline, for whoever keeps that; it ends with the answer
    const std::shared_ptr<Mailbox> mailbox;
    Carrier* carrier = nullptr;
    std::uint32_t ticket = 0;           // the carrier's own
    bool relayed = false;               // somebody else than the owner has named the object
    std::string who;                    // the object, as messages name it
    Reference service;                  // which executes it, from its start until finish()

    bool answered() const { return answered_; }         // the caller has its answer
    bool failed() const { return !failure.empty(); }
    bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }   // a hint, it orders nothing

    // The answer, once; later ones are ignored. Then what waits for it is called.
    void answer();                                      // message is the result
    void answer(Trail trail);                           // it failed
    void whenAnswered(std::function<void()> callback);  // at once when it is
    // The caller wants no answer any more: it gets `why`, and the service is told. False: it was answered already.
    bool cancel(Trail why);
    void expire();                                      // its deadline has passed
    void onCancel(std::function<void()> callback);      // at once when it is cancelled

    // The service has done with it, whatever the caller has heard: serial objects take the next request.
    void finish();

private:
    void settle();
    std::atomic<bool> cancelled_{false};
    bool answered_ = false;
    std::uint64_t number_ = 0;
    std::vector<std::function<void()>> whenAnswered_;
    std::function<void()> onCancel_;
};

using PendingPointer = std::shared_ptr<Pending>;

// The service's side. Copies are the same reply; when the last one goes without an answer, the caller is told so.
class Reply {
public:
    Reply() = default;
    explicit Reply(PendingPointer pending);

    explicit operator bool() const { return promise_ != nullptr; }
    Message& message() const;
    void complete() const;                              // with what message() holds
    void fail(const std::exception& error) const;       // an Error with its trail, or any other exception
    bool cancelled() const;                             // nobody waits any more: stop early, then complete or fail
    void onCancel(std::function<void()> callback) const;
    bool answered() const;                              // the caller has it already, or has given up
    Deadline deadline() const;
    const ClientPointer& client() const;                // null: this process

private:
    struct Promise;
    std::shared_ptr<Promise> promise_;
};

// The caller's side. Copies are the same future.
class Future {
public:
    Future() = default;
    explicit Future(PendingPointer pending) : pending_(std::move(pending)) {}

    explicit operator bool() const { return pending_ != nullptr; }
    bool done() const { return pending_->answered(); }
    // Block until the answer is there; then as often as one likes. Throws what the call failed with, COMM TIMEOUT when
    // the deadline given here passes first (the call goes on). Runs an event loop only for an object of this process
    // that answers from an event.
    Message& wait(Deadline deadline = {}) const;
    Message& result() const;                            // without waiting: fails with FUTURE PENDING
    // Give up: the caller gets COMM CANCELLED, the service may stop early. False when it was answered before.
    bool cancel() const;
    void then(std::function<void(Future)> callback) const;      // from the loop, when it is done
    const PendingPointer& pending() const { return pending_; }

private:
    PendingPointer pending_;
};

}  // namespace sorma
