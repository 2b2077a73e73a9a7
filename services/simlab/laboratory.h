// laboratory.h -- the whole laboratory: physics, arm, sensors, camera and lab time, in a thread of its own.
//
// One step, each 2 ms of lab time: take the buffers' records (in lockstep: wait for them), move as people do, physics with the
// servos. Then it reads the sensors, writes the records, shows the camera the scene, and rests until the next step is due.
//
// Threads: between() may be called by any; what it runs has the laboratory for itself, between two steps. Everything else of the
// laboratory is only touched there. Events and waiters are called by the laboratory's thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "buffers.h"
#include "drive.h"
#include "pace.h"
#include "picture.h"
#include "props.h"
#include "sensors.h"

namespace simlab {

struct Setup {                          // what is fixed when it is made
    std::string scene = "8x8", prefix, lockstep, program;
    std::uint64_t seed = 1;
    Joints posture{};
    int width = 500, height = 500, samples = 4;
};

struct Settings {                       // what may change any time
    bool paused = false;
    double tableLimit = 40, wristLimit = 150;       // [N]
    double rate = 0, latency = 0.02, imageNoise = 1;    // of the camera [Hz], [s], [levels]
    double clockOffset = 0, clockDrift = 0;             // of the camera's clock, by which its pictures are stamped [s], [1]
    Look look;
};

class Laboratory {
public:
    using Event = std::function<void(std::string event, std::string text, std::vector<double> values)>;

    static std::size_t bufferBytes(const Setup& setup);        // of shared memory, about
    static void endAll();               // the process ends: end the threads of all
    // Fails with a SceneError, or a shmem::Failure when a buffer cannot be written.
    Laboratory(const Setup& setup, const Settings& settings, Event event);
    ~Laboratory();

    template <class Work> auto between(Work work) {
        ++wanted_;
        std::unique_lock lock(mutex_);
        if (--wanted_ == 0) wake_.notify_all();
        if constexpr (std::is_void_v<decltype(work(*this))>) {
            work(*this);
            look();
        } else {
            auto result = work(*this);
            look();
            return result;
        }
    }

    // ---- within between() ----

    double now() const { return time_; }
    std::uint64_t published() const { return published_; }      // pictures
    void apply(const Settings& settings);
    // Call `done` when so much lab time has passed, or the laboratory ends (true). If it is paused, lab time runs until
    // then.
    std::uint64_t after(double seconds, std::function<void(bool ends)> done);
    void forget(std::uint64_t ticket);
    void emergencyStop(const std::string& who);
    void reset();                       // fails with a std::invalid_argument
    Shot shot() const;                  // what there is to see
    std::string figures() const;        // "# name value" lines

    Scene scene;
    Data data;
    Drive drive;
    Sensors sensors;
    Props props;
    Pace pace;

private:
    struct Grab { double end, due, request, exposure; std::uint64_t number; bool done; Image image; };

    void halt();
    void run();
    void step(std::unique_lock<std::mutex>& lock);
    void awaitSetPoint(std::unique_lock<std::mutex>& lock);
    bool takeSetPoint();
    void takeOthers();
    void control();
    void guard(double load);
    void write();
    void tellTime();
    void showCamera(std::unique_lock<std::mutex>& lock);
    bool grab(std::unique_lock<std::mutex>& lock);
    // Lab time waits for pictures, unless the wall clock drives it: then they are late, or left out.
    bool waitsForPictures() const { return pace.factor() <= 0 || !setup_.lockstep.empty() || settings_.paused; }
    void refuse(const std::string& problem);
    void rest(std::unique_lock<std::mutex>& lock, std::int64_t until);
    void look() { news_ = true, wake_.notify_all(); }
    void tell(const Drive::Stopped& stop);
    void endWaits(bool ends, double until);
    bool idle() const { return settings_.paused && waits_.empty(); }

    const Setup setup_;
    Settings settings_;
    const Event event_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::atomic<int> wanted_{0};
    bool news_ = false, stop_ = false;
    bool broken_ = false;               // the physics has stopped
    double time_ = 0;

    Input armSet_, handSet_, cameraSet_, laserSet_;
    Output clock_, armState_, wristState_, tableState_, handState_, image_;
    std::string lastProblem_;           // that has been told
    bool tripped_ = false;              // the table bears too much
    double load_ = 0, tableRest_ = 0;   // [N] on it; that it may bear until it has been below the limit once, after a reset
    std::uint64_t lost_ = 0, steps_ = 0, grabs_ = 0, published_ = 0, leftOut_ = 0;
    double waitAgain_ = 0;              // in lockstep, after a set-point that did not come
    bool late_ = false;                 // the last set-point was late already when it came
    double effort_ = 0;                 // [ns] of the processor for all steps and their records
    double cameraRate_ = 0, exposure_ = 1, request_ = 0, nextGrab_ = 0, pictureTime_ = 0;
    Cause toldCause_ = Cause::none;
    int toldWarnings_ = 0;
    std::deque<Grab> pending_;          // pictures on their way
    struct Wait { double until; std::uint64_t ticket; std::function<void(bool)> done; };
    std::vector<Wait> waits_;
    std::uint64_t tickets_ = 0;
    const double rate_;                 // [Hz] of the steps
    std::thread thread_;

public:
    Pictures pictures;                  // destroyed first: its thread posts to this object
};

}  // namespace simlab
