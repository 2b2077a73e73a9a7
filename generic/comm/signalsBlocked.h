// signalsBlocked.h -- while this lives the calling thread gets no signal, and neither do threads that it starts, ever: signals are
// for the threads that were there before.
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
