// request.h -- the one entrance for requests, and those who observe it.
//
// Each request for an object passes Service::start, by whatever door it comes: a Tcl command, a peer's call, the text
// dispatcher, work that waited, a reference. In order it is
//
//     observed > admitted (rights, gone, fenced, locked) > executed > observed > its trail noted
//
// A door that gets a name finds or makes the object with Sorm::get. Deadline and budget come before that, since they belong
// to the door: a peer's are in Peer::execute, those of work that waited in Service::perform.
//
// An Observer gets the requests that it wants, and their answers. Statistics and audit (bus/bookkeeping.h) are always there:
// they want CTRL, DBX, and one EXEC in 64. The monitor (bus/monitor.h) wants all. An EXEC that no observer wants pays nothing:
// objects have a bit among those that are tested anyway, and a call by reference stays a virtual call. Each object counts its
// EXECs and errors itself. The ticks of a real-time owner are not observed, only counted: an observer may allocate, and a tick
// must not.
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"
#include "bus/reply.h"

namespace sorma {

class Service;
class Sorm;
struct Event;        // bus/stream.h

// A request on its way.
struct Passage {
    Service* service;               // null: it has reached no object
    std::string_view object;        // its own name; or the name as it came, when no object was reached
    Method method;
    std::uint8_t wishes;            // those of Observer::Wish that it fits
    std::uint64_t number = 0;       // counts the observed requests of this SORM
    std::int64_t begun = 0;         // [ns] by the monotonic clock: when it came
    // For people: who has sent it, and that one's callers. The text is made when an observer asks for it, and then kept.
    const std::string& callers() const;
    mutable std::string callersText = {};       // what callers() has made
};

class Observer {
public:
    // Which requests an observer wants.
    enum Wish : std::uint8_t {
        all = 1,
        ctrl = 2,
        dbx = 4,
        sample = 8,                 // of EXEC, one in 64 of each object
        events = 16,                // no requests: what objects of this process publish, also when nobody listens
    };
    explicit Observer(std::uint8_t wishes = all) : wishes(wishes) {}
    virtual ~Observer() = default;
    const std::uint8_t wishes;
    // A request has come. Nobody has asked for its rights yet. Must not throw, must not make requests.
    virtual void came(const Passage& passage, const Message& request) = 0;
    // Its answer is here, perhaps much later: a reply, or code -1 with the trail of a refusal.   ran: [ns] since it came.
    virtual void answered(const Passage& passage, const Message& reply, std::int64_t ran) = 0;
    // An object publishes an event. Must not throw, must not make requests.
    virtual void published(const Event&) {}
};

// The observers of one SORM.
class Observers {
public:
    explicit Observers(Sorm& sorm) : sorm_(sorm) {}
    void add(Observer* observer);                   // also several times, and then removed as often; it must be removed before it is deleted
    void remove(Observer* observer);
    bool any(std::uint8_t wishes = Observer::all) const { return wishes_ & wishes; }    // does one want such requests?
    // A request that reached no object.
    void refused(std::string_view name, Method method, const Message& request, const Trail& why);
    void published(const Event& event);             // by an object

private:
    friend class Observation;
    Sorm& sorm_;
    std::vector<Observer*> list_;
    std::uint8_t wishes_ = 0;       // of all of them
    std::uint64_t number_ = 0;
};

// One request that is observed: made when it comes; then one of the others is called. The passage's names must live until then.
class Observation {
public:
    Observation(Observers& observers, Passage&& passage, const Message& request);
    void answered(const Message& reply);
    void failed(const Trail& why);
    void later(const PendingPointer& pending);      // the object answers later
    Observation(const Observation&) = delete;
    Observation& operator=(const Observation&) = delete;

private:
    Observation(Observers& observers, Passage passage, std::string_view name);
    Observers& observers_;
    Passage passage_;
};

}  // namespace sorma
