// runner.h -- the thread of a cycle: a row of steps at a fixed period, and in the gaps what is asked of their objects.
//
// Three threads meet here. The runner's own executes the ticks and, between them, the work that the SORM's thread lends
// (bus/steering.h). The watchdog's looks whether a tick hangs. All else belongs to the SORM's thread.
//
// A tick reads the clock twice, allocates nothing, locks nothing and makes no system call; what happens when a step fails
// may allocate. Sleeping ends at absolute times, so periods do not drift.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sorma.h>

#include "bus/statistics.h"
#include "futex.h"
#include "schedule.h"

namespace cycle {

struct Step {
    std::string text;                   // as its author wrote it
    sorma::Reference object;
    sorma::Method method = sorma::Method::exec;
    sorma::Message request;             // what the object gets, each time anew
    sorma::Message message;             // with which it is called
    sorma::Histogram times;             // [ns] in one tick of kSample
    bool containsAction = false;        // the object of Plan::onFault is this one, or part of it

    void reserve();                     // memory for what the object may write, so that the first tick needs none
    void run(sorma::Steering* here);
};

// When a tick has not ended before the next one was due.
enum class Overrun {
    skip,           // what was due meanwhile is left out
    catchUp,        // what was due follows at once
    fault,          // as when a step fails
};

struct Plan {
    std::int64_t period = 0;            // [ns]
    Overrun overrun = Overrun::skip;
    std::vector<Step> steps;
    std::optional<Step> onFault;        // the safe action
    bool goesOn = false;                // after a fault and the safe action
    std::int64_t watchdog = 0;          // [ns] a tick that takes longer hangs
};

struct Fault {
    std::string step;                   // text of the step, empty: the tick as a whole
    sorma::Trail trail;
    std::uint64_t tick = 0;
};

struct Figures {
    std::uint64_t ticks = 0, skipped = 0, overruns = 0, faults = 0, requests = 0;
    sorma::Histogram jitter;            // [ns] from when a tick was due to when it began
    sorma::Histogram busy;              // [ns] length of a tick
    std::int64_t longestRequest = 0;    // [ns]
    std::vector<std::pair<std::string, sorma::Histogram>> steps;    // text and times of each; in a copy alone
};

// Who hears of what happens, on the SORM's thread.
class Owner {
public:
    virtual ~Owner() = default;
    virtual void faulted(const Fault& fault) = 0;
    virtual void act(const Step& action) = 0;       // take a safe action whose object the runner does not execute
    virtual void ended() = 0;                       // after a fault, by itself: it wants to be stopped
};

class Runner final : public sorma::Steering {
public:
    static constexpr std::uint64_t kSample = 8;

    // name: of the cycle, for messages. The owner is called as long as the runner exists.
    Runner(std::string name, std::shared_ptr<sorma::Mailbox> mailbox, Owner& owner);
    ~Runner() override;                 // it must have been stopped

    // Take the objects of the plan in, and run it. Returns what the system has refused, a sentence each. Fails with CYCLE
    // STEP when an object cannot be steered; then nothing has happened.
    std::vector<std::string> start(Plan plan, const Schedule& schedule);
    // End after the present tick, and give the objects back. False: a step hangs; then the runner must never be deleted.
    bool stop();
    // Another plan from the next tick on; figures go on.
    void change(Plan plan);

    bool ended() const { return phase_.load() == kEnded; }      // by a fault
    Figures figures();                  // fails with SERVICE STUCK
    void resetFigures();
    std::uint64_t ticks() const { return number_.load(std::memory_order_relaxed); }
    std::string busyWith() const;       // "gain.k since 1.2 s", or nothing between two ticks

    void lend(sorma::Service& service, const std::function<void()>& work) override;
    bool hasLoan() const override { return hasLoan_; }
    void adopt(sorma::Service& service) override;

private:
    enum Phase : std::uint32_t { kIdle, kAsked, kRunning, kDone, kEnded };

    void admit(Plan& plan);
    void release();
    void run();
    void watch();
    void borrow(const std::string& who, const std::function<void()>& work);
    template <class Call> void tell(Call call);
    void rest(std::int64_t due);
    void serve();
    void inPlace(const std::function<void()>& work);
    void tick(std::int64_t due);
    void afterFault();
    void noteFault(Fault fault);
    void act(std::size_t hanging);
    void leave();
    bool mayBorrow(std::int64_t due) const;

    const std::string name_;
    const std::shared_ptr<sorma::Mailbox> mailbox_;
    const std::shared_ptr<Owner*> owner_;           // what is under way to it when the runner goes is dropped
    std::thread thread_, watchdog_;
    std::vector<sorma::Reference> steered_;

    // Changed by work that is lent alone, or while no thread runs: so the runner and the SORM's thread may read it any
    // time; the watchdog looks at it under the mutex.
    Plan plan_;
    Figures figures_;                   // number_ apart: the runner's
    std::int64_t reserve_ = 0;          // [ns] a gap must be longer for a request to be begun in it
    int passedOver_ = 0;                // gaps that were too short for the one that waits
    bool faulty_ = false;               // since the last tick
    std::int64_t took_ = 0;             // [ns] the last tick

    Futex phase_{kIdle}, bell_;         // phase_: of what is lent. bell_: something is asked of the runner
    const std::function<void()>* work_ = nullptr;
    std::atomic<bool> hasLoan_{false};  // the runner's thread, or who stands in for it
    std::atomic<bool> stop_{false};
    std::atomic<std::uint64_t> number_{0};
    std::atomic<std::int64_t> beat_{0};             // [ns] when the present tick began; 0: between two
    std::atomic<std::size_t> at_{0};                // its step
    std::atomic<bool> acted_{false};                // the safe action has been taken for the present fault
    std::atomic<bool> hung_{false};                 // the watchdog has found the present tick hanging

    std::mutex mutex_;                  // of the watchdog, but while it sleeps
    std::condition_variable woken_;
};

}  // namespace cycle
