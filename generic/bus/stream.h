// stream.h -- what a service object publishes, and who listens.
//
// An object publishes whenever it has something to tell; without a listener that costs one look at a pointer. Each
// listener has its own place to keep what it has not taken yet, bounded by itself: publishing never waits for anybody.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"

namespace sorma {

class Service;

struct Event {
    std::string_view object;            // who publishes
    std::string_view name;              // what: words separated by dots, "object.made"
    const Message& message;
    std::int64_t time;                  // microseconds since 1970
    std::uint64_t serial;               // differs from that of every other event of the process
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
    void publish(const Service& from, std::string_view event, const Message& m);

private:
    struct Entry {
        Subscriber* subscriber;         // null: it left while events were handed out
        std::string pattern;
    };
    std::vector<Entry> subscribers_;
    int handing_ = 0;
};

}  // namespace sorma
