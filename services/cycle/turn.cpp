#include "turn.h"

namespace cycle {

Turn::Turn() {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&priorityLock_, &attributes);
    pthread_mutexattr_destroy(&attributes);
}

Turn::~Turn() { pthread_mutex_destroy(&priorityLock_); }

Turn::Word Turn::quiet(Word w) {
    while (w & kActing) {
        word_.wait(w, INT64_MAX);
        w = word_.load();
    }
    return w;
}

bool Turn::begin() {
    for (;;) {
        Word w = word_.load();
        if (holder(w) != nobody) return false;
        Word next = (((w & kNumber) + kOneTick) & kNumber) | (w & kWaiting) | tick;
        if (word_.exchange(w, next)) return true;
    }
}

// The kernel gives the request this thread's priority as long as this thread waits for the mutex.
void Turn::waitForRequest() {
    pthread_mutex_lock(&priorityLock_);
    pthread_mutex_unlock(&priorityLock_);
}

bool Turn::enterAction() {
    for (;;) {
        Word w = word_.load();
        if (w & kLate) return false;
        if (word_.exchange(w, w | kAction)) return true;
    }
}

bool Turn::leaveAction() {
    for (;;) {
        Word w = word_.load();
        if (w & kLate) return false;        // and it stays so until the tick ends, or for ever
        if (word_.exchange(w, w & ~kAction)) return true;
    }
}

bool Turn::awaitWatchdog() { return quiet(word_.load()) & kLate; }

bool Turn::enterEnd() {
    for (;;) {
        Word w = quiet(word_.load());
        if (w & kAbandoned) return false;
        if (word_.exchange(w, w | kAction)) return true;
    }
}

bool Turn::end(bool late) {
    for (;;) {
        Word w = word_.load();
        if ((w & (kActing | kAbandoned)) || ((w & kLate) && !late)) return false;
        if (word_.exchange(w, (w & kNumber) | (w & kWaiting) | nobody)) return true;
    }
}

void Turn::offer(std::int64_t keepOpen) {
    word_.wake();
    for (Word w; w = word_.load(), holder(w) == nobody && (w & kWaiting) && nanoseconds() < keepOpen;) word_.wait(w, keepOpen);
}

bool Turn::finish() {
    for (;;) {
        Word w = word_.load();
        if (holder(w) == request) return false;
        if (word_.exchange(w, (w & kNumber) | ended)) return word_.wake(), true;
    }
}

void Turn::upgrade() {
    for (;;) {
        Word w = quiet(word_.load());
        if (w & kAction) return;
        if (word_.exchange(w, w | kAction)) return;
    }
}

bool Turn::release(bool late) {
    for (;;) {
        Word w = word_.load();
        if ((w & kActing) || ((w & kLate) && !late)) return false;
        if (!word_.exchange(w, w & kNumber)) continue;
        pthread_mutex_unlock(&priorityLock_);
        return true;
    }
}

bool Turn::waitForEnd(std::int64_t until) {
    for (Word w; holder(w = word_.load()) != ended; word_.wait(w, until))
        if (nanoseconds() >= until) return false;
    return true;
}

bool Turn::waitForWatcher(std::int64_t until) {
    for (Word w; (w = word_.load()) & kActing; word_.wait(w, until))
        if (nanoseconds() >= until) return false;
    return true;
}

bool Turn::abandon(bool& withAction) {
    for (;;) {
        Word w = word_.load();
        if (holder(w) != tick) return false;
        withAction = w & kAction;
        if (word_.exchange(w, w | kLate | kAbandoned)) return true;
    }
}

Turn::Claim Turn::declareLate(Word seen) {
    for (;;) {
        Word w = word_.load();
        if (((w ^ seen) & (kNumber | kHolder)) || (w & kLate) || (holder(w) != tick && holder(w) != request)) return Claim::none;
        if (word_.exchange(w, w | kLate | kActing)) return w & kAction ? Claim::late : Claim::mayAct;
    }
}

void Turn::acted() {
    for (;;) {
        Word w = word_.load();
        if (!word_.exchange(w, w & ~kActing)) continue;
        word_.wake();
        return;
    }
}

}  // namespace cycle
