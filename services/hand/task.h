// task.h -- the hand's control task: a cycle with the hand as its step, begun at the first need, and watched.
//
// Threads: the SORM's.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sorma.h>

#include "control.h"

namespace hand {

class Task {
public:
    struct Wanted {
        std::string prefix;                 // of all buffers' names
        double interval;                    // [s] from one tick to the next
        std::int64_t priority;
        bool labTime;                       // ticks are due by the other side's time
        Settings settings;
    };
    // rung: the control task has something to tell.   looked: from time to time; there: the other side is.
    Task(sorma::Service& hand, std::function<void()> rung, std::function<void(bool there)> looked)
        : hand_(hand), rung_(std::move(rung)), looked_(std::move(looked)) {}

    Control* control() const { return control_.get(); }         // null: it does not run
    // Begin. Fails with HAND HARDWARE when the other side is not there: without its time there would be no ticks. Fails with HAND TASK.
    void start(const Wanted& wanted);
    void needOtherSide();                   // fails with HAND HARDWARE; call it when the task runs
    void configure(std::vector<std::string> words);             // CTRL of the cycle
    void halt();                            // end, also before the hand's destruction; start() begins again

    const std::string& problem() const { return problem_; }     // with the other side
    sorma::Error whyEnded(bool there) const;                    // for a request that cannot be done now

private:
    bool heard();
    void watch();

    sorma::Service& hand_;
    const std::function<void()> rung_;
    const std::function<void(bool)> looked_;
    std::string prefix_, problem_;
    std::unique_ptr<Control> control_;
    sorma::Reference cycle_;
    sorma::Timer timer_;
};

}  // namespace hand
