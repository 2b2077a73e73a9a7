#include "runner.h"

#include <algorithm>
#include <cstring>
#include <limits>

// Tests that watch what a tick does define it.
extern "C" __attribute__((weak)) void sormaTickMark(bool inside);

namespace cycle {

using sorma::Severity;

namespace {

const sorma::Prototype kStuck{Severity::error, "SERVICE STUCK", 1,
                              "{}: {} hangs in its step {}; what was asked has not been done"};
const sorma::Prototype kNotLocal{Severity::error, "CYCLE STEP", 2,
    "{}: {} is elsewhere, at {}: a step must answer without waiting; read it through a snapshot buffer (shmem_r)"};
const sorma::Prototype kNotRealtime{Severity::error, "CYCLE STEP", 2,
    "{}: class {} of {} does not say that it is real-time: it may allocate, wait, or use the interpreter"};
const sorma::Prototype kTaken{Severity::error, "CYCLE STEP", 2, "{}: {} is run by another cycle already"};
const sorma::Prototype kOverrun{Severity::error, "CYCLE OVERRUN", 1, "{}: tick {} took {}, with a period of {}"};
const sorma::Prototype kHangs{Severity::error, "CYCLE HANGS", 1, "{}: tick {} has not ended after {}; it is in its step {}"};
const sorma::Prototype kActionHangs{Severity::error, "CYCLE ACTION", 1,
                                    "{}: the safe action {} was not taken: its object is part of the step that hangs"};

constexpr std::int64_t kPatience = 1'000'000'000;       // [ns] with a tick that does not end
constexpr std::int64_t kLeastReserve = 30'000;          // [ns]
constexpr int kMostPassed = 5;                          // gaps; then a request is done though the next tick may be late
constexpr std::size_t kUsualLength = 64;                // of the parts of a message, when an object does not say
constexpr std::size_t kStack = 128 * 1024;              // touched before the first tick
constexpr std::size_t kNone = SIZE_MAX;

void touchStack() {
    char stack[kStack];
    std::memset(stack, 0, sizeof stack);
    asm volatile("" : : "r"(stack) : "memory");
}

void mark(bool inside) {
    if (sormaTickMark) sormaTickMark(inside);
}

bool contains(sorma::Service& object, const sorma::Service* wanted) {
    if (&object == wanted) return true;
    for (auto& part : object.parts())
        if (contains(*part, wanted)) return true;
    return false;
}

}  // namespace

void Step::reserve() {
    std::size_t floats = kUsualLength;
    for (auto& pin : object->pins())
        if (pin.length != sorma::Pin::kOpen) floats = std::max(floats, pin.at + pin.length);
    message.floats.reserve(floats);
    message.ints.reserve(kUsualLength);
    message.text.reserve(std::max(request.text.size(), kUsualLength));
    message.any.reserve(std::max(request.any.size(), kUsualLength));
}

void Step::run(sorma::Steering* here) {
    message.clear();
    if (!request.floats.empty()) message.floats = request.floats;
    if (!request.ints.empty()) message.ints = request.ints;
    if (!request.text.empty()) message.text = request.text;
    if (!request.any.empty()) message.any = request.any;
    object.step(message, here);
}

Runner::Runner(std::string name, std::shared_ptr<sorma::Mailbox> mailbox, Owner& owner)
    : name_(std::move(name)), mailbox_(std::move(mailbox)), owner_(std::make_shared<Owner*>(&owner)) {}

Runner::~Runner() = default;

template <class Call> void Runner::tell(Call call) {
    mailbox_->post([owner = std::weak_ptr(owner_), call = std::move(call)] {
        if (auto o = owner.lock()) call(**o);
    });
}

// ---- the SORM's thread ----

void Runner::adopt(sorma::Service& service) {
    if (service.steering() == this) return;
    if (service.location() != "self") fail(kNotLocal, name_, service.name(), service.location());
    if (!service.type().isRealtime()) fail(kNotRealtime, name_, service.type().name(), service.name());
    if (service.steering()) fail(kTaken, name_, service.name());
    auto parts = service.parts();
    service.steer(this);
    steered_.emplace_back(&service);
    for (auto& part : parts) adopt(*part);
}

void Runner::admit(Plan& plan) {
    std::size_t before = steered_.size();
    try {
        for (auto& step : plan.steps) {
            adopt(*step.object);
            step.reserve();
        }
    } catch (...) {
        for (; steered_.size() > before; steered_.pop_back()) steered_.back()->steer(nullptr);
        throw;
    }
    if (!plan.onFault) return;
    try {
        if (plan.onFault->method == sorma::Method::exec) adopt(*plan.onFault->object);
        plan.onFault->reserve();
    } catch (const sorma::Error&) {     // it is reached as any request is: through the SORM
    }
    for (auto& step : plan.steps) step.containsAction = contains(*step.object, plan.onFault->object.get());
}

void Runner::release() {
    for (auto& object : steered_)
        if (object->steering() == this) object->steer(nullptr);
    steered_.clear();
}

std::vector<std::string> Runner::start(Plan plan, const Schedule& schedule) {
    admit(plan);
    plan_ = std::move(plan);
    stop_ = false;
    std::vector<std::string> refused;
    Futex started;
    thread_ = std::thread([this, schedule, &refused, &started] {
        refused = apply(schedule, "sorma-cycle");
        touchStack();
        started.set(1);
        run();
    });
    while (started.load() == 0) started.wait(0, sorma::monotonicNow() + kPatience);
    Schedule above = schedule;
    above.priority = above.priority > 0 ? std::min(above.priority + 1, 99) : 0;
    watchdog_ = std::thread([this, above] {
        apply(above, "sorma-watchdog");
        watch();
    });
    return refused;
}

bool Runner::stop() {
    stop_ = true;
    bell_.increase();
    std::int64_t patience = sorma::monotonicNow() + kPatience;
    for (std::uint32_t now; (now = phase_.load()) != kEnded && sorma::monotonicNow() < patience;) phase_.wait(now, patience);
    if (phase_.load() != kEnded) return false;
    thread_.join();
    {
        std::lock_guard lock(mutex_);
        woken_.notify_all();
    }
    watchdog_.join();
    release();
    return true;
}

void Runner::change(Plan plan) {
    // What leaves stays steered while the old plan may still be needed: an error keeps it.
    auto before = steered_;
    admit(plan);
    auto swap = [&] {
        for (auto& step : plan.steps)
            for (auto& old : plan_.steps)
                if (old.text == step.text) step.times = old.times;
        std::swap(plan_, plan);
    };
    borrow(name_, [&] {
        std::lock_guard lock(mutex_);
        swap();
    });
    std::vector<sorma::Reference> wanted;
    auto collect = [&](auto& self, sorma::Service& object) -> void {
        if (object.steering() != this) return;
        wanted.emplace_back(&object);
        for (auto& part : object.parts()) self(self, *part);
    };
    for (auto& step : plan_.steps) collect(collect, *step.object);
    if (plan_.onFault) collect(collect, *plan_.onFault->object);
    for (auto& object : steered_)
        if (std::none_of(wanted.begin(), wanted.end(), [&](auto& w) { return w.get() == object.get(); })) object->steer(nullptr);
    steered_ = std::move(wanted);
}

Figures Runner::figures() {
    Figures copy;
    borrow(name_, [&] {
        copy = figures_;
        for (auto& step : plan_.steps) copy.steps.emplace_back(step.text, step.times);
    });
    copy.ticks = ticks();
    return copy;
}

void Runner::resetFigures() {
    borrow(name_, [&] {
        figures_ = {};
        for (auto& step : plan_.steps) step.times = {};
    });
}

std::string Runner::busyWith() const {
    std::int64_t since = beat_.load(std::memory_order_relaxed);
    std::size_t at = at_.load(std::memory_order_relaxed);
    if (since == 0 || at >= plan_.steps.size()) return {};
    return plan_.steps[at].text + " since " + sorma::durationText(double(sorma::monotonicNow() - since));
}

// Whoever calls owns the SORM: its thread, or another runner that has it on loan.
void Runner::lend(sorma::Service& service, const std::function<void()>& work) { borrow(service.name(), work); }

void Runner::borrow(const std::string& who, const std::function<void()>& work) {
    if (phase_.load() == kEnded || phase_.load() == kRunning) return inPlace(work);
    std::int64_t patience = sorma::monotonicNow() + kPatience;
    if (auto deadline = sorma::Call::currentDeadline(); !deadline.none()) patience = std::min(patience, deadline.when());
    work_ = &work;
    if (!phase_.exchange(kIdle, kAsked)) return inPlace(work);      // it has ended just now
    bell_.increase();
    for (std::uint32_t now; (now = phase_.load()) != kDone;) {
        if (now == kEnded) return inPlace(work);
        if (now == kAsked && sorma::monotonicNow() >= patience && phase_.exchange(kAsked, kIdle))
            fail(kStuck, who, name_, busyWith());
        phase_.wait(now, patience + (now == kRunning ? kPatience : 0));
    }
    phase_.exchange(kDone, kIdle);
}

// On the calling thread, in the runner's name: it has ended, or is itself waiting for what it has borrowed.
void Runner::inPlace(const std::function<void()>& work) {
    auto* own = std::exchange(current_, this);
    bool had = hasLoan_.exchange(true);
    work();
    hasLoan_ = had;
    current_ = own;
}

// ---- the runner's thread ----

void Runner::run() {
    current_ = this;
    std::int64_t due = sorma::monotonicNow() + plan_.period;
    while (!stop_) {
        rest(due);
        if (stop_) break;
        if (faulty_) [[unlikely]] {
            afterFault();
            if (!plan_.goesOn) break;
        }
        tick(due);
        due += plan_.period;
        std::int64_t late = sorma::monotonicNow() - due;
        if (late < 0) continue;
        ++figures_.overruns;
        if (plan_.overrun == Overrun::catchUp) continue;
        if (plan_.overrun == Overrun::fault && !faulty_)
            noteFault({{}, {}, number_.load(std::memory_order_relaxed)});
        std::int64_t skipped = late / plan_.period + 1;
        figures_.skipped += std::uint64_t(skipped);
        due += skipped * plan_.period;
    }
    leave();
}

// Sleep until the tick is due, and do meanwhile what is asked.
void Runner::rest(std::int64_t due) {
    bool passed = false;
    for (;;) {
        std::uint32_t bell = bell_.load();
        if (stop_) return;
        if (phase_.load() == kAsked) {
            if (mayBorrow(due)) {
                serve();
                continue;
            }
            passed = true;
        }
        if (sorma::monotonicNow() >= due) break;
        bell_.wait(bell, due);
    }
    if (passed) ++passedOver_;
}

bool Runner::mayBorrow(std::int64_t due) const {
    return due - sorma::monotonicNow() > reserve_ + kLeastReserve || passedOver_ >= kMostPassed;
}

void Runner::serve() {
    if (!phase_.exchange(kAsked, kRunning)) return;     // withdrawn
    std::int64_t start = sorma::monotonicNow();
    hasLoan_ = true;
    (*work_)();
    hasLoan_ = false;
    phase_.set(kDone);
    std::int64_t took = sorma::monotonicNow() - start;
    figures_.longestRequest = std::max(figures_.longestRequest, took);
    ++figures_.requests;
    passedOver_ = 0;
    // The longest of late: what was long once fades, so that one slow request does not keep all others waiting.
    reserve_ = std::min(std::max(took, reserve_ - reserve_ / 8), plan_.period / 2);
}

void Runner::tick(std::int64_t due) {
    std::int64_t start = sorma::monotonicNow();
    std::uint64_t number = number_.load(std::memory_order_relaxed) + 1;
    number_.store(number, std::memory_order_relaxed);
    beat_.store(start, std::memory_order_relaxed);
    figures_.jitter.add(start - due);
    sorma::Tick now{due, double(plan_.period) / 1e9, number};
    sorma::Tick::Scope scope(now);
    bool timed = number % kSample == 1;
    std::int64_t last = start;
    mark(true);
    try {
        std::size_t i = 0;
        for (auto& step : plan_.steps) {
            at_.store(i++, std::memory_order_relaxed);
            step.run(this);
            if (timed) {
                std::int64_t end = sorma::monotonicNow();
                step.times.add(end - last);
                last = end;
            }
        }
        mark(false);
    } catch (...) {
        mark(false);
        auto& step = plan_.steps[at_.load(std::memory_order_relaxed)];
        noteFault({step.text, sorma::trailOfCurrentException(step.object->name()), number});
    }
    took_ = sorma::monotonicNow() - start;
    figures_.busy.add(took_);
    beat_.store(0, std::memory_order_relaxed);
    if (!hung_.load(std::memory_order_relaxed)) return;
    hung_ = false;                      // the watchdog has told of it, and taken the safe action
    faulty_ = true;
    ++figures_.faults;
}

void Runner::noteFault(Fault fault) {
    faulty_ = true;
    ++figures_.faults;
    if (fault.trail.empty())
        fault.trail.add(sorma::makeEntry(kOverrun, {sorma::MessageArg::of(name_), sorma::MessageArg::of(fault.tick),
                                                    sorma::MessageArg::of(sorma::durationText(double(took_))),
                                                    sorma::MessageArg::of(sorma::durationText(double(plan_.period)))}));
    tell([fault = std::move(fault)](Owner& owner) { owner.faulted(fault); });
}

void Runner::afterFault() {
    act(kNone);
    faulty_ = false;
    acted_ = false;
}

// The safe action, once for each fault. hanging: the step that does not return, when the watchdog asks.
void Runner::act(std::size_t hanging) {
    if (!plan_.onFault || acted_.exchange(true)) return;
    Step& action = *plan_.onFault;
    auto failed = [&](sorma::Trail trail) {
        tell([fault = Fault{action.text, std::move(trail), ticks()}](Owner& owner) { owner.faulted(fault); });
    };
    if (action.object->steering() != this) return tell([&action](Owner& owner) { owner.act(action); });
    if (hanging < plan_.steps.size() && plan_.steps[hanging].containsAction) {
        sorma::Trail trail;
        trail.add(sorma::makeEntry(kActionHangs, {sorma::MessageArg::of(name_), sorma::MessageArg::of(action.text)}));
        return failed(std::move(trail));
    }
    try {
        action.run(this);
    } catch (...) {
        failed(sorma::trailOfCurrentException(action.object->name()));
    }
}

// The objects belong to nobody when the thread has ended: whoever wants something of them helps himself.
void Runner::leave() {
    if (faulty_) afterFault();
    bool asked = stop_;
    for (;;) {
        std::uint32_t phase = phase_.load();
        if (phase == kAsked) serve();
        else if (phase == kIdle && phase_.exchange(kIdle, kEnded)) break;
        else phase_.wait(phase, sorma::monotonicNow() + 1'000'000);
    }
    phase_.set(kEnded);
    if (!asked) tell([](Owner& owner) { owner.ended(); });
}

// ---- the watchdog's thread ----

void Runner::watch() {
    current_ = this;
    std::unique_lock lock(mutex_);
    while (!stop_ && phase_.load() != kEnded) {
        std::int64_t limit = plan_.watchdog;
        woken_.wait_for(lock, std::chrono::nanoseconds(limit / 4));
        std::int64_t since = beat_.load(std::memory_order_relaxed);
        if (since == 0 || sorma::monotonicNow() - since < limit || hung_.exchange(true)) continue;
        std::size_t at = at_.load(std::memory_order_relaxed);
        std::string step = at < plan_.steps.size() ? plan_.steps[at].text : std::string();
        sorma::Trail trail;
        trail.add(sorma::makeEntry(kHangs, {sorma::MessageArg::of(name_), sorma::MessageArg::of(ticks()),
                                            sorma::MessageArg::of(sorma::durationText(double(limit))), sorma::MessageArg::of(step)}));
        tell([fault = Fault{step, std::move(trail), ticks()}](Owner& owner) { owner.faulted(fault); });
        act(at);
    }
}

}  // namespace cycle
