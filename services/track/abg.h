// abg.h -- alpha-beta-gamma filter: position, velocity and acceleration of a target, from positions at irregular times.
//
// Model: the acceleration changes by a random step in each interval (discrete Wiener process acceleration). The axes are
// filtered by themselves, with the same gains. Sources: P. Kalata, The tracking index, IEEE Trans. AES-20, 1984;
// Y. Bar-Shalom and T. Fortmann, Tracking and Data Association, 1988. They write a += gamma/(2 T^2) r: their gamma is
// twice the one here.
//
// Threads:   one at a time.
// Allocates: Filter::Filter and resize alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace track {

struct Gains {
    double alpha = 0, beta = 0, gamma = 0;      // x += alpha r, v += beta/T r, a += gamma/T^2 r, for a residual r
};
// The stationary Kalman gains, exact.   index: sigma_w T^2 / sigma_v > 0, of the change of acceleration [m/s^2] in an
// interval T [s] and of a measured position [m].
Gains gains(double index);

struct Settings {
    double index = 1;               // for measurements that are `interval` apart; it grows with the square of the time between two
    double interval = 0.07;         // [s]
    double longest = 1;             // [s] after a longer pause, or a clock set back by more, the filter begins anew
    double gate = 0;                // [m] how far a measurement may be from its prediction; 0: any
    std::int64_t confirm = 2;       // so many in a row beyond the gate, near each other: the target has jumped
    double instant = 0;             // [s] ... or at once, when one was used as short a time ago: it has gone from where it was
    double calmSpeed = 0;           // [m/s] below it v and a are damped: motion as small as that is noise; 0: never
    double calmAcceleration = 0;    // [m/s^2] ... unless the acceleration is as large as that; 0: not asked for
    double trust = 0.1;             // [s] after the last measurement it goes on as it did; beyond, with fade > 0 ...
    double fade = 0;                // [s] ... its speed dies away with this time constant
    double expiry = 0.5;            // [s] after the last measurement the target is lost
    double decay = 0.2;             // [s] then the velocity dies away with this time constant
};

enum class Taken { used, begun, late, refused };

class Filter {
public:
    explicit Filter(std::size_t axes = 0) { resize(axes); }
    void resize(std::size_t axes);  // and forget
    std::size_t axes() const { return state_.size(); }

    struct Axis {
        double x = 0, v = 0, a = 0;
    };
    // z: a position for each axis, measured at time t [s].
    Taken update(const Settings& settings, double t, std::span<const double> z);
    // The state of one axis at a time after the last used measurement (before it: as then).
    Axis at(const Settings& settings, std::size_t axis, double t) const;

    bool begun() const { return begun_; }
    double time() const { return time_; }                   // [s] of the last measurement that was used
    const Axis& axis(std::size_t i) const { return state_[i]; }
    void begin(double t, std::span<const Axis> state);
    void reset() { begun_ = false, beyond_ = 0; }

private:
    void start(double t, std::span<const double> z);
    bool accepted(const Settings& settings, double t, std::span<const double> z);
    void calm(const Settings& settings);

    std::vector<Axis> state_;
    double time_ = 0;
    bool begun_ = false;
    std::vector<double> doubtful_;      // the last one beyond the gate
    double doubtfulAt_ = 0;
    std::int64_t beyond_ = 0;           // in a row
    Gains gains_;                       // for index_
    double index_ = 0;
};

}  // namespace track
