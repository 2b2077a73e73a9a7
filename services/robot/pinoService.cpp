// pino -- the arm: its control task, its power, its state.
//
//     pino EXEC power on
//     pino EXEC                   -> where it is, what it feels
//     pino CTRL -stop             the next tick of the control task begins to brake
//
// It makes a cycle of its own for the control task, cycle.NAME, and is itself the step that reads the sensors and writes
// the set-point.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "errors.h"
#include "pino.h"
#include "wspc.h"

namespace robot {

namespace {

using sorma::Args;
using sorma::Message;

constexpr std::int64_t kLook = 50'000'000;          // [ns] between two looks at the other side, and of progress
// [s] Lab time may stand so long, while a picture is drawn on a machine that has other work; and what is read is older then.
constexpr double kLabWatchdog = 20, kLabSilence = 2;

Joints joints(const std::vector<double>& v) { return Eigen::Map<const Joints>(v.data()); }
Vector3d vector(const std::vector<double>& v) { return Eigen::Map<const Vector3d>(v.data()); }
std::string percent(double part) { return std::to_string(int(std::lround(100 * part))) + " %"; }

// For the length of a block no tick uses the arm.
using Held = sorma::BetweenTicks;

template <class... Values> sorma::Error error(const sorma::Prototype& prototype, const Values&... values) {
    return sorma::Error(sorma::makeEntry(prototype, {sorma::MessageArg::of(values)...}));
}

}  // namespace

sorma::Class Pino::describe() {
    using enum sorma::Field;
    const std::string by = ", by joint";
    return sorma::Class::of<Pino>("pino", "an arm: its control task, its power, and where it is")
        .real("-interval", &Pino::interval_, {.unit = "s", .low = 0.001, .high = 0.1,
                                              .help = "from one tick of the control task to the next"})
        .flag("-labTime", &Pino::labTime_, {.help = "ticks are due by the other side's time (its buffer lab.clock), not by "
                                                    "the machine's", .fixed = true})
        .real("-silence", &Pino::silence_, {.unit = "s", .low = 0.01, .high = 60, .help = "the other side counts as gone when its "
                                            "last record is older than this, and than three ticks", .expert = true})
        .integer("-priority", &Pino::priority_, {.low = 0, .high = 99, .help = "of the control task, as of class cycle",
                                                 .fixed = true})
        .named("-prefix", &Pino::prefix_, {.help = "before the names of all buffers: another arm's", .fixed = true})
        .text("-tasks", &Pino::tasks_, {.help = "control tasks of other services that are executed in each tick before "
                                                "this one: names, or requests as for cycle"})
        .flag("-sensors", &Pino::sensors_, {.help = "read the wrist's force and moment"})
        .flag("-gravityCompensation", &Pino::compensate_, {.help = "subtract the hand's weight and inertia from what the wrist "
                                                                   "feels"})
        .flag("-records", &Pino::records_, {.help = "write the buffers tool.pose and tool.force in each tick", .fixed = true})
        .text("-guards", &Pino::guards_, {.help = "names of guards (class wspc) that hold in every motion"})
        .vector("-lower", &Pino::lower_, {.unit = "rad", .low = -10, .high = 10, .help = "least angles" + by, .minLength = 6,
                                          .maxLength = 6})
        .vector("-upper", &Pino::upper_, {.unit = "rad", .low = -10, .high = 10, .help = "largest angles" + by,
                                          .minLength = 6, .maxLength = 6})
        .vector("-maxSpeed", &Pino::speed_, {.unit = "rad/s", .low = 0.001, .high = 100,
                                             .help = "that no set-point exceeds" + by, .minLength = 6, .maxLength = 6})
        .vector("-maxAcceleration", &Pino::acceleration_,
                {.unit = "rad/s2", .low = 0.001, .high = 1000, .help = "the same; also how it brakes when it cannot stay "
                                                                       "on its path" + by, .minLength = 6, .maxLength = 6})
        .vector("-base", &Pino::base_, {.unit = "m", .low = -10, .high = 10, .help = "the robot's base in the world",
                                        .minLength = 3, .maxLength = 3})
        .vector("-tool", &Pino::tool_, {.unit = "m", .low = -2, .high = 2, .help = "the tool in the flange's frame",
                                        .minLength = 3, .maxLength = 3})
        .real("-handMass", &Pino::handMass_, {.unit = "kg", .low = 0, .high = 10,
                                              .help = "of what the wrist's sensor carries; see calibrate"})
        .vector("-handCentre", &Pino::handCentre_, {.unit = "m", .low = -1, .high = 1,
                                                    .help = "its centre from the sensor, tool axes", .minLength = 3,
                                                        .maxLength = 3})
        .vector("-sensorOffset", &Pino::sensorOffset_, {.unit = "N, N m", .low = -1000, .high = 1000,
                                                        .help = "what the sensor shows without any load",
                                                         .minLength = 6, .maxLength = 6})
        .real("-forceFilter", &Pino::forceFilter_, {.unit = "s", .low = 1e-4, .high = 1,
                                                    .help = "time constant of the low-pass for forces"})
        .real("-wristForce", &Pino::wristForce_, {.unit = "N", .low = 1, .high = 1000,
                                                  .help = "more than that at the wrist stops the arm, whatever moves it"})
        .real("-wristMoment", &Pino::wristMoment_, {.unit = "N m", .low = 0.1, .high = 100, .help = "the same"})
        .vector("-parkPosture", &Pino::park_, {.unit = "rad", .low = -10, .high = 10, .help = "where EXEC park goes" + by,
                                               .minLength = 6, .maxLength = 6})
        .real("-parkSpeed", &Pino::parkSpeed_, {.unit = "rad/s", .low = 0.01, .high = 2,
                                                .help = "of the fastest joint on the way there"})
        .action("-start", &Pino::start, "", "begin the control task; EXEC power on does it by itself")
        .action("-end", &Pino::end, "", "end the control task; the arm must have no power")
        .action({"-stop", "", "stop the motion under way: the next tick begins to brake", 0, 0,
                 [](Service& s, Args a, Message& m) { static_cast<Pino&>(s).stop(a, m); }, sorma::Right::call, true})
        .danger(sorma::Danger::stop)
        .execDanger(sorma::Danger::stop, {"power off"})
        .execDanger(sorma::Danger::power, {"power", "reset"})
        .execDanger(sorma::Danger::move, {"park"})
        .words("?park | power on|off | reset | status?")
        .writes(floats, sorma::between(0, 19), "",
                "without words and status: the tool's position [m] (3) and quaternion w x y z (4), measured; joint angles "
                "[rad] (6); force [N] and "
                "moment [N m] from outside on the hand, tool axes (6)")
        .writes(ints, sorma::between(0, 3), "", "without words and status: power; cause of its loss, 0 for none; whether "
                                                "it is moving")
        .writes(text, {}, "", "status: in clear text")
        .concurrency(sorma::Concurrency::concurrent)
        .realtime()
        .example("pino CTRL -interval 0.015");
}

Pino::~Pino() { halt(); }

void Pino::born() { changed({}); }

// ---- options ----

void Pino::changed(std::span<const sorma::Option* const> options) {
    for (std::size_t i = 0; i < 6; ++i) {
        const std::string joint = std::to_string(i + 1);
        if (lower_[i] > upper_[i])
            fail(kOrder, name(), "-lower", number(lower_[i]) + " of joint " + joint +
                                             " is above its -upper " + number(upper_[i]));
        if (park_[i] < lower_[i] || park_[i] > upper_[i])
            fail(kOrder, name(), "-parkPosture", number(park_[i]) + " of joint " + joint + " is outside " +
                 number(lower_[i]) + " .. " + number(upper_[i]));
    }
    if (!control_) return;
    if (job_)
        for (auto* o : options)
            if (o->name == "-lower" || o->name == "-upper" || o->name == "-base" || o->name == "-tool" ||
                o->name == "-interval")
                fail(kBusy, name(), job_->who, job_->caller, percent(control_->part()));
    control_->settings = settings();
    for (auto* o : options) {
        if (o->name == "-interval") configureCycle({"-period", number(interval_)});
        if (o->name == "-tasks") configureCycle({"-steps", steps()});
    }
}

Settings Pino::settings() const {
    Settings s;
    s.frames = {vector(base_), vector(tool_)};
    s.limits = {{joints(lower_), joints(upper_)}, joints(speed_), joints(acceleration_)};
    s.labClock = labTime_;
    s.silence = labTime_ ? std::max(silence_, kLabSilence) : silence_;
    s.sensors = sensors_, s.compensate = compensate_;
    s.handMass = handMass_, s.handCentre = vector(handCentre_);
    s.sensorOffset = Eigen::Map<const Wrench>(sensorOffset_.data());
    s.forceFilter = forceFilter_, s.wristForce = wristForce_, s.wristMoment = wristMoment_;
    return s;
}

std::string Pino::steps() const { return tasks_.empty() ? name() : tasks_ + " " + name(); }

// The cycle belongs to the arm; the author of -tasks has named the objects that it executes.
void Pino::configureCycle(std::vector<std::string> words) {
    Message m;
    m.words = std::move(words);
    m.author = author("-tasks");
    cycle_->invoke(sorma::Method::ctrl, m);
}

// ---- the control task ----

void Pino::run() {
    if (control_) return;
    auto control = std::make_unique<Control>(prefix_.use(*this));
    try {
        control->arm.publish(sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName, records_);
        control->arm.attach(control->arm.look());
    } catch (const shmem::Failure& f) {
        fail(kTask, name(), f.what());
    }
    control->settings = settings();
    control_ = std::move(control);
    const auto dot = name().find('.');
    cycle_ = sorm().get("cycle." + (dot == std::string::npos ? name() : name().substr(dot + 1)));
    try {
        std::vector<std::string> words{"-period", number(interval_), "-priority", std::to_string(priority_), "-steps",
                                       steps()};
        if (labTime_) words.insert(words.end(), {"-clock", prefix_.use(*this) + "lab.clock", "-watchdog", number(kLabWatchdog)});
        configureCycle(std::move(words));
        configureCycle({"-start"});
    } catch (const sorma::Error& e) {
        control_.reset();
        cycle_ = {};
        fail(kTask, name(), e.what());
    }
    sorm().loop().watch(control_->bell(), [this] { ended(); });
    watch();
}

void Pino::start(Args, Message&) { run(); }

void Pino::end(Args, Message&) {
    if (!control_) fail(kTask, name(), "it has not been started");
    bool off;
    {
        Held held(*this);
        off = control_->phase() == Phase::off;
    }
    if (!off) fail(kTask, name(), "the arm has power; say \"" + name() + " EXEC power off\" before");
    halt();
}

// A motion stops by the other side's rule, when set-points end.
void Pino::halt() {
    if (!control_) return;
    timer_ = {};
    if (sorm().hasLoop()) sorm().loop().unwatch(control_->bell());
    try {
        Message m;
        m.words = {"-stop"};
        cycle_->invoke(sorma::Method::ctrl, m);
    } catch (const sorma::Error&) {         // it has stopped by itself
    }
    cycle_ = {};
    control_.reset();
}

void Pino::removing() {
    halt();
    failAll(error(kGone, name()));
}

void Pino::failAll(const sorma::Error& why) {
    auto queue = std::exchange(queue_, {});
    if (job_) queue.push_front(std::exchange(job_, nullptr));
    for (auto& job : queue) job->reply.fail(why);
    for (auto* replies : {&waking_, &sleeping_})
        for (auto& reply : std::exchange(*replies, {})) reply.fail(why);
}

// From time to time: has the other side come back, does the control task run, how far is the motion?
void Pino::watch() {
    timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    if (!realtimeOwner()) {
        // By lab time it ends too when the other side's clock stands still: the record of the arm is old then.
        ArmState last;
        double age = 0;
        const bool silent = control_->arm.attached() && (!control_->arm.read(last, age) || age > 2 * interval_);
        const auto why = silent ? error(kSilent, name(), name())
                                : error(kTask, name(), "it has ended; see " + cycle_->name() + " CTRL -dump");
        halt();
        return failAll(why);
    }
    double part = 0;
    bool gone;                              // with lab time there are no ticks then
    try {
        bool lost;
        {
            Held held(*this);
            lost = !control_->arm.attached() || !control_->heard();
            part = control_->part();
        }
        if (lost) {
            auto readers = control_->arm.look();
            Held held(*this);
            control_->arm.attach(std::move(readers));
        }
        gone = labTime_ && !control_->arm.alive();
    } catch (const sorma::Error&) {         // a step of another object hangs: try again later
        return;
    }
    if (gone) {
        halt();
        return failAll(error(kSilent, name(), name()));
    }
    if (job_ && job_->progress) {
        sorma::CallContext context(job_->call);
        job_->progress(part);
    }
}

// ---- requests ----

void Pino::exec(Message& m) {
    if (m.words.empty()) {
        if (auto* tick = sorma::Tick::current()) [[likely]] {
            if (control_) control_->tick(tick->time, tick->period);
            return m.clear();
        }
        return status(m);
    }
    const std::string word = m.words[0];
    if (word == "power") return power(m);
    if (m.words.size() > 1) fail(kWord, name(), m.words[1], "nothing after \"" + word + "\"");
    if (word == "status") return status(m);
    if (word == "park") return park(m);
    if (word != "reset") fail(kWord, name(), word, "park, power, reset, or status");
    if (control_) {
        Held held(*this);
        control_->acknowledge();
    }
    m.clear();
}

Now Pino::now() {
    if (!control_) fail(kTask, name(), "say \"" + name() + " CTRL -start\", or EXEC power on");
    Held held(*this);
    Now n;
    n.settings = control_->settings;
    n.state = control_->state();
    n.q = control_->phase() == Phase::off ? n.state.q : control_->setPoint();
    n.tool = n.settings.frames.toolOf(n.q);
    n.period = interval_;
    n.felt = control_->felt();
    n.sensed = control_->sensed();
    return n;
}

void Pino::status(Message& m) {
    const bool inWords = !m.words.empty();
    m.clear();
    if (!control_) {
        m.text = "the control task does not run";
        return;
    }
    const Now n = now();
    if (!control_->knows()) {
        m.text = "the arm's other side has not spoken yet";
        return;
    }
    append(m.floats, n.settings.frames.toolOf(n.state.q));
    m.floats.insert(m.floats.end(), n.state.q.data(), n.state.q.data() + 6);
    m.floats.insert(m.floats.end(), n.felt.data(), n.felt.data() + 6);
    m.ints = {n.state.power, std::int64_t(n.state.cause), job_ != nullptr};
    if (!inWords) return;
    Held held(*this);
    m.text = std::string("control task ") + toText(control_->phase()) + "\n";
    m.text += control_->heard() ? "other side there" : "other side silent" + (control_->arm.problem().empty() ? "" : ": " +
        control_->arm.problem());
    m.text += std::string("\npower ") + (n.state.power ? "on" : "off") + ", cause of its loss " + toText(n.state.cause);
    m.text += std::string("\nwrist ") + (control_->overloaded() ? "overloaded" : n.sensed ? "sensed" : "not sensed");
    if (job_) m.text += "\nmoved by " + job_->who + " for " + job_->caller + ", " + percent(control_->part());
    if (!queue_.empty()) m.text += "\nwaiting " + std::to_string(queue_.size());
}

void Pino::needHardware() {
    run();
    auto readers = control_->arm.attached() ? Arm::Readers{} : control_->arm.look();
    Held held(*this);
    if (!control_->arm.attached()) control_->arm.attach(std::move(readers));
    if (!control_->arm.attached()) fail(kHardware, name(), control_->arm.problem());
}

void Pino::power(Message& m) {
    if (m.words.size() != 2 || (m.words[1] != "on" && m.words[1] != "off"))
        fail(kWord, name(), m.words.size() > 1 ? m.words[1] : m.words[0], "\"power on\" or \"power off\"");
    if (m.words[1] == "off") {
        if (!control_) return m.clear();
        if (job_) {
            stopMotion("by power off");
            sleeping_.push_back(later(m));
            sleeping_.back().message().clear();
            return;
        }
        turnOff();
        return m.clear();
    }
    needHardware();
    {
        Held held(*this);
        if (control_->phase() != Phase::off && control_->phase() != Phase::waking) return m.clear();
        control_->wake();
    }
    waking_.push_back(later(m));
    waking_.back().message().clear();
}

void Pino::turnOff() {
    {
        Held held(*this);
        control_->sleep();
    }
    for (auto& reply : std::exchange(waking_, {}))
        reply.fail(error(kPower, name(), "EXEC power off came before it had some"));
}

void Pino::park(Message& m) {
    auto job = std::make_shared<Job>();
    job->who = name();
    job->plan = [this](const Now& n) {
        Path path(Path::Kind::joints, {n.q, {}}, 1);
        path.add({joints(park_), {}});
        // A motion so slow that every joint can follow.
        const double acceleration = std::min(1.0, n.settings.limits.acceleration.minCoeff());
        Profile profile(path.length(), std::min(parkSpeed_, n.settings.limits.speed.minCoeff()), acceleration);
        return Job::Plan{std::make_unique<PathMotion>(n.settings.frames, n.settings.limits,
                                                      std::vector<PathMotion::Leg>{{path, profile, 0}}),
                         guards(*this, guards_, author("-guards"))};
    };
    job->finish = [this](Message&, const Now&, Motion&) { turnOff(); };
    admit(false, name());
    submit(job, [&] {
        auto reply = later(m);
        reply.message().clear();
        return reply;
    });
}

void Pino::stop(Args, Message& m) {
    m.text += job_ ? "stopping" : "nothing moves";
    stopMotion("by CTRL -stop of " + name() + " from " + sorma::CallContext::currentCallers());
}

// ---- motions ----

void Pino::admit(bool waits, const std::string& who) {
    if (!control_) fail(kPower, who, "say \"" + name() + " EXEC power on\"");
    Held held(*this);
    if (!control_->arm.attached()) fail(kHardware, who, control_->arm.problem());
    if (!control_->heard()) fail(kSilent, who, name());
    if (control_->phase() == Phase::off || control_->phase() == Phase::waking) {
        if (control_->state().cause != Cause::none) fail(kPowerLost, who, toText(control_->state().cause), name());
        fail(kPower, who, "say \"" + name() + " EXEC power on\"");
    }
    if (control_->overloaded()) fail(kOverloaded, who, name());
    if (job_ && !waits) fail(kBusy, who, job_->who, job_->caller, percent(control_->part()));
}

void Pino::submit(std::shared_ptr<Job> job, const std::function<sorma::Reply()>& later) {
    Job::Plan plan;
    if (!job_) plan = job->plan(now());
    job->caller = sorma::CallContext::currentCallers();
    job->call = sorma::CallContext::keep();
    job->reply = later();
    std::weak_ptr<Job> weak = job;
    job->reply.onCancel([this, weak] {
        auto j = weak.lock();
        if (!j) return;
        if (j == job_) return stopMotion("because its caller has cancelled it, or its deadline has passed");
        if (std::erase(queue_, j)) j->reply.complete();
    });
    if (job_) queue_.push_back(std::move(job));
    else begin(std::move(job), std::move(plan));
}

void Pino::begin(std::shared_ptr<Job> job, Job::Plan plan) {
    job->present = std::move(plan);
    job_ = std::move(job);
    Held held(*this);
    control_->begin(*job_->present.motion, std::move(job_->present.guards));
}

void Pino::stopMotion(const std::string& why) {
    if (!job_) return;
    if (job_->stopped.empty()) job_->stopped = why;
    control_->requestStop();
}

// The bell has rung: the control task has something to tell.
void Pino::ended() {
    control_->quiet();
    Ending ending;
    {
        Held held(*this);
        if (!control_->takeEnding(ending)) return;
    }
    const Now n = now();
    if (!job_) {
        const bool on = ending.outcome == Outcome::done;
        tell(on ? "power.on" : "power.off", toText(n.state.cause));
        for (auto& reply : std::exchange(waking_, {})) {
            if (on) reply.complete();
            else if (ending.outcome == Outcome::silent)
                reply.fail(error(kHardware, name(), "nobody writes its buffer " + prefix_.get(sorma::Permit::owner()) + "arm.state any more"));
            else reply.fail(errorOf(ending, name(), n, {}));
        }
        return;
    }
    auto job = std::exchange(job_, nullptr);
    answerJob(*job, ending, n, *job->present.motion);
    if (ending.outcome == Outcome::powerLost || ending.outcome == Outcome::silent) tell("power.off", toText(n.state.cause));
    if (auto sleeping = std::exchange(sleeping_, {}); !sleeping.empty()) {
        turnOff();
        for (auto& reply : sleeping) reply.complete();
    }
    nextJob();
}

void Pino::answerJob(Job& job, const Ending& ending, const Now& n, Motion& motion) {
    sorma::CallContext context(job.call);
    try {
        if (ending.outcome != Outcome::done) throw errorOf(ending, job.who, n, job.stopped);
        Message& m = job.reply.message();
        m.clear();
        job.finish(m, n, motion);
        job.reply.complete();
    } catch (const sorma::Error& e) {
        if (ending.outcome == Outcome::guard || ending.outcome == Outcome::overload) {
            tell("tripped", e.what(), {ending.trip.value, ending.trip.low, ending.trip.high});
            sorm().announce(e.trail);
        }
        job.reply.fail(e);
    }
}

void Pino::nextJob() {
    while (!job_ && !queue_.empty()) {
        auto job = std::move(queue_.front());
        queue_.pop_front();
        try {
            admit(false, job->who);
            auto plan = job->plan(now());
            begin(job, std::move(plan));
        } catch (const std::exception& e) {
            job->reply.fail(e);
        }
    }
}

sorma::Error Pino::errorOf(const Ending& e, const std::string& who, const Now& n, const std::string& stopped) const {
    const std::string at = text(n.tool.p);
    switch (e.outcome) {
        case Outcome::done:
        case Outcome::stopped: break;
        case Outcome::guard: return error(kGuard, who, e.guard, e.trip.what, number(e.trip.value), allowed(e.trip), at);
        case Outcome::overload: return error(kOverload, who, e.trip.what, number(e.trip.value), allowed(e.trip), at, name());
        case Outcome::powerLost:
            if (n.state.cause != Cause::none) return error(kPowerLost, who, toText(n.state.cause), name());
            return error(kPower, who, "its other side does not give it any, or has taken it, and says no cause");
        case Outcome::silent: return error(kSilent, who, name());
        case Outcome::unreachable: return error(kTarget, who, "the arm has stopped at " + at + " m, before a place that it "
                                                "does not reach");
        case Outcome::limits: return error(kTarget, who, "the arm has stopped at " + at + " m, before a place outside of "
                                           "the joints' limits");
        case Outcome::singular: return error(kTarget, who, "the arm has stopped at " + at + " m, too near to a singularity");
        case Outcome::gate:
            return error(kGate, who, e.joint, e.trip.what, number(e.trip.value), allowed(e.trip), at);
        case Outcome::sensorLost: return error(kSensor, who, "a guard needs it; the arm has stopped at " + at + " m");
    }
    return error(kStopped, who, stopped.empty() ? std::string("by somebody") : stopped, at);
}

// ---- guards ----

std::vector<Guard> Pino::guards(const Service& user, const std::string& names, const sorma::PrincipalPointer& author) const {
    std::vector<Guard> all;
    for (auto& word : sorma::splitWords(names)) {
        auto object = sorm().get(word, author);
        auto* wspc = dynamic_cast<Wspc*>(object.get());
        if (!wspc) fail(kNotAGuard, user.name(), "-guards", word, object->type().name());
        all.push_back(wspc->guard());
    }
    return all;
}

void Pino::guardChanged(const Guard& guard) {
    if (!control_) return;
    Held held(*this);
    control_->replaceGuard(guard);
}

// ---- what others see ----

void Pino::tellIncidents(sorma::Incidents& out) const {
    if (!control_) return;
    auto add = [&](std::string kind, std::uint64_t count, bool told = false) { out.push_back({name(), std::move(kind), count, told}); };
    const auto& f = control_->faults;
    for (std::size_t i = std::size_t(Outcome::guard); i < kOutcomes; ++i) {
        const auto outcome = Outcome(i);
        add(std::string("motion ended: ") + toText(outcome), f.motions[i], outcome == Outcome::guard || outcome == Outcome::overload);
    }
    for (std::size_t i = 0; i < kCauses; ++i) add(std::string("power lost at rest, cause: ") + toText(Cause(i)), f.power[i]);
    add("other side silent", f.silences);
    add("overload at rest", f.overloads);
    add("wrist's sensor silent or damaged", f.senseless);
    if (job_)
        if (auto* mover = sorm().find(job_->who); mover && mover != this) sorma::tellIncidents(*mover, out);
}

void Pino::tell(std::string_view event, std::string text, std::vector<double> floats) {
    Message m;
    m.text = std::move(text);
    m.floats = std::move(floats);
    publish(event, m);
}

void Pino::dumpState(std::string& out) const {
    out += std::string("# controlTask ") + (control_ ? toText(control_->phase()) : "ended") + "\n";
    if (!control_) return;
    out += std::string("# power ") + (control_->state().power ? "on" : "off") + "\n";
    out += std::string("# cause ") + toText(control_->state().cause) + "\n";
    if (job_) out += "# moved by " + job_->who + "\n";
    out += "# waiting " + std::to_string(queue_.size()) + "\n";
}

std::string Pino::selftest() {
    const Settings s = settings();
    Posture posture;
    Joints q = joints(park_);
    const Joints before = q;
    posture.find(s.frames, s.limits, s.frames.toolOf(q), q, q);
    return (q - before).cwiseAbs().maxCoeff() < 1e-9 ? "ok: kinematics agree" : "kinematics do not agree";
}

}  // namespace robot
