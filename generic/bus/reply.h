// reply.h -- a request whose answer comes later: Reply for the service, Future for the caller.
//
// A service that needs time takes the request over, returns from exec, and completes the reply later:
//
//     void exec(Message& m) override {
//         Reply reply = later(m);                     // m has moved into reply.message()
//         reply.onCancel([this] { arm_.halt(); });    // the caller gave up, died, or its deadline has passed
//         arm_.whenThere([reply] { reply.message().floats = ...; reply.complete(); });    // event, timer, thread
//     }
//
// A caller may have many requests under way at a time:
//
//     Future a = left->async(Method::exec, request), b = right->async(Method::exec, request);
//     a.wait(), b.wait();                             // or a.then([](Future f) { ... });
//
// Threads:   any thread may call complete, fail and cancelled; the thread that will complete the reply may use its message.
//            All else belongs to the SORM's thread.
// Callbacks: they run on the SORM's thread. They may make requests; they must not throw.
// Owner:     Reply, Future and those who bring the request forward share one Pending.
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

// The state that both sides share.
class Pending : public std::enable_shared_from_this<Pending> {
public:
    // Carries a request to another process and brings its answer: a connection.
    class Carrier {
    public:
        virtual ~Carrier() = default;
        virtual void drive(Pending& pending, Deadline deadline) = 0;    // block until it is answered, or until the deadline
        virtual void cancelled(Pending& pending) = 0;                   // the caller has cancelled it: tell the other process
        virtual int descriptor() const = 0;     // can be read when there is something to drive; -1: not now
        virtual Trail overdue(Pending& pending) = 0;                    // the error when its deadline has passed
    };

    // asker: the request for which it is made; null: none.   own: the context in which it is executed, if there is one
    // already; it is cancelled with this.
    Pending(Sorm& sorm, Deadline deadline, KeptCallPointer asker, KeptCallPointer own);
    ~Pending();

    Message message;                    // the request; when it is answered, the result
    Trail failure;                      // why it failed, when it did
    const Deadline deadline;
    const KeptCallPointer asker;
    KeptCallPointer own;
    const ClientPointer& client() const;            // null: this process
    // The number of the request. Events that its service publishes meanwhile carry it; in other processes only if somebody
    // in this one listened when it was begun. A request that is made for another one has the number of that one.
    std::uint64_t number();
    std::int64_t sent = 0;              // [ns] when it went to another process, for the times of asker; 0: it did not
    std::shared_ptr<Span> span;         // of the asker's trace, see bus/span.h
    Charge charge;                      // for the memory that it needs in a daemon; released with the answer
    Timer timer;                        // see expireBy(); cancelled with the answer
    const std::shared_ptr<Mailbox> mailbox;
    Carrier* carrier = nullptr;         // null: an object of this process executes it
    PrincipalPointer relayFor;          // who has named the object, when it was not the owner
    std::string who;                    // name of the object, for messages
    Reference service;                  // the object that executes it, from its start until finish()
    std::uint32_t ticket = 0;           // for the carrier's own use; bound, cancelled_ and answered_ fill the gap after it
    bool bound = false;                 // it is only for the daemon that answers now, see Service::async

    bool answered() const { return answered_; }         // the caller has its answer
    bool failed() const { return !failure.empty(); }
    bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }   // any thread; no other data depends on it

    // Answer it, and call the callbacks of whenAnswered at once. Only the first answer counts.
    void answer();                                      // message is the result
    void answer(Trail trail);                           // it failed
    void whenAnswered(std::function<void()> callback);  // called at once when it is answered already
    // The caller wants no answer any more: it gets the error `why`, and then the service is told. False: it was answered
    // already.
    bool cancel(Trail why);
    void expire();                                      // its deadline has passed: cancel it
    void expireBy(Loop& loop);                          // when the deadline passes, from this loop
    void onCancel(std::function<void()> callback);      // called at once when it is cancelled already

    // The service has finished with it, also when the caller had its answer before. A serial object starts the next request.
    void finish();

private:
    void runCallbacks();
    std::atomic<bool> cancelled_{false};
    bool answered_ = false;
    std::uint64_t number_ = 0;
    std::vector<std::function<void()>> whenAnswered_;
    std::unique_ptr<std::function<void()>> onCancel_;       // a pointer: few have one, and thousands may be pending
};

using PendingPointer = std::shared_ptr<Pending>;

// The service's side. Copies are the same reply. When the last copy is deleted without an answer, the caller gets SERVICE
// FAILED.
class Reply {
public:
    Reply() = default;
    explicit Reply(PendingPointer pending);

    explicit operator bool() const { return promise_ != nullptr; }
    Message& message() const;                           // the request; change it into the result
    void complete() const;                              // answer with message(); once, others are ignored
    void fail(const std::exception& error) const;       // answer with an error: an Error with its trail, or any other exception
    bool cancelled() const;                             // nobody waits any more: stop early, then complete or fail
    void onCancel(std::function<void()> callback) const;    // of several only the last one
    // Make an EXEC of another object for this request: then() gets its answer, and completes this one or asks on. A failure
    // there or in then() is this one's answer; context is added to that error. Cancelling this one cancels that one.
    void ask(const Reference& object, Message request, std::function<void(Message&)> then, const Trail& context = {}) const;
    bool answered() const;                              // the caller has the answer already, or has cancelled
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
    // Block until the answer is there, and return it; may be called again. Throws the error of the call; COMM TIMEOUT when
    // the deadline given here passes first (the call goes on). The event loop runs only for an object of this process that
    // answers from an event.
    Message& wait(Deadline deadline = {}) const;
    Message& result() const;                            // the same without waiting: fails with FUTURE PENDING
    // Cancel the call: wait() fails with COMM CANCELLED, and the service may stop early. False when it was answered before.
    bool cancel() const;
    void then(std::function<void(Future)> callback) const;      // called from the loop when it is done
    const PendingPointer& pending() const { return pending_; }

private:
    PendingPointer pending_;
};

}  // namespace sorma
