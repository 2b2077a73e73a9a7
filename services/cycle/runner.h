// runner.h -- the thread of a cycle: executes steps at a fixed period, and leaves time between two ticks for requests to
// their objects.
//
// Threads: the runner's thread executes the ticks. The SORM's thread uses the objects between two ticks. The watchdog's
//          thread checks whether a tick hangs, or cannot begin. One word says which of them may use the objects (turn.h).
//
// A tick reads the clock twice. It does not allocate, lock or make a system call, unless a step fails. The thread sleeps
// until absolute times, so periods do not drift.
//
// Faults: a step throws; a tick is too long (Overrun::fault); a tick hangs; a request keeps a tick from
// beginning. The safe action is the last step of such a tick. When the tick hangs, the watchdog's thread executes the safe
// action instead.
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
#include "plan.h"
#include "schedule.h"
#include "turn.h"

namespace cycle {

struct Fault {
    std::string step;                   // text of the step, empty: the tick as a whole
    sorma::Trail trail;
    std::uint64_t tick = 0;
};

struct Figures {
    std::uint64_t ticks = 0, skipped = 0, overruns = 0, faults = 0, requests = 0;
    // Ticks that waited for a request and were late by more than a quarter of the period. For
    // delayed the request took too long; for heldUp the machine gave the processor to something else meanwhile.
    std::uint64_t delayed = 0, heldUp = 0;
    sorma::Histogram jitter;            // [ns] how late ticks began
    sorma::Histogram busy;              // [ns] how long ticks took
    sorma::Histogram held;              // [ns] how long requests kept ticks from beginning
    std::vector<std::pair<std::string, sorma::Histogram>> steps;    // text and times of each; only in a copy
};

// Gets told what happens; called from the mailbox, on the SORM's thread.
class Owner {
public:
    virtual ~Owner() = default;
    virtual void faulted(const Fault& fault) = 0;
    virtual void act(const Step& action) = 0;       // execute the safe action: its object is not one that the runner executes
    virtual void ended() = 0;                       // the ticks have ended after a fault: call stop()
};

class Runner final : public sorma::RealtimeOwner {
public:
    static constexpr std::uint64_t kSample = 8;

    // All of these are for the SORM's thread.

    // name: of the cycle, for messages. The owner must outlive the runner, but for one that was abandoned.
    Runner(std::string name, std::shared_ptr<sorma::Mailbox> mailbox, Owner& owner);
    ~Runner() override;                 // stop() must have returned true before

    // Become the owner of the plan's objects, and begin the ticks. Returns what the system has refused (see apply), a
    // sentence each. Fails with CYCLE STEP when an object cannot be executed in ticks, and with CYCLE THREAD when the system
    // gives no thread. Then no tick has run, and the objects belong to the SORM's thread again.
    std::vector<std::string> start(Plan plan, const Schedule& schedule, std::unique_ptr<Clock> clock);
    // Wait for the end of the present tick, and give the objects back to the SORM's thread. False: a step hangs.
    bool stop();
    // A step hangs: execute the safe action if that has not happened, and give back all other objects. Those of the step stay
    // with its thread. Then do not use the runner any more: it deletes itself if the step ever returns. False:
    // the step has returned; call stop().
    bool abandon();
    // Delete a runner that was stopped. If this happens inside a request to one of its objects, it is deleted when that
    // request is over.
    static void dismiss(std::unique_ptr<Runner> runner);
    // Use another plan from the next tick on. The figures go on.
    void change(Plan plan);

    bool ended() const { return Turn::holder(turn_.look()) == Turn::ended; }        // the ticks have ended, after a fault or stop()
    Figures figures();                  // fails with SERVICE STUCK
    std::int64_t due() const { return nextDue_.load(std::memory_order_relaxed); }       // [ns] the next tick, by the clock
    void resetFigures();
    std::uint64_t ticks() const { return number_.load(std::memory_order_relaxed); }     // so far
    std::string busyWith() const;       // for people: "gain.k since 1.2 s"; empty between two ticks

    void hold(sorma::Service& service) override;
    void release() noexcept override;
    void checkBudget(sorma::Service& service, const sorma::ThreadEffort& since) const override;
    void adopt(sorma::Service& service) override;
    void partsChanged() noexcept override;
    const char* claim() const override;

private:
    struct Held;
    enum class Rest { due, still, stop };

    void admit(Plan& plan);
    void keepOnly(const Objects& wanted);
    void dropUnneeded() noexcept;
    void giveBack() noexcept;
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
    void endWatchdog();
    void declareLate(Turn::Word w, std::int64_t limit);

    const std::string name_;
    const std::shared_ptr<sorma::Mailbox> mailbox_;
    const std::shared_ptr<Owner*> owner_;           // calls to it in the mailbox have weak ones, and are lost with the runner
    std::thread thread_, watchdog_;
    std::unique_ptr<Clock> clock_;                  // the runner's thread, but for ring()

    // Changed by the SORM's thread while it has the turn; it may read it at any time.
    Plan plan_;
    // The SORM's thread:
    std::vector<sorma::Reference> owned_;           // the objects of which this is the real-time owner
    int holds_ = 0;                                 // nested calls of hold()
    bool holding_ = false;              // the outermost of them has the turn; false when ticks have ended
    bool dismissed_ = false;                        // delete it when holds_ becomes 0
    bool unneeded_ = false;             // there may be objects that no step needs any more
    std::string heldFor_;                           // name of the object that is used
    std::int64_t heldSince_ = 0;                    // [ns]
    // Effort of the SORM's thread shortly before it got the turn, to know whether a request that ends late was slow. Reading
    // it takes as long as a request. So it is read again only after a sixteenth of a period, or when the request had to wait.
    sorma::ThreadEffort effort_;
    std::int64_t effortSince_ = 0;      // [ns]
    std::string abandoned_;             // the step that hangs

    // For the thread that has the turn:
    Figures figures_;                   // without the number of ticks, which is number_ - before_
    std::uint64_t before_ = 0;          // ticks when the figures began again
    bool requestLate_ = false;          // a request has kept a tick from beginning, which is a fault
    bool requestSlow_ = false;          // a request has made the next tick late, and it was not the machine

    // The runner's thread:
    struct Next {                       // the next tick
        std::int64_t due = 0, period = 0;       // [ns] by the clock
        bool goesOn = true;                     // false: there is none
    } next_;
    std::int64_t start_ = 0;            // [ns] start of the present tick, monotonic clock
    std::int64_t time_ = 0;             // [ns] last reading of the clock
    std::uint64_t record_ = 0;          // of the clock, the last one that was seen
    bool stands_ = false;               // it has reported that the clock stands still

    Turn turn_;
    std::atomic<bool> stop_{false};
    std::atomic<std::uint64_t> number_{0};
    std::atomic<std::int64_t> due_{0};              // [ns] monotonic clock: the next tick, as far as it is known
    std::atomic<std::int64_t> nextDue_{0};          // [ns] the same by the clock, for who asks; nothing depends on it
    std::atomic<std::int64_t> quarter_{0};          // [ns] a quarter of the period
    std::atomic<std::int64_t> reserve_{0};          // [ns] a request begins only when more time than this is left to the next tick
    std::atomic<int> passed_{0};                    // gaps between ticks in which the waiting request did not begin
    std::atomic<std::int64_t> limit_{0};            // [ns] of the watchdog
    std::atomic<std::int64_t> beat_{0};             // [ns] since when the present tick runs, or cannot begin; 0: between two
    std::atomic<std::size_t> at_{0};                // index of its step

    std::mutex mutex_;                  // for the watchdog's sleep
    std::condition_variable woken_;
};

}  // namespace cycle
