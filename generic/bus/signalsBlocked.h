// signalsBlocked.h -- keeps signals away from the threads that SORMA starts.
//
// A thread inherits the signal mask of the one that starts it. Make this object, then start the thread: the new thread never
// gets a signal, and the calling one gets them again when the object is deleted.
#pragma once

#include <pthread.h>
#include <signal.h>

namespace sorma {

class SignalsBlocked {
public:
    SignalsBlocked() {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
    SignalsBlocked(const SignalsBlocked&) = delete;

private:
    sigset_t before_;
};

}  // namespace sorma
