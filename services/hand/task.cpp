#include "task.h"

#include <utility>

namespace hand {

namespace {

const sorma::Prototype kHardware{sorma::Severity::error, "HAND HARDWARE", 1,
                                 "{}: the hand's other side is not there: {}; start it (simlab, or what drives the fingers)"};
const sorma::Prototype kTask{sorma::Severity::error, "HAND TASK", 1, "{}: the control task does not run: {}"};

constexpr std::int64_t kLook = 50'000'000;          // [ns] between two looks at the other side
constexpr double kLabWatchdog = 20;                 // [s] lab time may stand so long, while a picture is drawn on a machine that has other work

}  // namespace

void Task::configure(std::vector<std::string> words) {
    sorma::Message m;
    m.words = std::move(words);
    cycle_->invoke(sorma::Method::ctrl, m);
}

void Task::start(const Wanted& wanted) {
    prefix_ = wanted.prefix;
    auto control = std::make_unique<Control>(prefix_);
    control->attach(control->look(problem_));
    if (!control->attached()) sorma::fail(kHardware, hand_.name(), problem_);
    try {
        control->publish(hand_.sorm().daemonName.empty() ? sorma::Caller::self().program : hand_.sorm().daemonName);
    } catch (const shmem::Failure& f) {
        sorma::fail(kTask, hand_.name(), f.what());
    }
    control->settings = wanted.settings;
    control->sense();
    control_ = std::move(control);
    const auto dot = hand_.name().find('.');
    cycle_ = hand_.sorm().get("cycle." + (dot == std::string::npos ? hand_.name() : hand_.name().substr(dot + 1)));
    try {
        std::vector<std::string> words{"-period", sorma::numberText(wanted.interval), "-priority", std::to_string(wanted.priority), "-steps", hand_.name()};
        if (wanted.labTime) words.insert(words.end(), {"-clock", prefix_ + "lab.clock", "-watchdog", sorma::numberText(kLabWatchdog)});
        configure(std::move(words));
        configure({"-start"});
    } catch (const sorma::Error& e) {
        control_.reset();
        cycle_ = {};
        sorma::fail(kTask, hand_.name(), e.what());
    }
    hand_.sorm().loop().watch(control_->bell(), [this] { rung_(); });
    watch();
    needOtherSide();
}

void Task::halt() {
    if (!control_) return;
    timer_ = {};
    if (hand_.sorm().hasLoop()) hand_.sorm().loop().unwatch(control_->bell());
    try {
        configure({"-stop"});
    } catch (const sorma::Error&) {         // it has stopped by itself
    }
    cycle_ = {};
    control_.reset();
}

// Is the other side there? When it has come back, this finds it.
bool Task::heard() {
    bool attached;
    {
        sorma::BetweenTicks held(hand_);
        attached = control_->attached();
        if (attached && control_->heard()) return true;
    }
    if (attached) {
        problem_ = "the process that wrote " + prefix_ + "hand.state has ended";
        return false;
    }
    auto reader = control_->look(problem_);
    sorma::BetweenTicks held(hand_);
    control_->attach(std::move(reader));
    if (!control_->attached()) return false;
    control_->sense();
    return control_->heard();
}

void Task::needOtherSide() {
    if (!heard()) sorma::fail(kHardware, hand_.name(), problem_);
}

void Task::watch() {
    timer_ = hand_.sorm().loop().after(sorma::monotonicNow() + kLook, [this] { watch(); });
    bool there;
    try {
        there = heard();
    } catch (const sorma::Error&) {         // a step of another object hangs: try again later
        return;
    }
    looked_(there);
}

sorma::Error Task::whyEnded(bool there) const {
    const auto& prototype = there ? kTask : kHardware;
    const std::string why = there ? "it has ended; see " + cycle_->name() + " CTRL -dump" : problem_;
    return sorma::Error(sorma::makeEntry(prototype, {sorma::MessageArg::of(hand_.name()), sorma::MessageArg::of(why)}));
}

}  // namespace hand
