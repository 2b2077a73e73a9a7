// detached.h -- starts a thread that nobody waits for.
//
// In place of std::thread::detach(). That one can read the descriptor of a thread that has just ended and freed it (glibc 2.36). A process
// crashed so twice in 500 runs of tests/embed/threads.cpp, at much load. This thread is detached from its beginning.
#pragma once

#include <pthread.h>

#include <memory>
#include <system_error>
#include <utility>

#include "bus/signalsBlocked.h"

namespace sorma {

// Calls work() in a thread that gets no signals. Throws std::system_error when there is none.
template <class F> void startDetached(F work) {
    auto kept = std::make_unique<F>(std::move(work));
    const auto run = [](void* f) noexcept -> void* {
        (*std::unique_ptr<F>(static_cast<F*>(f)))();
        return nullptr;
    };
    const SignalsBlocked blocked;
    pthread_t thread;
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    const int error = pthread_create(&thread, &attributes, run, kept.get());
    pthread_attr_destroy(&attributes);
    if (error != 0) throw std::system_error(error, std::generic_category(), "cannot start a thread");
    kept.release();                 // the thread has it
}

}  // namespace sorma
