// runner.h -- the thread of a cycle: a row of steps at a fixed period, and room between two ticks for what is asked of their
// objects.
//
// Three threads meet here. The runner's own executes the ticks. The SORM's uses the objects between two ticks. The watchdog's
// looks whether a tick hangs, or cannot begin. Whose turn it is stands in one word (turn.h).
//
// A tick reads the clock twice, allocates nothing, locks nothing and makes no system call; what happens when a step fails
// may allocate. Sleeping ends at absolute times, so periods do not drift.
//
// Faults: a step that throws, a tick that is too long where that is one, a tick that hangs, a request that keeps a tick from
// beginning. The safe action is the last thing that happens in such a tick; when the tick hangs the watchdog takes it before.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_set>
#include <vector>

#include <sorma.h>

#include "bus/statistics.h"
#include "clock.h"
#include "schedule.h"
#include "turn.h"

namespace cycle {

struct Step {
    sorma::Reference object;
    sorma::Method method = sorma::Method::exec;
    bool nearAction = false;            // it may execute the safe action's object, or parts of that
    sorma::Message request;             // what the object gets, each time anew
    sorma::Message message;             // with which it is called
    sorma::Histogram times;             // [ns] in one tick of kSample
    std::string text;                   // as its author wrote it

    void reserve();                     // memory for what the object may write, so that the first tick needs none
    void run(sorma::RealtimeOwner* here) {
        message.reset();
        if (!request.floats.empty()) message.floats = request.floats;
        if (!request.ints.empty()) message.ints = request.ints;
        if (!request.text.empty()) message.text = request.text;
        if (!request.any.empty()) message.any = request.any;
        object.step(message, here);
    }
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
    std::shared_ptr<Step> onFault;      // the safe action, or null; shared with what has been told, let go by the SORM's thread
    bool goesOn = false;                // after a fault and the safe action
    std::int64_t watchdog = 0;          // [ns] a tick that takes longer hangs
    std::unordered_set<const sorma::Service*> nearAction;       // objects that have parts in common with the safe action's
};

struct Fault {
    std::string step;                   // text of the step, empty: the tick as a whole
    sorma::Trail trail;
    std::uint64_t tick = 0;
};

struct Figures {
    std::uint64_t ticks = 0, skipped = 0, overruns = 0, faults = 0, requests = 0;
    // Ticks that have waited for a request, and were late by more than a quarter of the period: because the request took so long,
    // or because the machine took the processor away meanwhile.
    std::uint64_t delayed = 0, heldUp = 0;
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

class Runner final : public sorma::RealtimeOwner {
public:
    static constexpr std::uint64_t kSample = 8;

    // name: of the cycle, for messages. The owner is called as long as the runner exists and has not been abandoned.
    Runner(std::string name, std::shared_ptr<sorma::Mailbox> mailbox, Owner& owner);
    ~Runner() override;                 // it must have been stopped

    // Take the objects of the plan in, and run it. Returns what the system has refused, a sentence each. Fails with CYCLE
    // STEP when an object cannot be executed in ticks; then nothing has happened.
    std::vector<std::string> start(Plan plan, const Schedule& schedule, std::unique_ptr<Clock> clock);
    // End after the present tick, and give the objects back. False: a step hangs.
    bool stop();
    // A step hangs: take the safe action if that has not been done, and give back all objects but those of that step, which stay
    // with its thread. Then the runner must not be touched any more: it deletes itself when the step should ever return. False: it
    // does not hang any more; it can be stopped.
    bool abandon();
    // The end of one that has been stopped. It may be in the middle of a request to one of its objects, which has led here: then it
    // stays until that gives it back.
    static void dismiss(std::unique_ptr<Runner> runner);
    // Another plan from the next tick on; figures go on.
    void change(Plan plan);

    bool ended() const { return Turn::holder(turn_.look()) == Turn::ended; }        // by a fault
    Figures figures();                  // fails with SERVICE STUCK
    void resetFigures();
    std::uint64_t ticks() const { return number_.load(std::memory_order_relaxed); }
    std::string busyWith() const;       // "gain.k since 1.2 s", or nothing between two ticks

    void hold(sorma::Service& service) override;
    void release() noexcept override;
    void checkBudget(sorma::Service& service, const sorma::ThreadEffort& since) const override;
    void adopt(sorma::Service& service) override;
    void partsChanged() noexcept override;
    const char* claim() const override;

private:
    struct Held;
    enum class Rest { due, still, stop };
    using Objects = std::unordered_set<const sorma::Service*>;

    void admit(Plan& plan);
    void findNearAction(Plan& plan) const;
    void keepOnly(const Objects& wanted);
    void take(const std::string& who, bool nearAction);
    bool fits() const;
    bool executes(const Step& action) const;
    template <class Call> void tell(Call call);
    void report(const std::string& step, sorma::Trail trail);
    void report(const std::string& step, sorma::Entry entry);

    void startClock();
    void run();
    Rest rest();
    void begin();
    bool tick(Rest why);
    bool runSteps(std::uint64_t number);
    void schedule(std::int64_t end, bool& faulty);
    bool finish(bool faulty);
    void act();
    void leave();
    void watch();
    void declareLate(Turn::Word w, std::int64_t limit);

    const std::string name_;
    const std::shared_ptr<sorma::Mailbox> mailbox_;
    const std::shared_ptr<Owner*> owner_;           // what is under way to it when the runner goes is dropped
    std::thread thread_, watchdog_;
    std::unique_ptr<Clock> clock_;                  // the runner's thread, but for ring()

    // Changed by who has the turn, as a request; read by the SORM's thread any time.
    Plan plan_;
    // The SORM's thread:
    std::vector<sorma::Reference> owned_;
    int holds_ = 0;
    bool holding_ = false;              // the outermost of them has the turn: ticks have not ended
    bool dismissed_ = false;                        // its end waits for what holds it
    std::string heldFor_;
    std::int64_t heldSince_ = 0;
    // What this thread had spent shortly before it got the turn: it tells whether a request that ends late was slow. To read it
    // takes as long as a request, so it is read anew only when it is older than a sixteenth of a period, or when the request has
    // waited for its turn.
    sorma::ThreadEffort effort_;
    std::int64_t effortSince_ = 0;      // [ns]
    std::string abandoned_;             // the step that hangs

    // By who has the turn:
    Figures figures_;                   // ticks apart: number_
    bool requestLate_ = false;          // a request has kept a tick from beginning: a fault
    bool requestSlow_ = false;          // one has made the next tick late, and it was not the machine

    // The runner's thread; what it needs of the plan between two ticks:
    struct Next {
        std::int64_t due = 0, period = 0;       // [ns] by the clock
        bool goesOn = true;                     // there is one
    } next_;
    std::int64_t start_ = 0;            // [ns] of the present tick, monotonic clock
    std::int64_t time_ = 0;             // [ns] what the clock said last
    bool stands_ = false;               // it has been told that the clock stands still

    Turn turn_;
    std::atomic<bool> stop_{false};
    std::atomic<std::uint64_t> number_{0};
    std::atomic<std::int64_t> due_{0};              // [ns] monotonic clock: the next tick, as far as one knows
    std::atomic<std::int64_t> quarter_{0};          // [ns] of a period
    std::atomic<std::int64_t> reserve_{0};          // [ns] a gap must be longer for a request to be begun in it
    std::atomic<int> passed_{0};                    // gaps without the request that waits
    std::atomic<std::int64_t> limit_{0};            // [ns] of the watchdog
    std::atomic<std::int64_t> beat_{0};             // [ns] since when the present tick runs, or cannot begin; 0: between two
    std::atomic<std::size_t> at_{0};                // its step

    std::mutex mutex_;                  // of the watchdog's sleep
    std::condition_variable woken_;
};

}  // namespace cycle
