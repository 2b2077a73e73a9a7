// turn.h -- says which thread may use the objects of a cycle, in one word that all threads change by compare-and-swap.
//
// The turn belongs to nobody (between two ticks), to a tick, or to a request. The watchdog may declare the present turn
// late. Then no further step of the tick begins. The watchdog may execute the safe action, unless the holder of the turn may be
// using its object. So only one thread executes an object, and the output of the safe action stays: the
// tick executes the safe action once more at its end.
//
//     tick n:     begin, then for each step  enterAction / late / leaveAction,  awaitWatchdog, enterEnd, end
//     request:    ask, upgrade, release       (the SORM's thread; by a mutex it inherits the priority of a tick that waits for it)
//     watchdog:   declareLate, acted
//
// The number of the tick is in the word, so that the watchdog never declares the next tick late when it has looked at the
// one before. The number counts to 2^25, which takes hours; the watchdog looks many times a second.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>

#include "futex.h"

namespace cycle {

class Turn {
public:
    enum Holder : std::uint32_t { nobody = 0, tick = 1, request = 2, ended = 3 };
    using Word = std::uint32_t;

    Turn();
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

    static Holder holder(Word w) { return Holder(w & 3); }
    Word look() const { return word_.load(); }

    void open() { word_.set(nobody); }      // ticks may begin

    // ---- the runner's thread ----

    // Begin a tick. False: a request has the turn; waitForRequest() returns when it is over.
    bool begin();
    void waitForRequest();
    // Was the present tick declared late? Then begin no other step. No other data depends on it.
    bool late() const { return word_.peek() & kLate; }
    // Call these before and after a step that may use the safe action's object. If enterAction is false, the tick is
    // late: do not execute the step. If leaveAction is false, it has become late during the step.
    bool enterAction();
    bool leaveAction();
    // Wait until the watchdog has finished with the tick. True: it is late.
    bool awaitWatchdog();
    // The steps are over; from now on this thread may use the safe action's object. False: the tick was abandoned.
    bool enterEnd();
    // End the tick. late: this thread knows that it is late. False: it has become late meanwhile, or was abandoned.
    bool end(bool late);
    // Was the tick abandoned? And does this thread keep the safe action's object then?
    bool abandoned() const { return word_.load() & kAbandoned; }
    bool hasAction() const { return word_.load() & kAction; }
    // Between two ticks: let a request that waits have the turn; wait for it to begin until a time [ns].
    bool requestWaits() const { return word_.peek() & kWaiting; }
    void offer(std::int64_t keepOpen);
    // Ticks and turns have ended. False: a request has the turn.
    bool finish();

    // ---- the SORM's thread ----

    // Ask for the turn, and wait for it until a time on the monotonic clock [ns].   fits(waited): is there enough time now
    // before the next tick? If not, the runner calls offer() when there is. waited: this thread has waited in
    // here.   action: the request may use the safe action's object.   refused: the time is over, and nothing has happened.
    // free: there are no ticks any more; do not call release().
    enum class Answer { granted, refused, free };
    template <class Fits> Answer ask(Fits fits, bool action, std::int64_t until);
    void upgrade();                         // the request is going to use the safe action's object after all
    // End the turn. late: this thread knows that it was declared late. False: it has become late meanwhile.
    bool release(bool late);
    // Wait until the ticks have ended. False: the time is over.
    bool waitForEnd(std::int64_t until);
    bool waitForWatcher(std::int64_t until);    // false: time is up
    // Abandon the present tick, which hangs. withAction: its thread keeps the safe action's object. False: the tick has just
    // ended.
    bool abandon(bool& withAction);

    // ---- the watchdog's thread ----

    // Declare the turn late that was seen in `w`. Its holder then waits for acted() before it ends the turn. mayAct: until
    // acted() only this thread uses the safe action's object. none: that turn is over.
    enum class Claim { none, late, mayAct };
    Claim declareLate(Word w);
    void acted();

private:
    static constexpr Word kHolder = 3;
    static constexpr Word kAction = 4;      // the holder of the turn may be using the safe action's object
    static constexpr Word kLate = 8;
    static constexpr Word kActing = 16;     // the watchdog executes the safe action, or reports
    static constexpr Word kWaiting = 32;    // a request waits for offer()
    static constexpr Word kAbandoned = 64;
    static constexpr Word kOneTick = 128;
    static constexpr Word kNumber = ~Word(127);

    Word quiet(Word w);                     // waits while the watchdog acts

    Futex word_{ended};
    pthread_mutex_t priorityLock_;                // with priority inheritance; held by a request while it has the turn
};

template <class Fits> Turn::Answer Turn::ask(Fits fits, bool action, std::int64_t until) {
    for (bool waited = false;;) {
        if (pthread_mutex_trylock(&priorityLock_) != 0) {
            waited = true;
            pthread_mutex_lock(&priorityLock_);
        }
        Word w = word_.load();
        if (holder(w) == nobody && fits(waited) && word_.exchange(w, (w & kNumber) | request | (action ? kAction : 0)))
            return Answer::granted;
        pthread_mutex_unlock(&priorityLock_);     // a thread that did not get the turn must not hold it
        w = word_.load();
        if (holder(w) == ended) return Answer::free;
        bool up = nanoseconds() >= until;
        Word next = up ? w & ~kWaiting : w | kWaiting;
        if (w != next && !word_.exchange(w, next)) continue;
        if (up) return Answer::refused;
        if (holder(w) == nobody && fits(waited)) continue;
        word_.wait(next, until);
        waited = true;
    }
}

}  // namespace cycle
