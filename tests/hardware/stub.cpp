// stub -- the smallest other side of the robot's buffers: an arm without mass, that follows its set-points.
//
//     hardwareStub PREFIX ?-silent PERIODS? ?q1 ... q6?
//
// Reads PREFIXarm.set; writes PREFIXarm.state, PREFIXwrist.state and PREFIXlab.clock, 500 times a second. Its duties stand in
// doc/hardware.man; this is a model to copy. After three PERIODS without a set-point it brakes; tests let a busy machine
// have more. Lines on standard input are what a person does: "reset", "stop" (the
// emergency stop), "wrist fx fy fz mx my mz" (what the sensor shows from now on). It ends with its standard input.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <string_view>
#include <string>
#include <utility>

#include <shmem/ring.h>

namespace {

constexpr double kStep = 0.002;             // [s]
constexpr double kLag = 0.02;               // [s] of the servos
constexpr double kDeceleration = 5;         // [rad/s2] when it stops by itself
constexpr double kJump = 0.2;               // [rad] a set-point farther than that from the arm is a fault

enum Mode { off, hold, run, stop };
enum Cause { none, emergency, table, wrist, late, limit };
using Joints = std::array<double, 6>;

struct SetPoint {
    double time = 0;
    Joints q{}, qdot{};
    int mode = off;
};

class Arm {
public:
    Arm(const Joints& q, int silent) : silent_(silent), q_(q) {}

    void take(const SetPoint& s, double now) {
        if (s.time > to_.time && arrived_ > 0) period_ = std::clamp(s.time - to_.time, 0.001, 0.2);
        from_ = to_, to_ = s, arrived_ = now;
        if (s.mode == off && !braking_) power_ = false, ready_ = cause_ == none;
        if (!power_ && ready_ && (s.mode == hold || s.mode == run)) power_ = true, ready_ = false, from_ = {now, q_, {}, hold};
        if (!power_) return;
        if (s.mode == stop) brake(none);
        for (std::size_t i = 0; i < 6; ++i)
            if (std::fabs(s.q[i] - q_[i]) > kJump + std::fabs(s.qdot[i]) * period_) brake(limit);
    }
    void cutPower() { power_ = braking_ = ready_ = false, cause_ = emergency, qdot_ = {}; }
    void reset() {
        if (!power_) cause_ = none;         // and the robot must say "off" once before it gets power
    }

    void step(double now) {
        if (power_ && !braking_ && now - arrived_ > silent_ * period_) brake(late);
        bool still = true;
        for (std::size_t i = 0; i < 6; ++i) {
            const double before = q_[i];
            if (braking_) q_[i] += kStep * slower(qdot_[i]);
            else if (power_) q_[i] += (reference(i, now) + kLag * to_.qdot[i] - q_[i]) * -std::expm1(-kStep / kLag);
            qdot_[i] = (q_[i] - before) / kStep;
            still = still && qdot_[i] == 0;
        }
        if (braking_ && still) braking_ = power_ = ready_ = false;
    }

    void write(shmem::Writer& state, double now, std::uint64_t counter) const {
        std::array<double, 22> record{now};
        std::copy(q_.begin(), q_.end(), record.begin() + 1);
        std::copy(qdot_.begin(), qdot_.end(), record.begin() + 7);
        record[19] = power_, record[20] = cause_, record[21] = double(counter);
        state.write(record.data(), nullptr);
    }

private:
    void brake(Cause cause) {
        if (braking_) return;
        braking_ = true;
        cause_ = cause;
    }
    static double slower(double speed) { return std::copysign(std::max(0.0, std::fabs(speed) - kStep * kDeceleration), speed); }
    double reference(std::size_t i, double now) const {
        const double span = to_.time - from_.time, part = span > 0 ? std::clamp((now - from_.time) / span, 0.0, 1.0) : 1;
        return from_.q[i] + part * (to_.q[i] - from_.q[i]);
    }

    const int silent_;                      // periods without a set-point
    Joints q_, qdot_{};
    SetPoint from_, to_;
    double arrived_ = 0, period_ = 0.015;
    bool power_ = false, braking_ = false;
    bool ready_ = false;                    // the robot has said "off" since the power went
    Cause cause_ = none;
};

double labTime() { return double(shmem::nanoseconds()) * 1e-9; }

// The newest set-point, when there is one that has not been seen.
bool newSetPoint(std::optional<shmem::Reader>& reader, const std::string& key, std::uint64_t& seen, SetPoint& s) try {
    if (!reader || reader->retired()) reader.emplace(key), seen = reader->count();
    std::array<double, 14> record;
    shmem::Stamp stamp;
    if (reader->shape().floats != record.size() || reader->count() == seen) return false;
    if (reader->latest(record.data(), nullptr, stamp) != shmem::Outcome::read) return false;
    seen = stamp.counter;
    if (!std::all_of(record.begin(), record.end(), [](double x) { return std::isfinite(x); })) return false;
    s.time = record[0];
    std::copy_n(record.begin() + 1, 6, s.q.begin());
    std::copy_n(record.begin() + 7, 6, s.qdot.begin());
    s.mode = int(record[13]);
    return true;
} catch (const shmem::Failure&) {           // the robot is not there yet
    return false;
}

}  // namespace

int main(int count, char** words) try {
    const std::string prefix = count > 1 ? words[1] : "";
    Joints q{0.2713, 1.1164, -3.2675, 0, -0.9905, -2.8703};      // above the table, the tool down
    const bool chosen = count > 3 && std::string_view(words[2]) == "-silent";
    const int silent = chosen ? std::atoi(words[3]) : 3, first = chosen ? 4 : 2;
    for (int i = first; i < count && i < first + 6; ++i) q[std::size_t(i - first)] = std::atof(words[i]);
    Arm arm(q, silent);
    shmem::Writer state(prefix + "arm.state", {.blocks = 64, .floats = 22}, "stub"), clock(prefix + "lab.clock", {.floats = 3}, "stub"),
        force(prefix + "wrist.state", {.blocks = 64, .floats = 7}, "stub");
    std::array<double, 7> sensed{};
    std::optional<shmem::Reader> reader;
    std::uint64_t seen = 0, inUse = 0;      // numbers of set-points
    std::string typed;
    bool said = false;                      // that it is ready
    SetPoint s;
    for (std::int64_t next = shmem::nanoseconds();;) {
        pollfd in{0, POLLIN, 0};
        if (char bytes[512]; poll(&in, 1, 0) > 0) {
            const auto n = read(0, bytes, sizeof bytes);
            if (n <= 0) return 0;
            typed.append(bytes, std::size_t(n));
        }
        for (std::size_t end; (end = typed.find('\n')) != std::string::npos; typed.erase(0, end + 1)) {
            std::istringstream line(typed.substr(0, end));
            std::string word;
            line >> word;
            if (word == "stop") arm.cutPower();
            if (word == "reset") arm.reset();
            if (word == "wrist") for (std::size_t i = 1; i < 7; ++i) line >> sensed[i];
        }
        const double now = labTime();
        if (newSetPoint(reader, prefix + "arm.set", seen, s)) arm.take(s, now), inUse = seen;
        arm.step(now);
        arm.write(state, now, inUse);
        sensed[0] = now;
        force.write(sensed.data(), nullptr);
        const double lab[] = {now, 1, 0};
        clock.write(lab, nullptr);
        if (!std::exchange(said, true)) std::puts("ready"), std::fflush(stdout);
        next += std::int64_t(kStep * 1e9);
        const timespec until{next / 1'000'000'000, next % 1'000'000'000};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    }
} catch (const shmem::Failure& f) {
    std::fprintf(stderr, "hardwareStub: %s\n", f.what());
    return 1;
}
