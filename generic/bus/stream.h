// stream.h -- the events that a service object publishes, and their subscribers.
//
// An object may publish at any time. Without a subscriber that costs reading one pointer. Each subscriber has a bounded
// queue of its own, so publishing never waits for anybody.
//
// Threads: the SORM's, but for Listening::any().
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/kept.h"
#include "bus/loop.h"
#include "bus/message.h"
#include "bus/span.h"

namespace sorma {

class Service;

// An event while it is published. It is valid only during Subscriber::event().
struct Event {
    std::string_view object;            // name of the object that publishes it
    std::string_view name;              // words separated by dots: "object.made"
    const Message& message;
    std::int64_t time;                  // [us since 1970]
    std::uint64_t serial;               // number of the event, unique in the process
    std::uint64_t request;              // in which it was published: CallContext::currentRequest()
    TraceOrigin origin = {};            // when that is traced
};

// Gets the events of one object, inside the call that publishes them. It must unsubscribe before it is deleted, unless
// gone() was called.
class Subscriber {
public:
    virtual ~Subscriber() = default;
    virtual void event(const Event& event) = 0;         // copy what you need and return; must not throw, must not make requests
    virtual void gone() = 0;                            // the object was removed; this is unsubscribed already
    virtual std::string who() const;                    // for people, "anna@lab scott[4711]"; default: this process
};

// The subscribers of one object.
class Stream {
public:
    ~Stream();
    void add(Subscriber* subscriber, std::string pattern);      // pattern: as Tcl's string match
    bool remove(Subscriber* subscriber);                        // was it there?
    void each(const std::function<void(const Subscriber& subscriber, const std::string& pattern)>& tell) const;
    bool empty() const { return subscribers_.empty(); }
    // monitor: only for subscribers with a pattern that begins with "monitor" (bus/monitor.h).
    void publish(const Service& from, std::string_view event, const Message& m, bool monitor = false);
    // Send the last event of each name that matches to a new subscriber, the oldest first. Events are kept for up to 32
    // names, and up to 64 kB each.
    void replay(const Service& from, Subscriber* subscriber, std::string_view pattern) const;
    bool monitored() const { return monitors_ > 0; }

private:
    struct Entry {
        Subscriber* subscriber;         // null: it unsubscribed while an event was published
        std::string pattern;
    };
    struct Last {
        std::string name;
        Message message;
        std::int64_t time = 0;
        std::uint64_t serial = 0, request = 0;
        std::size_t heap() const { return heapOf(name) + heapOf(message); }
    };
    void keep(const Event& event, const Service& from);
    void removeUnsubscribed();
    std::vector<Entry> subscribers_;
    std::vector<Charged<Last>> last_;
    int handing_ = 0, monitors_ = 0;
};

// ---- for Service::listen, with objects here or in another process ----

struct Received {
    std::string object, name;
    Message message;
    std::uint64_t number = 0;           // counts the events of this subscription from 1, lost ones included
    std::int64_t lost = 0;              // events that were lost before this one; -1: unknown
    std::int64_t time = 0;              // [us since 1970]
    std::uint64_t request = 0;          // in which it was published, see Pending::number; 0: outside of any
    TraceOrigin origin = {};            // when that is traced
};
// Gets the object's own events, and these:
//     sorma.gone          the object was removed; no more events will come
//     sorma.reconnected   the connection broke and was made again; `lost` says how many events were missed
//     sorma.refused       no more events will come: the subscription could not be resumed, or the policy does not allow it any more;
//                         the text says why
using Listener = std::function<void(Received& event)>;

// A subscription. Delete it to end it; the listener is not called afterwards.
class Listening {
public:
    Listening() { count_.fetch_add(1, std::memory_order_relaxed); }
    virtual ~Listening() { count_.fetch_sub(1, std::memory_order_relaxed); }
    Listening(const Listening&) = delete;
    Listening& operator=(const Listening&) = delete;
    // Is there a subscription in this process? Any thread; memory order is relaxed, since no other data depends on it.
    static bool any() { return count_.load(std::memory_order_relaxed) > 0; }
private:
    static inline std::atomic<int> count_{0};
};

// Queue of events for a listener, which is called from the loop. It keeps at most `keep` events; then the oldest are lost
// and counted.
class Inbox : public std::enable_shared_from_this<Inbox> {
public:
    using Item = std::unique_ptr<Received>;
    // Events that were delivered: others use their memory again.
    class Spares {
    public:
        Item take();                    // its message is empty, the rest is what was there before
        void give(Item event);

    private:
        std::vector<Item> events_;
    };

    // spares: where delivered events go; several inboxes may share them. Null: nowhere.
    Inbox(std::shared_ptr<Mailbox> mailbox, std::size_t keep, Listener listener, std::shared_ptr<Spares> spares = nullptr)
        : mailbox_(std::move(mailbox)), spares_(std::move(spares)), keep_(keep), listener_(std::move(listener)) {}
    void push(Item event);
    void push(Received event) { push(std::make_unique<Received>(std::move(event))); }
    void close() { listener_ = nullptr; }

private:
    void deliver();
    void tell(const Listener& listener, Received& event);
    std::shared_ptr<Mailbox> mailbox_;
    std::shared_ptr<Spares> spares_;
    std::size_t keep_;
    Listener listener_;
    std::deque<Item> waiting_;
    bool scheduled_ = false;
};

}  // namespace sorma
