// turn.h -- whose turn it is to use the objects of a cycle, in one word that all its threads change by compare-and-swap.
//
// Nobody's between two ticks, a tick's, or a request's. Whoever watches over them may declare the present turn late: then
// no further step of the tick begins, and the watcher may take the safe action, unless the one whose turn it is may be in
// the middle of the safe action's object. So an object is executed by one thread, and what the safe action has written
// is not written over: the tick takes it once more when it ends.
//
//     tick n:     begin, then for each step  enterAction / late / leaveAction,  settle, enterEnd, end
//     request:    ask, upgrade, release       (the SORM's thread; a mutex lends it the priority of a tick that waits)
//     watchdog:   declareLate, acted
//
// The number of the tick is in the word, so that a watcher who looked at one tick never declares the next one late. It
// counts to 2^25, which is hours; a watcher looks many times a second.
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

    void open() { word_.set(nobody); }      // there are going to be ticks

    // ---- the runner's thread ----

    // Begin a tick, when no request has the turn. False: one has; waitForRequest() returns when that is over.
    bool begin();
    void waitForRequest();
    // The present tick has been declared late: begin no other step. Orders nothing.
    bool late() const { return word_.peek() & kLate; }
    // Around a step that may touch the safe action's object. False: the tick is late: do not enter; it has become late inside.
    bool enterAction();
    bool leaveAction();
    // Wait until no watcher is busy with the tick. True: it is late.
    bool settle();
    // The steps are over; from here on the safe action is this thread's. False: the tick has been given up.
    bool enterEnd();
    // End the tick. late: that it is so has been dealt with. False: it has become late meanwhile, or has been given up.
    bool end(bool late);
    // It has been given up; with it, the safe action's object?
    bool abandoned() const { return word_.load() & kAbandoned; }
    bool hasAction() const { return word_.load() & kAction; }
    // Between two ticks: let a request have the turn that waits for it, up to a time [ns] when it is kept open for it.
    bool requestWaits() const { return word_.peek() & kWaiting; }
    void offer(std::int64_t keepOpen);
    // No more ticks, and no more turns. False: a request has the turn.
    bool finish();

    // ---- the SORM's thread ----

    // Ask for the turn, before a time on the monotonic clock [ns]. fits: is there time now, between two ticks? If not, the runner
    // says when by offer(). It is told whether this thread has waited in here. action: the request may touch the safe action's object.
    // Refused: time is up, and nothing has happened. Free: there are no ticks any more, and nothing to release.
    enum class Answer { granted, refused, free };
    template <class Fits> Answer ask(Fits fits, bool action, std::int64_t until);
    void upgrade();                         // the request is going to touch it after all
    // Give the turn back. late: that it was declared so has been dealt with. False: it has become late meanwhile.
    bool release(bool late);
    // Wait for the end of all ticks. False: time is up.
    bool waitForEnd(std::int64_t until);
    bool waitForWatcher(std::int64_t until);    // false: time is up
    // The present tick hangs for ever: its thread will find that it is on its own. withAction: it keeps the safe action's object.
    // False: it has just ended.
    bool abandon(bool& withAction);

    // ---- who watches ----

    // Declare the turn late that was seen in `w`; whose turn it is then waits for acted() before the turn ends. May act: nobody
    // else is in the safe action's object until then.
    enum class Claim { none, late, mayAct };
    Claim declareLate(Word w);
    void acted();

private:
    static constexpr Word kHolder = 3;
    static constexpr Word kAction = 4;      // whose turn it is may be in the safe action's object
    static constexpr Word kLate = 8;
    static constexpr Word kActing = 16;     // a watcher is busy with it: takes the safe action, tells of it
    static constexpr Word kWaiting = 32;    // a request waits for an offer
    static constexpr Word kAbandoned = 64;
    static constexpr Word kOneTick = 128;
    static constexpr Word kNumber = ~Word(127);

    Word quiet(Word w);                     // waits while a watcher acts

    Futex word_{ended};
    pthread_mutex_t lender_;                // held by a request as long as it has the turn
};

template <class Fits> Turn::Answer Turn::ask(Fits fits, bool action, std::int64_t until) {
    for (bool waited = false;;) {
        if (pthread_mutex_trylock(&lender_) != 0) {
            waited = true;
            pthread_mutex_lock(&lender_);
        }
        Word w = word_.load();
        if (holder(w) == nobody && fits(waited) && word_.exchange(w, (w & kNumber) | request | (action ? kAction : 0)))
            return Answer::granted;
        pthread_mutex_unlock(&lender_);     // who has not got the turn must not be waited for
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
