#include "runner.h"
#include "abandoned.h"

#include <algorithm>
#include <cstring>

// Tests that watch what a tick does define it.
extern "C" __attribute__((weak)) void sormaTickMark(bool inside);

namespace cycle {

using sorma::MessageArg;
using sorma::Service;
using sorma::Severity;

namespace {

const sorma::Prototype kStuck{Severity::error, "SERVICE STUCK", 1,
                              "{}: {} hangs in its step {}; the request was not executed"};
const sorma::Prototype kGivenUp{Severity::error, "SERVICE STUCK", 1, "{}: {} has abandoned its step {}, which hangs in this object"};
const sorma::Prototype kNotLocal{Severity::error, "CYCLE STEP", 2,
    "{}: {} is elsewhere, at {}: a step must answer without waiting; read it through a snapshot buffer (shmem_r)"};
const sorma::Prototype kNotRealtime{Severity::error, "CYCLE STEP", 2,
    "{}: class {} of {} does not say that it is real-time: it may allocate, wait, or use the interpreter; "
    "a C++ class that does none of that says .realtime() in describe()"};
const sorma::Prototype kNoThread{Severity::error, "CYCLE THREAD", 1, "{}: it cannot start: the system gives it no thread: {}"};
const sorma::Prototype kTaken{Severity::error, "CYCLE STEP", 2, "{}: {} {}"};
const sorma::Prototype kOverrun{Severity::error, "CYCLE OVERRUN", 1, "{}: tick {} took {}, with a period of {}"};
const sorma::Prototype kHangs{Severity::error, "CYCLE HANGS", 1, "{}: tick {} has not ended after {}; it is in its step {}"};
const sorma::Prototype kRequest{Severity::error, "CYCLE REQUEST", 1, "{}: no tick could begin after {}: a request to {} took {}"};
const sorma::Prototype kStands{Severity::error, "CYCLE CLOCK", 1, "{}: its clock stands at {} s since {}"};
const sorma::Prototype kLate{Severity::error, "CYCLE LATE", 1,
    "{}: the change took {} and was undone: the next tick of {} would have been late by more than {}, a quarter of its "
    "period; stop it for that, or change less at a time"};
const sorma::Prototype kActionHangs{Severity::error, "CYCLE ACTION", 1,
                                    "{}: the safe action {} was not taken: its object is part of the step that hangs"};

constexpr std::int64_t kPatience = 1'000'000'000;       // [ns] with a tick that does not end
constexpr std::int64_t kLeastReserve = 30'000;          // [ns]
constexpr std::int64_t kTolerance = 1'000;              // [ns] of a clock whose times are sums of floats
constexpr int kMostPassed = 5;                          // gaps; then a request is done though the next tick may be late
constexpr std::size_t kStack = 128 * 1024;              // touched before the first tick
constexpr std::size_t kInAction = SIZE_MAX;             // at_: in the safe action at the end of a tick

void touchStack() {
    char stack[kStack];
    std::memset(stack, 0, sizeof stack);
    asm volatile("" : : "r"(stack) : "memory");
}

void mark(bool inside) {
    if (sormaTickMark) sormaTickMark(inside);
}

template <class... Values> sorma::Entry entry(const sorma::Prototype& prototype, const Values&... values) {
    return sorma::makeEntry(prototype, {MessageArg::of(values)...});
}

// Has this thread done or waited for something longer than that? If not, what took so long was the machine, which took the processor
// away from it.
bool wasSlow(const sorma::ThreadEffort& since, std::int64_t limit) {
    auto now = sorma::ThreadEffort::now();
    return now.busy - since.busy > limit || now.waits != since.waits;
}

std::string duration(std::int64_t ns) { return sorma::durationText(double(ns)); }

}  // namespace

// The turn, for something of the runner's own: the plan is not the safe action's meanwhile.
struct Runner::Held {
    explicit Held(Runner& r) : runner(r) {
        if (r.holds_ > 0) {
            if (r.holding_) r.turn_.upgrade();
        } else {
            r.take(r.name_, true);
        }
        ++r.holds_;
    }
    ~Held() { runner.release(); }
    Runner& runner;
};

Runner::Runner(std::string name, std::shared_ptr<sorma::Mailbox> mailbox, Owner& owner)
    : name_(std::move(name)), mailbox_(std::move(mailbox)), owner_(std::make_shared<Owner*>(&owner)) {}

Runner::~Runner() = default;

template <class Call> void Runner::tell(Call call) {
    mailbox_->post([owner = std::weak_ptr(owner_), call = std::move(call)] {
        if (auto o = owner.lock(); o && *o) call(**o);
    });
}

// By any thread. step: empty for the tick as a whole.
void Runner::report(const std::string& step, sorma::Trail trail) {
    tell([fault = Fault{step, std::move(trail), ticks()}](Owner& owner) { owner.faulted(fault); });
}

void Runner::report(const std::string& step, sorma::Entry entry) {
    report(step, sorma::Trail(std::move(entry)));
}

// ---- the SORM's thread: which objects ----

const char* Runner::claim() const {
    return abandoned_.empty() ? "is run by another cycle already" : "hangs in a step that was abandoned";
}

void Runner::adopt(Service& service) {
    if (service.realtimeOwner() == this && abandoned_.empty()) return;
    if (service.location() != "self") fail(kNotLocal, name_, service.name(), service.location());
    if (!service.type().isRealtime()) fail(kNotRealtime, name_, service.type().name(), service.name());
    if (auto* other = service.realtimeOwner()) fail(kTaken, name_, service.name(), other->claim());
    service.needParts();
    auto parts = service.parts();
    service.setRealtimeOwner(this);
    owned_.emplace_back(&service);
    for (auto& part : parts) adopt(*part);
}

void Runner::admit(Plan& plan) {
    std::size_t before = owned_.size();
    auto reserve = [](Step& step) {
        sorma::BetweenTicks between(*step.object);
        step.reserve();
    };
    try {
        for (auto& step : plan.steps) {
            adopt(*step.object);
            reserve(step);
        }
    } catch (...) {
        for (; owned_.size() > before; owned_.pop_back()) owned_.back()->setRealtimeOwner(nullptr);
        throw;
    }
    if (plan.onFault) {
        try {
            if (plan.onFault->method == sorma::Method::exec) adopt(*plan.onFault->object);
            reserve(*plan.onFault);
        } catch (const sorma::Error&) {     // it is reached as any request is: through the SORM
        }
    }
    plan.findNearAction(plan.onFault && executes(*plan.onFault));
}

bool Runner::executes(const Step& action) const {
    return action.method == sorma::Method::exec && action.object->realtimeOwner() == this;
}

void Runner::keepOnly(const Objects& wanted) {
    std::vector<sorma::Reference> kept;
    for (auto& object : owned_) {
        if (wanted.count(object.get())) kept.push_back(object);
        else object->setRealtimeOwner(nullptr);
    }
    owned_ = std::move(kept);
}

// Which objects are needed is found when ticks go on again: a circuit may have thousands.
void Runner::partsChanged() noexcept {
    unneeded_ = true;
    try {
        Held held(*this);
        plan_.findNearAction(plan_.onFault && executes(*plan_.onFault));
    } catch (...) {                         // a step hangs, and will not run again
    }
    if (holds_ == 0) dropUnneeded();
}

void Runner::dropUnneeded() noexcept {
    if (!std::exchange(unneeded_, false)) return;
    Objects wanted;
    for (auto& step : plan_.steps) sorma::addTree(*step.object, wanted);
    if (plan_.onFault) sorma::addTree(*plan_.onFault->object, wanted);
    keepOnly(wanted);
}

// ---- the SORM's thread: begin and end ----

std::vector<std::string> Runner::start(Plan plan, const Schedule& schedule, std::unique_ptr<Clock> clock) {
    admit(plan);
    plan_ = std::move(plan);
    clock_ = std::move(clock);
    limit_ = plan_.watchdog;
    turn_.open();
    std::vector<std::string> refused;
    Futex started;
    Schedule above = schedule;
    above.priority = above.priority > 0 ? std::min(above.priority + 1, 99) : 0;
    try {
        // The watchdog first: no tick runs without it.
        watchdog_ = std::thread([this, above] {
            apply(above, "sorma-watchdog");
            watch();
        });
        thread_ = std::thread([this, schedule, &refused, &started] {
            refused = apply(schedule, "sorma-cycle");
            touchStack();
            startClock();
            started.set(1);
            run();
        });
    } catch (const std::exception& e) {
        endWatchdog();
        keepOnly({});
        fail(kNoThread, name_, e.what());
    }
    while (started.load() == 0) started.wait(0, sorma::monotonicNow() + kPatience);
    return refused;
}

void Runner::endWatchdog() {
    stop_ = true;
    {
        std::lock_guard lock(mutex_);
        woken_.notify_all();
    }
    if (watchdog_.joinable()) watchdog_.join();
}

bool Runner::stop() {
    stop_ = true;
    clock_->ring();
    if (std::exchange(holding_, false))     // by a request to one of its own objects: what is left of that finds no ticks
        do turn_.awaitWatchdog();
        while (!turn_.release(true));
    if (!turn_.waitForEnd(nanoseconds() + kPatience)) return false;
    thread_.join();
    endWatchdog();
    keepOnly({});
    return true;
}

bool Runner::abandon() {
    Turn::Word w = turn_.look();
    if (Turn::holder(w) != Turn::tick) return false;
    auto* own = std::exchange(current_, this);
    declareLate(w, nanoseconds() - beat_.load(std::memory_order_relaxed));
    current_ = own;
    bool watcherHangs = !turn_.waitForWatcher(nanoseconds() + kPatience), withAction = false;
    if (!turn_.abandon(withAction)) return false;
    // From here on its thread touches nothing but what hangs.
    std::size_t at = at_.load(std::memory_order_relaxed);
    abandoned_ = at < plan_.steps.size() ? plan_.steps[at].text : plan_.onFault ? plan_.onFault->text : std::string();
    Objects hanging;
    if (at < plan_.steps.size()) addTree(*plan_.steps[at].object, hanging);
    if (plan_.onFault && (withAction || watcherHangs)) addTree(*plan_.onFault->object, hanging);
    keepOnly(hanging);
    *owner_ = nullptr;
    stop_ = true;
    {
        std::lock_guard lock(abandonedOnes().mutex);
        abandonedOnes().runners.insert(this);
    }
    if (watcherHangs) watchdog_.detach();
    else endWatchdog();
    thread_.detach();
    return true;
}

void Runner::change(Plan plan) {
    admit(plan);
    try {
        Held held(*this);
        for (auto& step : plan.steps)
            for (auto& old : plan_.steps)
                if (old.text == step.text) step.times = old.times;
        std::swap(plan_, plan);
        limit_ = plan_.watchdog;
    } catch (...) {
        partsChanged();
        throw;
    }
    partsChanged();
}

Figures Runner::figures() {
    Held held(*this);
    Figures copy = figures_;
    for (auto& step : plan_.steps) copy.steps.emplace_back(step.text, step.times);
    copy.ticks = ticks() - before_;
    return copy;
}

void Runner::resetFigures() {
    Held held(*this);
    figures_ = {};
    before_ = ticks();
    for (auto& step : plan_.steps) step.times = {};
}

std::string Runner::busyWith() const {
    std::int64_t since = beat_.load(std::memory_order_relaxed);
    std::size_t at = at_.load(std::memory_order_relaxed);
    if (since == 0 || (at >= plan_.steps.size() && !plan_.onFault)) return {};
    return (at < plan_.steps.size() ? plan_.steps[at].text : plan_.onFault->text) + " since " + duration(nanoseconds() - since);
}

// ---- the SORM's thread: between two ticks ----

bool Runner::fits() const {
    if (passed_.load(std::memory_order_relaxed) >= kMostPassed || !clock_->monotonic()) return true;
    return due_.load(std::memory_order_relaxed) - nanoseconds() > reserve_.load(std::memory_order_relaxed) + kLeastReserve;
}

void Runner::take(const std::string& who, bool nearAction) {
    if (!abandoned_.empty()) fail(kGivenUp, who, name_, abandoned_);
    std::int64_t now = nanoseconds(), until = now + kPatience;
    if (auto deadline = sorma::CallContext::currentDeadline(); !deadline.none()) until = std::min(until, deadline.when());
    auto ready = [this, now](bool waited) {
        if (waited || now - effortSince_ >= quarter_.load(std::memory_order_relaxed) / 4) [[unlikely]] {
            effort_ = sorma::ThreadEffort::now();
            effortSince_ = now;
        }
        return fits();
    };
    auto answer = turn_.ask(ready, nearAction, until);
    if (answer == Turn::Answer::refused) fail(kStuck, who, name_, busyWith());
    holding_ = answer == Turn::Answer::granted;
    heldFor_ = who;
    heldSince_ = nanoseconds();
}

void Runner::hold(Service& service) {
    bool near = plan_.nearAction.count(&service);
    if (holds_ > 0) {
        if (near && holding_) turn_.upgrade();
    } else {
        take(service.name(), near);
    }
    ++holds_;
}

void Runner::dismiss(std::unique_ptr<Runner> runner) {
    if (runner && runner->holds_ > 0) runner.release()->dismissed_ = true;
}

void Runner::release() noexcept {
    if (holds_ == 1 && dismissed_) return delete this;
    if (--holds_ > 0) return;
    if (std::exchange(holding_, false)) giveBack();
    dropUnneeded();
}

void Runner::giveBack() noexcept {
    std::int64_t now = nanoseconds(), took = now - heldSince_, quarter = quarter_.load(std::memory_order_relaxed);
    if (now > due_.load(std::memory_order_relaxed) + quarter) [[unlikely]] requestSlow_ |= wasSlow(effort_, quarter);
    figures_.held.add(took);
    ++figures_.requests;
    passed_.store(0, std::memory_order_relaxed);
    // The longest of late: what was long once fades, so that one slow request does not keep all others waiting.
    std::int64_t reserve = reserve_.load(std::memory_order_relaxed);
    reserve_.store(std::min(std::max(took, reserve - reserve / 8), plan_.period / 2), std::memory_order_relaxed);
    // Told before the turn goes back: the runner may end at once, and what comes after its end is not heard.
    for (bool late = turn_.awaitWatchdog();; late = turn_.awaitWatchdog()) {
        if (late && !std::exchange(requestLate_, true)) report({}, entry(kRequest, name_, ticks(), heldFor_, duration(took)));
        if (turn_.release(late)) break;
    }
}

void Runner::checkBudget(Service& service, const sorma::ThreadEffort& since) const {
    if (!holding_) return;
    std::int64_t quarter = quarter_.load(std::memory_order_relaxed), now = nanoseconds(), limit = heldSince_ + quarter;
    if (clock_->monotonic()) limit = std::max(due_.load(std::memory_order_relaxed), heldSince_) + quarter;
    if (now <= limit) return;
    if (!wasSlow(since, quarter)) return;
    fail(kLate, service.name(), duration(now - heldSince_), name_, duration(quarter));
}

// ---- the runner's thread ----

// The clock counts from now on: the caller of start() may set a simulated clock at once.
void Runner::startClock() {
    current_ = this;
    time_ = clock_->now();
    record_ = clock_->record();
    next_ = {time_ + plan_.period, plan_.period, true};
    nextDue_.store(next_.due, std::memory_order_relaxed);
    due_.store(nanoseconds() + plan_.period, std::memory_order_relaxed);
    quarter_.store(plan_.period / 4, std::memory_order_relaxed);
}

void Runner::run() {
    while (next_.goesOn) {
        Rest why = rest();
        if (why == Rest::stop) break;
        if (tick(why)) continue;
        // The runner was abandoned, and nobody uses it any more. Its objects go back to the SORM's thread, if that still
        // exists.
        if (turn_.hasAction()) act();
        auto mailbox = mailbox_;
        mailbox->post([this] {
            {
                std::lock_guard lock(abandonedOnes().mutex);
                abandonedOnes().runners.erase(this);
            }
            keepOnly({});
            delete this;
        });
        return;
    }
    leave();
}

// Sleep until the next tick is due, or no record of the clock has come for too long.
Runner::Rest Runner::rest() {
    if (turn_.requestWaits()) {
        bool urgent = passed_.fetch_add(1, std::memory_order_relaxed) >= kMostPassed;
        if (urgent || fits()) turn_.offer(urgent ? nanoseconds() + quarter_.load(std::memory_order_relaxed) : 0);
    }
    const bool machine = clock_->monotonic();
    std::int64_t heard = machine ? 0 : nanoseconds();
    for (;;) {
        std::uint32_t bell = clock_->bell();
        if (stop_) return Rest::stop;
        std::int64_t now = clock_->now();
        if (!machine) {
            if (now < time_) nextDue_ = next_.due = now + next_.period;         // it has begun anew
            time_ = now;
            if (clock_->record() != record_) {
                heard = nanoseconds();
                stands_ = false;
                record_ = clock_->record();
            } else if (!stands_ && nanoseconds() - heard >= limit_.load(std::memory_order_relaxed)) {
                stands_ = true;
                return Rest::still;
            }
            now += kTolerance;
        }
        if (now >= next_.due) return Rest::due;
        clock_->sleep(bell, next_.due, machine ? INT64_MAX : heard + limit_.load(std::memory_order_relaxed));
    }
}

// Take the turn. While a request has it the watchdog sees that the tick cannot begin.
void Runner::begin() {
    bool waited = false;
    for (;; waited = true) {
        start_ = nanoseconds();
        beat_.store(start_, std::memory_order_relaxed);
        if (turn_.begin()) break;
        turn_.waitForRequest();
    }
    bool slow = std::exchange(requestSlow_, false);
    if (waited && clock_->monotonic() && start_ - next_.due > plan_.period / 4) ++(slow ? figures_.delayed : figures_.heldUp);
}

// Execute a tick, or do what happens instead of one. False: the tick was abandoned.
bool Runner::tick(Rest why) {
    begin();
    bool faulty = false;
    std::uint64_t number = number_.load(std::memory_order_relaxed) + 1;
    sorma::Tick now{next_.due, double(plan_.period) / 1e9, number};
    sorma::Tick::Scope scope(now);
    if (why == Rest::still) [[unlikely]] {
        ++figures_.faults;
        report({}, entry(kStands, name_, sorma::numberText(double(time_) / 1e9), duration(limit_.load(std::memory_order_relaxed))));
        faulty = true;
    } else if (std::exchange(requestLate_, false)) [[unlikely]] {
        ++figures_.faults;                  // the SORM's thread has told of it
        faulty = true;
        schedule(start_, faulty);
    } else {
        number_.store(number, std::memory_order_relaxed);
        figures_.jitter.add((clock_->monotonic() ? start_ : time_) - next_.due);
        faulty = !runSteps(number);
        std::int64_t end = nanoseconds();
        figures_.busy.add(end - start_);
        schedule(end, faulty);
    }
    return finish(faulty);
}

// False: one has failed.
bool Runner::runSteps(std::uint64_t number) {
    bool timed = number % kSample == 1;
    std::int64_t last = start_;
    std::size_t i = 0;
    mark(true);
    try {
        for (auto& step : plan_.steps) {
            at_.store(i++, std::memory_order_relaxed);
            const bool near = step.nearAction;
            if (near && !turn_.enterAction()) [[unlikely]] break;
            step.run(this);
            if (near ? !turn_.leaveAction() : turn_.late()) [[unlikely]] break;
            if (timed) {
                std::int64_t end = nanoseconds();
                step.times.add(end - last);
                last = end;
            }
        }
        mark(false);
        return true;
    } catch (...) {
        mark(false);
        auto& step = plan_.steps[i - 1];
        ++figures_.faults;
        report(step.text, sorma::trailOfCurrentException(step.object->name()));
        return false;
    }
}

// When is the next one due? Whether it is late already is seen here.
void Runner::schedule(std::int64_t end, bool& faulty) {
    next_.period = plan_.period;
    next_.due += plan_.period;
    // A simulated clock may stand where the next tick is due, and wait for it: that one is missed when the one after it is due, too.
    std::int64_t late = (clock_->monotonic() ? end : clock_->now() - plan_.period) - next_.due;
    if (late >= 0) [[unlikely]] {
        ++figures_.overruns;
        if (plan_.overrun == Overrun::fault && !faulty) {
            ++figures_.faults;
            report({}, entry(kOverrun, name_, ticks(), duration(end - start_), duration(plan_.period)));
            faulty = true;
        }
        std::int64_t skipped = plan_.overrun == Overrun::catchUp ? 0 : late / plan_.period + 1;
        figures_.skipped += std::uint64_t(skipped);
        next_.due += skipped * plan_.period;
    }
    nextDue_.store(next_.due, std::memory_order_relaxed);
    due_.store(next_.due, std::memory_order_relaxed);
    quarter_.store(plan_.period / 4, std::memory_order_relaxed);
}

// When something went wrong in a tick, the safe action comes last in it. The watchdog may have taken it before: it is taken again,
// since the step that hung may have written since. False: the tick was abandoned.
bool Runner::finish(bool faulty) {
    bool counted = false;
    for (;;) {
        bool late = turn_.awaitWatchdog();
        if (late && !std::exchange(counted, true)) ++figures_.faults;
        if (late || faulty) [[unlikely]] {
            if (!turn_.enterEnd()) return false;
            at_.store(kInAction, std::memory_order_relaxed);
            act();
        }
        next_.goesOn = plan_.goesOn || !(late || faulty);
        beat_.store(0, std::memory_order_relaxed);
        if (turn_.end(late)) return true;
        if (turn_.abandoned()) return false;
    }
}

// The safe action, by the thread that has the right to it.
void Runner::act() {
    if (!plan_.onFault) return;
    Step& action = *plan_.onFault;
    if (!executes(action)) return tell([action = plan_.onFault](Owner& owner) { owner.act(*action); });
    try {
        action.run(this);
    } catch (...) {
        report(action.text, sorma::trailOfCurrentException(action.object->name()));
    }
}

// When the thread has ended, its objects may be used by the SORM's thread without asking for the turn.
void Runner::leave() {
    bool asked = stop_;
    beat_.store(0, std::memory_order_relaxed);
    while (!turn_.finish()) turn_.waitForRequest();
    if (!asked) tell([](Owner& owner) { owner.ended(); });
}

// ---- the watchdog's thread ----

void Runner::watch() {
    current_ = this;
    std::unique_lock lock(mutex_);
    while (!stop_ && !ended()) {
        std::int64_t limit = limit_.load(std::memory_order_relaxed);
        woken_.wait_for(lock, std::chrono::nanoseconds(limit / 4));
        Turn::Word w = turn_.look();
        std::int64_t since = beat_.load(std::memory_order_relaxed);
        if (stop_ || since == 0 || nanoseconds() - since < limit) continue;
        lock.unlock();
        declareLate(w, nanoseconds() - since);
        lock.lock();
    }
}

void Runner::declareLate(Turn::Word w, std::int64_t after) {
    auto claim = turn_.declareLate(w);
    if (claim == Turn::Claim::none) return;
    if (Turn::holder(w) == Turn::request) {     // the SORM's thread tells of it; it may be changing the plan
        if (claim == Turn::Claim::mayAct) act();
        return turn_.acted();
    }
    std::size_t at = at_.load(std::memory_order_relaxed);
    std::string step = at < plan_.steps.size() ? plan_.steps[at].text : plan_.onFault ? plan_.onFault->text : std::string();
    report(step, entry(kHangs, name_, ticks(), duration(after), step));
    if (claim == Turn::Claim::mayAct) act();
    else if (plan_.onFault) report(plan_.onFault->text, entry(kActionHangs, name_, plan_.onFault->text));
    turn_.acted();
}

}  // namespace cycle
