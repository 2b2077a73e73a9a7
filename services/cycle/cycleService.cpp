// cycle -- runs service objects at a fixed period, in a thread of its own.
//
//     cycle.fast CTRL -period 0.001 -steps {circuit.control shmem_w.set} -onfault {shmem_w.set EXEC FMSG 2 0 0}
//     cycle.fast CTRL -start
//
// A step is the name of an object, or a whole EXEC request. Its class must say that it is real-time.
//
// A change while the cycle runs is prepared here, on the SORM's thread, while ticks go on; then the runner takes the new
// plan between two of them.
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include <sorma.h>

#include "bus/incident.h"
#include "byHand.h"
#include "runner.h"

namespace {

using cycle::Fault;
using cycle::Plan;
using cycle::Step;
using sorma::Args;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kNoSteps{Severity::error, "OPTION MISSING", 2, "{}: {} is empty: it names the objects to run"};
const sorma::Prototype kRunning{Severity::error, "CYCLE RUNNING", 1, "{}: it runs; {}"};
const sorma::Prototype kNotRunning{Severity::error, "CYCLE STOPPED", 1, "{}: it does not run; CTRL -start starts it"};
const sorma::Prototype kExecOnly{Severity::error, "OPTION VALUE", 2, "{}: -steps {}: a step is a name, or a request for EXEC without words"};
const sorma::Prototype kWithin{Severity::error, "CYCLE STEP", 2, "{}: {} cannot be a step of itself"};
const sorma::Prototype kHangs{Severity::error, "CYCLE HANGS", 1,
                              "{}: it hangs in its step {}, and cannot be stopped; CTRL -abandon abandons that step"};
const sorma::Prototype kNotHanging{Severity::error, "CYCLE RUNNING", 1, "{}: no step hangs: CTRL -stop ends it"};
const sorma::Prototype kNoClock{Severity::error, "CYCLE CLOCK", 2, "{}: -clock {}: {}"};
const sorma::Prototype kNotActed{Severity::error, "CYCLE ACTION", 1, "{}: the safe action {} has failed"};
const sorma::Prototype kUsual{Severity::warning, "CYCLE REALTIME", 1, "{}: {}"};

const sorma::Prototype kIncident{Severity::warning, "CYCLE INCIDENT", 2, "{}: {}: {} times, {} in all"};

constexpr std::int64_t kLeastWatchdog = 50'000'000;     // [ns]
constexpr int kWatchdogPeriods = 10;
constexpr std::int64_t kLook = 200'000'000;           // [ns] from one look for incidents to the next
constexpr std::int64_t kAgain = 10'000'000'000;      // [ns] until one of the same kind is told again

class Cycle : public sorma::Service, private cycle::Owner {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Cycle>("cycle", "runs service objects at a fixed period, in a thread of its own")
            .text("-steps", &Cycle::steps_, {.help = "the steps: names, or requests for EXEC as one word each"})
            .real("-period", &Cycle::period_, {.unit = "s", .low = 250e-6, .high = 3600, .help = "from one tick to the next"})
            .choice("-overrun", &Cycle::overrun_, {"skip", "catchUp", "fault"},
                    {.help = "when a tick is not over before the next is due: leave out what was missed, run it at once, or fail"})
            .text("-onfault", &Cycle::onFault_, {.help = "request that ends a tick in which a step has failed or hangs: the safe action"})
            .choice("-afterFault", &Cycle::afterFault_, {"stop", "continue"}, {.help = "what happens to the steps then"})
            .real("-watchdog", &Cycle::watchdog_, {.unit = "s", .low = 0, .high = 3600,
                                                   .help = "a tick that takes longer hangs; 0: ten periods, at least 0.05 s"})
            .named("-clock", &Cycle::clock_, {.help = "key of a snapshot buffer: ticks are due by its float 0 [s]; empty: by the machine's clock"})
            .integer("-priority", &Cycle::priority_, {.low = 0, .high = 99, .help = "of SCHED_FIFO; 0: an ordinary thread"})
            .integer("-cpu", &Cycle::cpu_, {.low = -1, .high = 1023, .help = "processor to run on; -1: those of the process"})
            .flag("-lockMemory", &Cycle::lockMemory_, {.help = "keep the process's memory from being paged out while it runs"})
            .flag("-autostart", &Cycle::autostart_, {.help = "start when made", .fixed = true, .danger = sorma::Danger::move})
            .execDanger(sorma::Danger::move)
            .action("-start", &Cycle::start, "", "begin; a warning tells what real-time help the system has refused")
            .danger(sorma::Danger::move)
            .action("-stop", &Cycle::stopNow, "", "end after the present tick", 0, 0, sorma::Right::call)
            .danger(sorma::Danger::stop)
            .action("-abandon", &Cycle::abandonNow, "", "give up a step that hangs for ever, with its objects; then it can be started without them")
            .action("-reset", &Cycle::reset, "", "begin the figures of DBX -stats again")
            .inspection({"-stats", "", "ticks, jitter, time of each step; ints: ticks, those skipped; floats: how late ticks began, median and 99 of 100 as upper bounds, longest [s]",
                         0, 0, [](Service& s, Args, Message& m) {
                             Message told = static_cast<Cycle&>(s).figures();
                             m.text += told.text;
                             m.ints = told.ints, m.floats = told.floats;
                         }})
            .inspection({"-incidents", "", "object, kind, count: what the steps and their units could not use, what they missed, what has stopped them", 0, 0,
                         [](Service& s, Args, Message& m) { m.text += static_cast<Cycle&>(s).incidentsText(); }})
            .inspection({"-due", "", "floats: when the next tick is due, and the time now, by its clock [s]; ints: 1 while it runs", 0, 0,
                         [](Service& s, Args, Message& m) { static_cast<Cycle&>(s).tellDue(m); }})
            .writes(sorma::Field::ints, sorma::exactly(1), "", "number of the tick")
            .example("cycle CTRL -period 0.01 -steps nop");
    }

    ~Cycle() override { end(); }

    void born() override {
        plan();
        if (!autostart_) return;
        Message m;
        start({}, m);
        if (!m.trail.empty()) sorm().announce(m.trail);
    }

    void changed(std::span<const sorma::Option* const> options) override {
        Plan next = plan();
        for (auto* o : options)
            if (o->name == "-clock") hand_.forget();
        if (!runner_) return;
        for (auto* o : options)
            for (auto* fixed : {"-priority", "-cpu", "-lockMemory", "-clock"})
                if (o->name == fixed) fail(kRunning, name(), std::string(fixed) + " can be changed after CTRL -stop");
        if (next.steps.empty()) fail(kNoSteps, name(), "-steps");
        auto steps = objects(next);
        runner_->change(std::move(next));
        watched_ = std::move(steps);
    }

    // One tick by hand, on the caller's thread: to try things out.
    void exec(Message& m) override {
        if (runner_) fail(kRunning, name(), "EXEC runs one tick while it is stopped");
        Plan once = plan();
        if (once.steps.empty()) fail(kNoSteps, name(), "-steps");
        const std::int64_t now = clockNow();
        sorma::Tick tick{hand_.due(now, once.period), period_, ++byHand_};
        hand_.ticked(tick.time, now);
        sorma::Tick::Scope scope(tick);
        for (auto& step : once.steps) step.run(nullptr);
        m.ints.assign(1, std::int64_t(byHand_));
    }

    void removing() override { end(); }

    void dumpState(std::string& out) const override {
        out += std::string("# state ") + (runner_ ? "running" : fault_.trail.empty() ? "stopped" : "faulted") + "\n";
        if (runner_) {
            out += "# tick " + std::to_string(runner_->ticks()) + "\n";
            if (auto busy = runner_->busyWith(); !busy.empty()) out += "# busy with " + busy + "\n";
        }
        for (auto& line : refused_) out += "# refused " + line + "\n";
        for (auto& line : givenUp_) out += "# given up " + line + "\n";
        if (!fault_.trail.empty())
            out += "# fault in tick " + std::to_string(fault_.tick) + (fault_.step.empty() ? "" : ", step " + fault_.step) + ": " +
                   sorma::Error(fault_.trail).what() + "\n";
    }

private:
    // ---- the steps to run ----

    // An object by the name that the author of an option has written there. He must be allowed to call it: when the option is set, and
    // again when the cycle is started with it. Never inside a tick.
    sorma::Reference named(const std::string& target, sorma::Method method, const sorma::PrincipalPointer& author) {
        sorma::Reference object = sorm().get(target, author);
        // Each word of a safe action for CTRL asks for its own right, when it is sent.
        auto right = method == sorma::Method::exec ? object->type().execRight() : sorma::Right::call;
        if (!object->isElsewhere()) {
            object->need(author, right);
            if (method == sorma::Method::exec && object->isDangerous()) object->need(author, sorma::Right::operate);
        }
        return object;
    }

    Step step(const std::string& text, bool execOnly, const sorma::PrincipalPointer& author) {
        Step s;
        s.text = text;
        std::string target = text;
        if (text.find_first_of(" \t\n") != std::string::npos) {
            sorma::parseRequest(text, target, s.method, s.request);
            if (execOnly && (s.method != sorma::Method::exec || !s.request.words.empty())) fail(kExecOnly, name(), text);
        }
        s.object = named(target, s.method, author);
        if (s.method == sorma::Method::exec) s.object->needWords(author, s.request.words);
        s.request.author = author;
        if (s.object.get() == this) fail(kWithin, name(), name());
        return s;
    }

    Plan plan() {
        Plan p;
        p.period = std::llround(period_ * 1e9);
        p.overrun = overrun_ == "skip" ? cycle::Overrun::skip : overrun_ == "fault" ? cycle::Overrun::fault : cycle::Overrun::catchUp;
        p.goesOn = afterFault_ == "continue";
        p.watchdog = watchdog_ > 0 ? std::llround(watchdog_ * 1e9) : std::max(kWatchdogPeriods * p.period, kLeastWatchdog);
        for (auto& word : sorma::splitWords(steps_)) p.steps.push_back(step(word, true, author("-steps")));
        if (!onFault_.empty()) p.onFault = std::make_shared<Step>(step(onFault_, false, author("-onfault")));
        return p;
    }

    // ---- requests ----

    void start(Args, Message& m) {
        if (runner_) fail(kRunning, name(), "CTRL -stop stops it");
        Plan p = plan();
        if (p.steps.empty()) fail(kNoSteps, name(), "-steps");
        std::unique_ptr<cycle::Clock> clock;
        try {
            clock = clock_.empty() ? cycle::machineClock() : cycle::snapshotClock(clock_.use(*this));
        } catch (const std::runtime_error& e) {
            fail(kNoClock, name(), clock_.get(sorma::Permit::owner()), e.what());
        }
        auto runner = std::make_unique<cycle::Runner>(name(), sorm().mailbox(), static_cast<cycle::Owner&>(*this));
        auto steps = objects(p);
        std::string memory = lockMemory_ ? memory_.acquire() : std::string();
        try {
            refused_ = runner->start(std::move(p), {int(priority_), int(cpu_)}, std::move(clock));
        } catch (...) {
            memory_.release();
            throw;
        }
        runner_ = std::move(runner);
        if (!memory.empty()) refused_.push_back(memory);
        watched_ = std::move(steps);
        incidents_.clear();
        look(true);
        fault_ = {};
        for (auto& line : refused_) m.warn(kUsual, name(), line);
        publishText("started", steps_);
    }

    // Time by its clock. The machine's clock stands while the cycle is stopped, as all of its time does; so does a clock whose buffer is away.
    std::int64_t clockNow() const {
        if (!clock_.empty()) {
            try {
                return cycle::snapshotClock(clock_.use(*this))->now();
            } catch (const std::runtime_error&) {
            }
        }
        return runner_ || !hand_.any() ? sorma::monotonicNow() : hand_.last();
    }

    void tellDue(Message& m) {
        const std::int64_t now = clockNow(), due = runner_ ? runner_->due() : hand_.after(now, std::llround(period_ * 1e9));
        m.floats = {double(due) * 1e-9, double(now) * 1e-9};
        m.ints.assign(1, runner_ ? 1 : 0);
    }

    void stopNow(Args, Message&) {
        if (!runner_) fail(kNotRunning, name());
        halt();
    }

    void reset(Args, Message&) {
        if (!runner_) fail(kNotRunning, name());
        runner_->resetFigures();
    }

    void abandonNow(Args, Message&) {
        if (!runner_) fail(kNotRunning, name());
        std::string step = runner_->busyWith();
        if (step.empty() || !leaveBehind()) fail(kNotHanging, name());
        givenUp_.push_back(step);
        publishText("abandoned", step);
    }

    void halt() {
        if (!runner_->stop()) fail(kHangs, name(), runner_->busyWith());
        last_ = figures();
        if (const auto before = runner_->due() - std::llround(period_ * 1e9); runner_->ticks() > 0) hand_.ticked(before, before);
        rest();
        cycle::Runner::dismiss(std::move(runner_));
        memory_.release();
        publishText("stopped", steps_);
    }

    // With a step that hangs, its thread and what it uses stay as they are: nobody can take them away from it.
    bool leaveBehind() {
        if (runner_->stop()) {
            halt();
            return false;
        }
        if (!runner_->abandon()) return false;
        rest();
        (void)runner_.release();
        memory_.release();
        return true;
    }

    void end() {
        rest();
        while (runner_ && !runner_->stop())
            if (runner_->abandon()) (void)runner_.release();
        cycle::Runner::dismiss(std::move(runner_));
        memory_.release();
    }

    Message figures() {
        if (!runner_) return last_;
        auto f = runner_->figures();
        std::string out = "ticks " + std::to_string(f.ticks) + " skipped " + std::to_string(f.skipped) + " overruns " +
                          std::to_string(f.overruns) + " faults " + std::to_string(f.faults) + " requests " +
                          std::to_string(f.requests) + " delayed " + std::to_string(f.delayed) + " heldUp " + std::to_string(f.heldUp) + "\n";
        auto times = [&](const std::string& what, const sorma::Histogram& h) {
            out += what + ": p50 <= " + sorma::durationText(double(h.quantile(0.5))) + ", p99 <= " +
                   sorma::durationText(double(h.quantile(0.99))) + ", longest " + sorma::durationText(double(h.quantile(1))) + "\n";
        };
        times("jitter of the beginning", f.jitter);
        out += f.jitter.toText() + "\n";
        times("length of a tick", f.busy);
        for (auto& [step, h] : f.steps)
            if (h.count() > 0) times("step " + step + ", one tick in " + std::to_string(cycle::Runner::kSample), h);
        if (f.held.count() > 0) times("time of a request between ticks", f.held);
        Message m;
        m.text = out.substr(0, out.size() - 1);
        m.ints = {std::int64_t(f.ticks), std::int64_t(f.skipped)};
        for (double part : {0.5, 0.99, 1.0}) m.floats.push_back(double(f.jitter.quantile(part)) / 1e9);
        return m;
    }

    // ---- incidents of steps and their units ----

    static std::vector<sorma::Reference> objects(const Plan& p) {
        std::vector<sorma::Reference> out;
        for (auto& step : p.steps) out.push_back(step.object);
        return out;
    }

    // before: they are from before it was started.
    void gather(bool before) {
        sorma::Incidents now;
        for (auto& object : watched_) sorma::tellIncidents(*object, now);
        for (auto& incident : incidents_) incident.second.here = false;
        for (auto& i : now) {
            Known& known = incidents_[{i.object, i.kind}];
            if (std::exchange(known.here, true)) continue;          // a unit of several circuits
            if (!before) known.sum += i.count >= known.seen ? i.count - known.seen : i.count;
            known.seen = i.count;
            known.byItself = i.told;
        }
    }

    void look(bool before) {
        gather(before);
        const std::int64_t now = sorma::monotonicNow();
        for (auto& [which, known] : incidents_) {
            if (known.sum == known.told || now < known.next) continue;
            const std::uint64_t news = known.sum - known.told;
            known.told = known.sum, known.next = now + kAgain;
            Message m;
            m.words = {which.first, which.second};
            m.ints = {std::int64_t(known.sum)};
            publish("incident", m);
            if (known.byItself) continue;
            auto entry = sorma::makeEntry(kIncident, {sorma::MessageArg::of(which.first), sorma::MessageArg::of(which.second),
                                                      sorma::MessageArg::of(news), sorma::MessageArg::of(known.sum)});
            entry.so = which.first;
            sorm().announce(sorma::Trail(std::move(entry)));
        }
        if (sorm().hasLoop()) timer_ = sorm().loop().after(now + kLook, [this] { look(false); });
    }

    // It has stopped: what has happened until then still counts.
    void rest() {
        if (watched_.empty()) return;
        gather(false);
        timer_.cancel();
        watched_.clear();
    }

    std::string incidentsText() {
        gather(false);
        std::string out;
        for (auto& [which, known] : incidents_)
            if (known.sum > 0) out += (out.empty() ? "" : "\n") + sorma::toText(sorma::Value(which.first)) + " {" + which.second + "} " + std::to_string(known.sum);
        return out;
    }

    void publishText(std::string_view event, const std::string& text) {
        Message m;
        m.text = text;
        publish(event, m);
    }

    // ---- what the runner tells ----

    void faulted(const Fault& fault) override {
        fault_ = fault;
        Message m;
        m.text = sorma::Error(fault.trail).what();
        m.words = {fault.step};
        m.ints = {std::int64_t(fault.tick)};
        publish("fault", m);
        sorm().announce(fault.trail);
    }

    void act(const Step& action) override {
        auto answer = action.object->async(action.method, action.request);
        answer.then([self = sorma::Reference(this), text = action.text](sorma::Future f) {
            if (!f.pending()->failed()) return;
            sorma::Trail trail = f.pending()->failure;
            trail.add(sorma::makeEntry(kNotActed, {sorma::MessageArg::of(self->name()), sorma::MessageArg::of(text)}));
            static_cast<Cycle&>(*self).faulted({text, std::move(trail), 0});
        });
    }

    void ended() override {
        if (runner_) halt();
    }

    std::string steps_, overrun_ = "skip", onFault_, afterFault_ = "stop";
    sorma::Named<sorma::Kind::segment> clock_;
    double period_ = 0.015, watchdog_ = 0;
    std::int64_t priority_ = 50, cpu_ = -1;
    bool lockMemory_ = true, autostart_ = false;

    std::unique_ptr<cycle::Runner> runner_;         // while it runs
    cycle::MemoryLock memory_;
    std::vector<std::string> refused_, givenUp_;
    Fault fault_;                                   // the last one since it was started
    Message last_ = [] { Message m; m.text = "it has not run yet"; return m; }();       // figures when it was stopped
    std::uint64_t byHand_ = 0;
    cycle::ByHand hand_;                    // when they are due

    struct Known {
        std::uint64_t seen = 0, sum = 0, told = 0;  // as its object counts; since the cycle was started; named in the trail
        std::int64_t next = 0;                      // [ns] not before then again
        bool here = false, byItself = false;
    };
    std::map<std::pair<std::string, std::string>, Known> incidents_;       // object, kind
    std::vector<sorma::Reference> watched_;         // its steps, while it runs
    sorma::Timer timer_;
};

}  // namespace

extern "C" SORMA_EXPORT int Cycle_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::cycle", "1.0", {Cycle::describe()});
}
