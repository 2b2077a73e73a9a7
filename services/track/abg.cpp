#include "abg.h"

#include <algorithm>
#include <cmath>

namespace track {

// With s the root of 2 (1 - s)^3 = index s (1 + s) in (0, 1): alpha = 1 - s^2, beta = 2 (1 - s)^2. The root is looked for as
// d = 1 - s, which keeps its digits when the index is small. f rises everywhere, so there is one root.
Gains gains(double index) {
    const double root = std::cbrt(index), guess = root + 0.5 * index;
    double d = guess / (1 + guess);
    for (int i = 0; i < 60; ++i) {
        const double f = 2 * d * d * d - index * (1 - d) * (2 - d), slope = 6 * d * d + index * (3 - 2 * d);
        const double bend = 12 * d - 2 * index;
        const double step = 2 * f * slope / (2 * slope * slope - f * bend);         // Halley's
        const double next = std::clamp(d - step, 0.5 * d, 0.5 * (1 + d));
        if (std::abs(next - d) <= 1e-16 * d) break;
        const bool last = std::abs(next - d) <= 1e-6 * d;       // three times as many digits with each step
        d = next;
        if (last) break;
    }
    const double alpha = d * (2 - d), beta = 2 * d * d;
    return {alpha, beta, beta * beta / (2 * alpha)};
}

void Filter::resize(std::size_t axes) {
    state_.assign(axes, {});
    doubtful_.assign(axes, 0);
    reset();
}

void Filter::begin(double t, std::span<const Axis> state) {
    std::copy(state.begin(), state.end(), state_.begin());
    time_ = t;
    begun_ = true;
    beyond_ = 0;
}

void Filter::start(double t, std::span<const double> z) {
    for (std::size_t i = 0; i < state_.size(); ++i) state_[i] = {z[i], 0, 0};
    time_ = t;
    begun_ = true;
    beyond_ = 0;
}

namespace {

Filter::Axis straight(const Filter::Axis& s, double dt) { return {s.x + dt * (s.v + 0.5 * dt * s.a), s.v + dt * s.a, s.a}; }

// Beyond `trust` the speed that it would have, v + a u, is multiplied by e^(-u / fade): no real target goes on for ever.
Filter::Axis ahead(const Settings& settings, const Filter::Axis& s, double dt) {
    if (settings.fade <= 0 || dt <= settings.trust) return straight(s, dt);
    const Filter::Axis then = straight(s, settings.trust);
    const double u = dt - settings.trust, fade = settings.fade, left = std::exp(-u / fade);
    return {then.x + fade * (then.v * (1 - left) + then.a * (fade - left * (fade + u))), (then.v + then.a * u) * left, then.a * left};
}

}  // namespace

Filter::Axis Filter::at(const Settings& settings, std::size_t axis, double t) const {
    const double age = std::max(0.0, t - time_);
    if (age <= settings.expiry) return ahead(settings, state_[axis], age);
    const Axis lost = ahead(settings, state_[axis], settings.expiry);
    const double fading = settings.decay > 0 ? std::exp(-(age - settings.expiry) / settings.decay) : 0;
    return {lost.x + lost.v * settings.decay * (1 - fading), lost.v * fading, 0};
}

// Is it near enough to where the target is expected? Else it is kept, as it may be the first of a target that has jumped.
bool Filter::accepted(const Settings& settings, double t, std::span<const double> z) {
    if (settings.gate <= 0) return true;
    double off = 0, apart = 0;
    for (std::size_t i = 0; i < state_.size(); ++i) {
        const double residual = z[i] - at(settings, i, t).x, step = z[i] - doubtful_[i];
        off += residual * residual;
        apart += step * step;
    }
    // The longer nothing was measured, the farther it may have gone another way; a refused measurement is one, too.
    const double pause = t - time_ <= settings.expiry && beyond_ == 0 ? std::max(1.0, (t - time_) / settings.interval) : 1;
    const double gate = settings.gate * settings.gate;
    if (off <= gate * pause * pause) return true;
    // Neighbours in a row; and never one record twice.
    beyond_ = beyond_ > 0 && apart <= gate ? beyond_ + (t > doubtfulAt_) : 1;
    std::copy(z.begin(), z.end(), doubtful_.begin());
    doubtfulAt_ = t;
    return false;
}

void Filter::calm(const Settings& settings) {
    if (settings.calmSpeed <= 0) return;
    double speed = 0, acceleration = 0;
    for (auto& s : state_) {
        speed += s.v * s.v;
        acceleration += s.a * s.a;
    }
    double share = speed / (settings.calmSpeed * settings.calmSpeed);
    if (settings.calmAcceleration > 0) share += acceleration / (settings.calmAcceleration * settings.calmAcceleration);
    if (share >= 1) return;
    for (auto& s : state_) {
        s.v *= share;
        s.a *= share;
    }
}

Taken Filter::update(const Settings& settings, double t, std::span<const double> z) {
    const double dt = t - time_;
    if (!begun_ || std::abs(dt) > settings.longest) {
        start(t, z);
        return Taken::begun;
    }
    if (dt <= 0) return Taken::late;
    if (!accepted(settings, t, z)) {
        if (dt <= settings.expiry && dt > settings.instant && beyond_ < settings.confirm) return Taken::refused;
        start(t, z);
        return Taken::begun;
    }
    beyond_ = 0;
    const double ratio = dt / settings.interval, index = settings.index * ratio * ratio;
    if (index != index_) {
        gains_ = gains(index);
        index_ = index;
    }
    double sum = 0;
    const double beta = gains_.beta / dt, gamma = gains_.gamma / (dt * dt);
    for (std::size_t i = 0; i < state_.size(); ++i) {
        const Axis p = ahead(settings, state_[i], dt);
        const double residual = z[i] - p.x;
        state_[i] = {p.x + gains_.alpha * residual, p.v + beta * residual, p.a + gamma * residual};
        sum += state_[i].x + state_[i].v + state_[i].a;
    }
    time_ = t;
    if (!std::isfinite(sum)) [[unlikely]] {     // numbers so large that they have overflowed: they must not stay
        start(t, z);
        return Taken::begun;
    }
    calm(settings);
    return Taken::used;
}

}  // namespace track
