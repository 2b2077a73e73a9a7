// control.h -- the hand's control task: in each tick it reads the fingers' sensors and writes the next set-point.
//
// Threads:   any thread may call tick() and requestStop(), one tick at a time. All else belongs to the SORM's thread,
//            between ticks.
// Allocates: never in tick().
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <shmem/ring.h>

#include "finger.h"

namespace hand {

struct State {
    double time = 0;                        // [s] lab time
    std::array<double, 12> joints{};        // ab pf mf df of each finger [rad]
    std::array<double, 9> torques{};        // [N m]
    Point tips{};                           // normal forces [N]
    Targets angles() const;
};

// A part of a motion: all joints, or all tips on straight lines, begin and end at rest.
struct Leg {
    Targets to{};
    bool tips = false;                      // `to` are tips, not angles
    double seconds = 0, pause = 0;          // of the motion; of rest behind it
};

struct Settings {
    Geometry geometry;
    double forceFilter = 0.02;              // [s]
    double lost = 0.1, lostTime = 0.05;     // [N], [s]: an object counts as lost when two tips feel less for so long
};

enum class Outcome { done, stopped };

class Control {
public:
    static constexpr std::size_t kSetFloats = 10, kStateFloats = 25;

    explicit Control(std::string prefix);
    ~Control();
    Control(const Control&) = delete;
    Control& operator=(const Control&) = delete;

    void tick(std::int64_t time, double period) noexcept;       // time [ns]
    void requestStop() noexcept { stop_ = true; }               // any thread; the fingers stay where the next tick finds them

    // Any time: a reader of what the other side writes, or what is wrong with it.
    std::optional<shmem::Reader> look(std::string& problem) const;

    // ---- between ticks ----
    Settings settings;

    void publish(const std::string& program);                   // become the writer of hand.set; fails with shmem::Failure
    void attach(std::optional<shmem::Reader> reader) { reader_ = std::move(reader); }
    bool attached() const { return reader_ && !reader_->retired(); }
    // Does the process that writes the state live, and has written any?
    bool heard() const;
    void sense() noexcept;                  // the newest state, when no tick runs

    void begin(std::vector<Leg> legs);      // from where the fingers have been sent
    void hold(bool holds) { holds_ = holds, missing_ = 0, lost_ = false; }     // true: from now on report when the object is lost
    bool holds() const { return holds_; }
    bool takeEnding(Outcome& outcome);      // true: a motion has ended since the last call
    bool takeLoss();                        // true: the object was lost since the last call
    int bell() const { return bell_; }      // a descriptor that can be read when one of these is true
    void quiet() const;                     // make it unreadable again

    bool moving() const { return leg_ < legs_.size(); }
    const State& state() const { return state_; }
    const Point& felt() const { return felt_; }                 // tip forces, filtered
    const Targets& targets() const { return sent_ ? targets_ : measured_; }

private:
    void move(double elapsed) noexcept;
    void finish(Outcome outcome) noexcept;
    void ring() noexcept;

    const std::string prefix_;
    std::optional<shmem::Reader> reader_;
    std::optional<shmem::Writer> set_;
    State state_;
    std::uint64_t seen_ = 0;
    Point felt_{};
    Targets measured_{}, targets_{};
    bool sent_ = false;                     // targets_ has been sent once: a hand that holds something is not disturbed before
    std::vector<Leg> legs_;
    std::size_t leg_ = 0;                   // under way; legs_.size(): none
    Targets from_{};                        // where it began, as the leg counts
    bool begun_ = false;
    double time_ = 0;                       // [s] in this leg
    std::int64_t last_ = 0;                 // [ns] the tick before
    bool holds_ = false, lost_ = false, ended_ = false;
    double missing_ = 0;                    // [s] that nothing has been felt
    Outcome outcome_ = Outcome::done;
    std::atomic<bool> stop_{false};
    int bell_;
};

}  // namespace hand
