// stream.h -- what a service object publishes, and who listens.
//
// An object publishes whenever it has something to tell; without a listener that costs one look at a pointer. Each
// listener has its own place to keep what it has not taken yet, bounded by itself: publishing never waits for anybody.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/loop.h"
#include "bus/message.h"

namespace sorma {

class Service;

struct Event {
    std::string_view object;            // who publishes
    std::string_view name;              // what: words separated by dots, "object.made"
    const Message& message;
    std::int64_t time;                  // microseconds since 1970
    std::uint64_t serial;               // differs from that of every other event of the process
    std::uint64_t request;              // in which it was published: CallContext::currentRequest()
};

// Someone who listens to one object. It says unsubscribe before it goes, unless gone() was called.
class Subscriber {
public:
    virtual ~Subscriber() = default;
    virtual void event(const Event& event) = 0;         // copy what is needed and return; no exception, no request
    virtual void gone() = 0;                            // the object has been removed; it has forgotten this subscriber
};

class Stream {
public:
    ~Stream();
    void add(Subscriber* subscriber, std::string pattern);      // pattern: as Tcl's string match
    void remove(Subscriber* subscriber);
    bool empty() const { return subscribers_.empty(); }
    // monitor: it tells of what passes, and is for those alone who have asked for that (bus/monitor.h).
    void publish(const Service& from, std::string_view event, const Message& m, bool monitor = false);
    // The last event of each name (of up to 32, and not beyond 64 kB each) is kept: hand those that match to a new subscriber,
    // the oldest first.
    void replay(const Service& from, Subscriber* subscriber, std::string_view pattern) const;
    bool monitored() const { return monitors_ > 0; }

private:
    struct Entry {
        Subscriber* subscriber;         // null: it left while events were handed out
        std::string pattern;
    };
    struct Last {
        std::string name;
        Message message;
        std::int64_t time;
        std::uint64_t serial, request;
    };
    void keep(const Event& event);
    void settle();
    std::vector<Entry> subscribers_;
    std::vector<Last> last_;
    int handing_ = 0, monitors_ = 0;
};

// ---- what a listener gets, from here or from another process: Service::listen ----

struct Received {
    std::string object, name;
    Message message;
    std::uint64_t number = 0;           // counts the events of this subscription from 1, lost ones included
    std::int64_t lost = 0;              // events between the one before and this; -1: some, nobody knows how many
    std::int64_t time = 0;              // microseconds since 1970
    std::uint64_t request = 0;          // in which it was published, see Pending::number; 0: outside of any
};
// Beside the object's own events there are: sorma.gone (it has been removed, no more will come), sorma.reconnected (after
// a broken connection; lost tells what was missed), sorma.refused (no more will come: it could not be resumed, or the policy
// does not allow it any more; text says why).
using Listener = std::function<void(Received& event)>;

// A subscription: it lasts as long as this.
class Listening {
public:
    Listening() { count_.fetch_add(1, std::memory_order_relaxed); }
    virtual ~Listening() { count_.fetch_sub(1, std::memory_order_relaxed); }
    Listening(const Listening&) = delete;
    Listening& operator=(const Listening&) = delete;
    static bool any() { return count_.load(std::memory_order_relaxed) > 0; }     // in this process; a hint, it orders nothing
private:
    static inline std::atomic<int> count_{0};
};

// Events on their way to a listener, called from the loop. Holds at most `keep`; the oldest go, and are counted.
class Inbox : public std::enable_shared_from_this<Inbox> {
public:
    Inbox(std::shared_ptr<Mailbox> mailbox, std::size_t keep, Listener listener)
        : mailbox_(std::move(mailbox)), keep_(keep), listener_(std::move(listener)) {}
    void push(Received event);
    void close() { listener_ = nullptr; }

private:
    void deliver();
    std::shared_ptr<Mailbox> mailbox_;
    std::size_t keep_;
    Listener listener_;
    std::deque<Received> waiting_;
    bool scheduled_ = false;
};

}  // namespace sorma
