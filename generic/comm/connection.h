// connection.h -- the connection of this process to one daemon, as proxies see it.
//
// Proxies share it when their names resolve to the same address by the same rule (see resolve in bus/name.h). The rule decides
// which address a reconnect uses. Its parts:
//
//     link       the line: connects, greets, carries records, connects again
//     calls      requests that are answered: slots, numbers, what became of them
//     oneways    requests that are not
//     events     subscriptions, and the health of the daemon
//
// Threads:   belongs to the thread of its SORM.
// Blocking:  a blocking call never enters an event loop. The loop delivers later what arrives for others meanwhile.
// Callbacks: they come from the reactor's turn or from the mailbox. A blocking call runs no callbacks but those of the
//            answer that it waits for, onRestart and whenDropped. A callback may begin calls; it must not block while
//            inEvents() is true.
// Owner:     proxies share it. It also keeps itself alive while begun calls or one-way requests are under way.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "comm/calls.h"
#include "comm/events.h"
#include "comm/link.h"
#include "comm/oneways.h"

namespace sorma {

class Connection final : private Link::User, public std::enable_shared_from_this<Connection> {
public:
    // Connects at the first call, not here. who: the name of the daemon in messages, the text after @.   locate: returns the
    // address that the dictionary has now; it is called for each attempt to connect and may throw Error.
    Connection(std::string who, std::function<Address()> locate, std::shared_ptr<const Settings> settings, std::shared_ptr<Reactor> reactor,
               std::shared_ptr<Mailbox> mailbox);
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    // Call a service of the daemon. m is the request and becomes the reply. Blocks until the reply or the deadline, connects
    // when need be. Throws Error: the daemon's trail, or an error of errors.h. name: of the object, as the daemon knows
    // it.   relayFor: who chose the name, when it was not the owner of this process. now: the time from which the deadline was
    // computed [ns, monotonic]; 0: the clock is read.
    void call(std::string_view name, Method method, Message& m, Deadline deadline, const PrincipalPointer& relayFor = nullptr, std::int64_t now = 0) {
        if (++quick_ == kQuick) [[unlikely]] hurry();
        calls_.call(name, method, m, deadline, relayFor, now);
    }

    // The same in two steps, so that many calls can be in flight. A ticket is good for one collect, whose message receives
    // the reply. Calls are sent at flush, at collect, or when 32 kB have gathered. submit may block to connect and throws as
    // call does, and has the same now.
    using Ticket = Calls::Ticket;
    Ticket submit(std::string_view name, Method method, const Message& m, Deadline deadline, std::int64_t now = 0) {
        return calls_.submit(name, method, m, deadline, now);
    }
    void flush(Deadline deadline) { calls_.flush(deadline); }
    void collect(Ticket ticket, Message& m) { calls_.collect(ticket, m); }
    // Would collect return at once? Looks at what has been read, never at the socket.
    bool arrived(Ticket ticket) { return calls_.arrived(ticket); }

    // Begin a call. The message of pending is the request; pending is answered when the call is over, from the loop. Never
    // throws, failures are answers too. May block for 10 ms while it connects, and longer while a host's name is looked up;
    // inBackground() avoids the 10 ms. The connection lives as long as there are such calls.
    void begin(const PendingPointer& pending, const std::string& name, Method method) { calls_.begin(pending, name, method); }
    // Send a request that gets no reply. If the connection is broken, the request waits for the next one; a request that is
    // never sent is reported to whenDropped. The call may block before the first connection, until there is one (Settings::timeout,
    // 25 s). Later it may block while more than Settings::onewayQueue bytes wait, for Settings::onewayWait (1 s); but never inside
    // the reactor's turn. If there is no room then, it throws COMM LIMIT, and the request is not sent.
    void oneway(const std::string& name, Method method, const Message& m, const PrincipalPointer& relayFor = nullptr);
    // At the end of the program: send the one-way requests that wait. Blocks until then or the deadline. Returns a sentence
    // about those that were not sent; empty: all were sent.
    std::string finish(Deadline deadline);
    // Subscribe to events of an object of the daemon. Blocks until the daemon has agreed. Throws the daemon's refusal, or as
    // call does. keep: events that are kept while the listener does not run; then the oldest are lost and counted. The
    // listener is called from the loop, until the result is deleted. The result keeps the connection alive.
    std::unique_ptr<Listening> listen(std::string name, std::string pattern, std::size_t keep, Listener listener, Deadline deadline,
                                      const PrincipalPointer& relayFor = nullptr) {
        return events_.listen(std::move(name), std::move(pattern), keep, std::move(listener), deadline, relayFor);
    }
    // The state of the daemon; it answers while it is busy, too. Blocks. Throws as call does.
    wire::Health health(Deadline deadline) { return events_.health(deadline); }

    // ---- for observers, which must never wait ----

    // From now on begin() does not block for the 10 ms that it otherwise waits for a connection.
    void inBackground() { calls_.background = true; }
    // Called from the loop after the connection was made or lost. May be empty.
    std::function<void()> changed;
    // Ask for the state. told is called from the loop; never, when there is no connection or it breaks.
    void askHealth(std::function<void(const wire::Health&)> told) { events_.askHealth(std::move(told)); }
    // As listen, without waiting. Call it while connected; it subscribes again on each later connection. The listener gets a
    // refusal as the event sorma.refused. existing: do not make the object if the daemon does not have it.   relayFor: as of a call.
    std::unique_ptr<Listening> listenLater(std::string name, std::string pattern, std::size_t keep, Listener listener, bool existing,
                                           const PrincipalPointer& relayFor = nullptr) {
        return events_.listenLater(std::move(name), std::move(pattern), keep, std::move(listener), existing, relayFor);
    }
    // Is this inside the reactor's turn for this connection? Then nothing may block.
    bool inEvents() const { return link_.inEvents(); }

    void connect(Deadline deadline) { calls_.connect(deadline); }        // now rather than at the first call; blocks, throws as call does
    void ping(Deadline deadline);                       // a call that does nothing; blocks, throws as call does
    void close(const std::string& reason);              // returns at once; calls that were sent fail with COMM LOST
    void end();                                         // removes what is under way; no caller and no listener is told

    // Called at once, from inside the function that found out, for one-way requests that will never be sent. May be empty;
    // must not call the connection.
    std::function<void(Trail)>& whenDropped = oneways_.whenDropped;

    // callback: called when another daemon than before has answered, before anything else is sent to it. It may call
    // restore, and nothing else of the connection; what it throws is ignored. Returns a number for cancelRestart; cancel it
    // before what the callback uses is deleted.
    std::uint64_t onRestart(std::function<void()> callback);
    void cancelRestart(std::uint64_t number) { restarted_.erase(number); }
    // A request that gives an object of the daemon its state back. Requests of any other kind wait until it is answered, so
    // that none of them meets an object without its state. It is sent with the next request, or in onRestart at once. Never
    // blocks.   done: gets the reply, or why it failed (then failure is not empty); it is called from inside the function that
    // has found out, and may call restore. A request that waits when another daemon answers is forgotten: onRestart makes it again.
    // owner: for cancelRestore, which forgets its requests.
    using Restored = Calls::Restored;
    void restore(const void* owner, std::string name, Method method, std::vector<std::string> words, PrincipalPointer relayFor, Restored done) {
        calls_.restore(owner, std::move(name), method, std::move(words), std::move(relayFor), std::move(done));
    }
    void cancelRestore(const void* owner) { calls_.cancelRestore(owner); }

    const std::string& who() const { return link_.who(); }
    Trail& remarks() { return link_.remarks; }          // warnings about the line; for who answers next to add, and to clear
    bool connected() const { return link_.live(); }
    // Counts what makes facts about objects doubtful (bus/ahead.h): the daemon has said so, or the connection was lost. Facts hold
    // while there is a connection and this is as before they were asked for.
    std::uint64_t doubts() const { return doubts_; }
    // Ask for the facts of an object: a question that has no slot and no deadline, so that nobody waits because of it. False: not now.
    // told: called from inside the function that reads the answer; never when the connection breaks before.
    bool askFacts(std::string_view name, const PrincipalPointer& relayFor, std::function<void(Message& answer)> told) {
        return events_.askFacts(name, relayFor, std::move(told));
    }
    void look() { calls_.lookNow(); }                   // take what has come by now; never blocks. May find that the connection is lost
    const wire::Welcome& daemon() const { return link_.daemon(); }     // who answered last; boot 0: nobody yet
    std::uint64_t boots() const { return link_.boots(); }      // daemons seen so far: changes when another one answers
    void follow(std::shared_ptr<const std::int64_t> epoch) { link_.follow(std::move(epoch)); }      // as the link's
    // The directory has told of a change. When the name has another owner than the line was made to, the former one, which may serve other
    // objects, has a second to say that it lives. Otherwise the line is lost: nobody waits for a host that is cut off.
    void heedOwner();
    std::string facts() const;                          // for people, a line for each fact
    std::string row() const;                            // a list, see sorm DBX -inventory connections
    const wire::Times& lastTimes() const { return calls_.lastTimes(); }     // of the last reply

private:
    static constexpr int kQuick = 1024;                 // calls
    static constexpr std::int64_t kWithin = 1'000'000'000;      // [ns]
    static constexpr std::int64_t kOwed = 1'000'000'000;        // [ns] for a former owner to answer

    // ---- Link::User ----
    std::shared_ptr<void> keep() override { return weak_from_this().lock(); }
    Address locate() override { return locate_(); }
    std::string whom() const override { return calls_.whom(); }
    void hurry();
    bool wanted() const override { return calls_.underway() || events_.any() || oneways_.waiting(); }
    void welcomed(bool other) override;
    void replied(XdrReader& r, std::uint32_t xid) override {
        if (r.good() && (xid & Slots::kControl) == Slots::kControl) [[unlikely]] events_.replied(r, xid);
        else calls_.replied(r, xid);
    }
    void event(XdrReader& r) override { events_.event(r); }
    void outdated() override { ++doubts_; }
    void traced(XdrReader& r) override { events_.traced(r); }
    void wrote(Link::Tag tag) override;
    void unsent(Link::Tag tag, Buffer& bytes, std::size_t taken) override {
        if (tag == Oneways::kTag) oneways_.unsent(bytes, taken);
    }
    void ended() override;
    void unanswered(const Link::Verdict& verdict) override { calls_.unanswered(verdict); }
    void failed(const Error& why, bool final) override;
    void turned(bool blocking) override { calls_.turned(blocking); }

    void resumed(bool fresh);
    void update();                                      // keep itself alive while something is under way
    void tellChange();

    const std::function<Address()> locate_;
    const std::shared_ptr<const Settings> settings_;
    const std::shared_ptr<Mailbox> mailbox_;
    const std::shared_ptr<Reactor> reactor_;
    Link link_;
    Calls calls_;
    Oneways oneways_;
    Events events_;
    std::shared_ptr<Connection> keep_;      // the own reference, while something is under way
    std::map<std::uint64_t, std::function<void()>> restarted_;      // as onRestart
    std::uint64_t nextRestart_ = 1;
    std::uint64_t doubts_ = 0;
    std::int64_t owner_ = 0;                // epoch of the name when the line was made, or the daemon was asked
    Timer owed_;                            // it owes an answer until then
    int quick_ = 0;                         // calls since quickSince_
    std::int64_t quickSince_ = 0;           // [ns]
};

}  // namespace sorma
