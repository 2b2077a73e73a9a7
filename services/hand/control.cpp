#include "control.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <system_error>
#include <utility>

namespace hand {

namespace {

// A tick that comes later than this many periods goes on as if it had not: no set-point jumps, and no pause is left out.
constexpr double kLatest = 4;

// From rest to rest, with the least jerk: 0 .. 1.
double smooth(double x) { return x >= 1 ? 1 : x <= 0 ? 0 : x * x * x * (10 + x * (6 * x - 15)); }

}  // namespace

Targets State::angles() const {
    Targets t;
    for (std::size_t f = 0; f < kFingers; ++f) put(t, f, {joints[4 * f], joints[4 * f + 1], joints[4 * f + 2]});
    return t;
}

Control::Control(std::string prefix) : prefix_(std::move(prefix)), bell_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (bell_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

Control::~Control() { close(bell_); }

std::optional<shmem::Reader> Control::look(std::string& problem) const {
    const std::string key = prefix_ + "hand.state";
    try {
        shmem::Reader reader(key);
        if (reader.shape().floats == kStateFloats) return reader;
        problem = "records of snapshot buffer " + key + " have " + std::to_string(reader.shape().floats) + " floats instead of " +
                  std::to_string(kStateFloats);
    } catch (const shmem::Failure& f) {
        problem = f.what();
    }
    return std::nullopt;
}

void Control::publish(const std::string& program) {
    set_.emplace(prefix_ + "hand.set", shmem::Shape{.blocks = 16, .floats = kSetFloats}, program);
    set_->checksums(true);
}

bool Control::heard() const {
    return attached() && reader_->count() > 0 && reader_->segment()->writing().alive();
}

void Control::begin(std::vector<Leg> legs) {
    if (!sent_) targets_ = measured_;
    sent_ = true;
    legs_ = std::move(legs);
    leg_ = 0;
    time_ = 0;
    begun_ = ended_ = false;
    stop_ = false;
}

bool Control::takeEnding(Outcome& outcome) {
    outcome = outcome_;
    return std::exchange(ended_, false);
}

bool Control::takeLoss() { return std::exchange(lost_, false); }

void Control::quiet() const {
    std::uint64_t count;
    (void)!read(bell_, &count, sizeof count);
}

void Control::ring() noexcept {
    const std::uint64_t one = 1;
    (void)!write(bell_, &one, sizeof one);
}

// ---- the tick ----

void Control::sense() noexcept {
    if (!reader_) return;
    std::array<double, kStateFloats> f;
    shmem::Stamp stamp;
    if (reader_->latest(f.data(), nullptr, stamp) != shmem::Outcome::read) return;
    for (double x : f)
        if (!std::isfinite(x)) return;
    // The mean of a filter goes by the records' own time: ticks may be late.
    const double passed = f[0] - state_.time;
    state_.time = f[0];
    std::copy_n(&f[1], 12, state_.joints.begin());
    std::copy_n(&f[13], 9, state_.torques.begin());
    std::copy_n(&f[22], 3, state_.tips.begin());
    measured_ = state_.angles();
    const double part = seen_ == 0 || passed < 0 ? 1 : -std::expm1(-passed / settings.forceFilter);
    for (std::size_t i = 0; i < kFingers; ++i) felt_[i] += part * (state_.tips[i] - felt_[i]);
    seen_ = stamp.counter;
}

void Control::tick(std::int64_t time, double period) noexcept {
    const double elapsed = last_ != 0 && time > last_ ? std::min(double(time - last_) * 1e-9, kLatest * period) : period;
    last_ = time;
    sense();
    if (moving()) move(elapsed);
    if (!sent_ || seen_ == 0) return;
    std::array<double, kSetFloats> f{state_.time};
    std::copy(targets_.begin(), targets_.end(), f.begin() + 1);
    set_->write(f.data(), nullptr);
    if (!holds_ || moving()) return;
    const auto gone = std::count_if(felt_.begin(), felt_.end(), [this](double force) { return force < settings.lost; });
    missing_ = gone >= 2 ? missing_ + elapsed : 0;
    if (missing_ < settings.lostTime) return;
    holds_ = false;
    lost_ = true;
    ring();
}

void Control::move(double elapsed) noexcept {
    if (stop_) return finish(Outcome::stopped);
    const Leg& leg = legs_[leg_];
    if (!begun_) {
        from_ = leg.tips ? tipsOf(settings.geometry, targets_) : targets_;
        begun_ = true;
    }
    time_ += elapsed;
    const double part = leg.seconds > 0 ? smooth(time_ / leg.seconds) : 1;
    Targets at;
    for (std::size_t i = 0; i < kJoints; ++i) at[i] = from_[i] + part * (leg.to[i] - from_[i]);
    if (!leg.tips) {
        targets_ = at;
    } else {
        for (std::size_t f = 0; f < kFingers; ++f) {
            Angles angles = anglesOf(targets_, f);
            if (reach(settings.geometry, f, anglesOf(at, f), angles)) put(targets_, f, angles);     // the way has been checked
        }
    }
    if (time_ < leg.seconds + leg.pause) return;
    time_ = 0;
    begun_ = false;
    if (++leg_ == legs_.size()) finish(Outcome::done);
}

void Control::finish(Outcome outcome) noexcept {
    leg_ = legs_.size();
    outcome_ = outcome;
    ended_ = true;
    ring();
}

}  // namespace hand
