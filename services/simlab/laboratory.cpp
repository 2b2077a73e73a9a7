#include "laboratory.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <set>

namespace simlab {

namespace {

// [ns] of wall time that lockstep waits: for a set-point, and for one after one that did not come.
constexpr std::int64_t kPatience = 2'000'000'000, kLessPatience = 100'000'000;
constexpr std::int64_t kNap = 10'000'000;           // [ns]
constexpr double kSame = 1e-9;                      // [s]
constexpr std::ptrdiff_t kMostInWork = 2;           // pictures: more would come later and later
constexpr std::size_t kImages = 4;                  // in the buffer

// MuJoCo ends the process on an error and writes warnings to a file, unless it is told otherwise.
void quietMujoco() {
    static std::once_flag once;
    std::call_once(once, [] {
        mju_user_error = [](const char* text) { throw std::runtime_error(text); };
        mju_user_warning = [](const char*) {};
    });
}

struct Alive {
    std::mutex mutex;
    std::set<Laboratory*> all;
};
Alive& alive() {
    static auto* alive = new Alive;         // for ever: it is used when the process ends
    return *alive;
}

const std::string& prepared(const std::string& scene) { return quietMujoco(), scene; }

std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return text;
}

}  // namespace

std::size_t Laboratory::bufferBytes(const Setup& setup) {
    constexpr std::size_t kRecords = 5 * 256 * 256;      // five buffers of 256 records, none longer than 256 bytes
    return kImages * std::size_t(setup.width * setup.height) * 3 + kRecords;
}

Laboratory::Laboratory(const Setup& setup, const Settings& settings, Event event)
    : scene(prepared(setup.scene)),
      data(mj_makeData(scene.model.get())),
      drive(scene),
      sensors(scene, setup.seed),
      props(scene, *data),
      setup_(setup),
      event_(std::move(event)),
      armSet_(setup.prefix + "arm.set", 14),
      handSet_(setup.prefix + "hand.set", 10),
      cameraSet_(setup.prefix + "camera.set", 4),
      laserSet_(setup.prefix + "laser.set", 3),
      clock_(setup.prefix + "lab.clock", 3, setup.program),
      armState_(setup.prefix + "arm.state", 22, setup.program),
      wristState_(setup.prefix + "wrist.state", 7, setup.program),
      tableState_(setup.prefix + "table.state", 6, setup.program),
      handState_(setup.prefix + "hand.state", 25, setup.program),
      image_(setup.prefix + "camera.image", 5, setup.program, kImages, std::size_t(setup.width * setup.height) * 3),
      rate_(1 / scene.model->opt.timestep),
      pictures(scene, setup.samples) {
    // Fingers straight and a little apart.
    drive.place(*data, setup.posture);
    for (std::size_t f = 0; f < 3; ++f) {
        constexpr double kOpen[4] = {0, -0.262946, 0.486253, 0.486253};
        for (std::size_t j = 0; j < 4; ++j) {
            data->qpos[scene.fingerQpos[4 * f + j]] = kOpen[j];
            if (j == 3) continue;
            const int servo = scene.fingerServo[3 * f + j];
            data->ctrl[servo] = kOpen[j];
            const int act = servo - (scene.model->nu - scene.model->na);
            if (act >= 0 && act < scene.model->na) data->act[act] = kOpen[j];
        }
    }
    mj_forward(scene.model.get(), data.get());
    apply(settings);
    write();
    thread_ = std::thread([this] { run(); });
    // For a program without Service::processEnds. The graphics library has registered most of its own by now; that comes after this.
    static const bool registered = std::atexit([] { endAll(); }) == 0;
    (void)registered;
    std::lock_guard lock(alive().mutex);
    alive().all.insert(this);
}

Laboratory::~Laboratory() {
    {
        std::lock_guard lock(alive().mutex);
        alive().all.erase(this);
    }
    halt();
    endWaits(true, INFINITY);
}

// The process ends without removing its objects: no thread may be in the graphics library when that is taken down.
void Laboratory::endAll() {
    std::lock_guard lock(alive().mutex);
    for (auto* laboratory : alive().all) laboratory->halt();
}

void Laboratory::halt() {
    ++wanted_;                      // a thread that goes as fast as it can gives the lock to nobody else
    {
        std::lock_guard lock(mutex_);
        stop_ = true;
        --wanted_;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
    pictures.halt();
}

// ---- the thread ----

void Laboratory::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        if (idle()) {
            // Input that comes while time stands is taken as at this time.
            takeSetPoint();
            takeOthers();
            pace.restart();
            // This tells readers of lab.clock that time is paused, and that the laboratory lives.
            if (!broken_) tellTime();
            rest(lock, shmem::nanoseconds() + kNap);
            for (Input* in : {&armSet_, &handSet_, &cameraSet_, &laserSet_}) in->lookNow();
            continue;
        }
        try {
            step(lock);
            broken_ = false;
        } catch (const std::exception& e) {
            settings_.paused = broken_ = true;
            endWaits(true, INFINITY);
            event_("failed", std::string("the physics has stopped: ") + e.what() + "; lab time is paused", {});
            continue;
        }
        const std::int64_t now = shmem::nanoseconds(), due = pace.stepped(scene.model->opt.timestep, now);
        if (due > now + 50'000) rest(lock, due);
        if (wanted_ > 0) wake_.wait(lock, [this] { return wanted_ == 0 || stop_; });
    }
}

// Let others have the laboratory until a time [ns], or there is news.
void Laboratory::rest(std::unique_lock<std::mutex>& lock, std::int64_t until) {
    const auto time = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(until));
    news_ = false;
    wake_.wait_until(lock, time, [this] { return stop_ || (news_ && settings_.paused); });
}

void Laboratory::step(std::unique_lock<std::mutex>& lock) {
    if (!setup_.lockstep.empty()) awaitSetPoint(lock);
    takeSetPoint();
    takeOthers();
    const std::int64_t begin = shmem::nanoseconds(CLOCK_THREAD_CPUTIME_ID);
    props.update(time_);
    mj_step1(scene.model.get(), data.get());
    control();
    mj_step2(scene.model.get(), data.get());
    time_ = double(++steps_) / rate_;        // not a sum of roundings
    write();
    effort_ += double(shmem::nanoseconds(CLOCK_THREAD_CPUTIME_ID) - begin);
    showCamera(lock);
    endWaits(false, time_ + kSame);
}

void Laboratory::endWaits(bool ends, double until) {
    std::vector<Wait> over;
    std::erase_if(waits_, [&](Wait& w) { return w.until <= until && (over.push_back(std::move(w)), true); });
    for (auto& w : over) w.done(ends);
}

bool Laboratory::takeSetPoint() {
    if (!armSet_.take()) return false;
    drive.take(armSet_.floats() + 1, armSet_.floats()[0], armSet_.counter(), time_);
    late_ = drive.due() <= time_ + kSame;
    return true;
}

// In lockstep lab time waits for the set-point that is due, while somebody sends any. A late writer may have skipped the next
// one, and waits for lab time itself. Then each would wait for the other. So lab time waits for what follows a
// set-point that came in time.
void Laboratory::awaitSetPoint(std::unique_lock<std::mutex>& lock) {
    if (late_ || !drive.streaming(time_) || time_ < drive.due() - kSame || time_ < waitAgain_ - kSame) return;
    const bool missed = time_ < waitAgain_ + drive.period();
    const std::int64_t begin = shmem::nanoseconds(), until = begin + (missed ? kLessPatience : kPatience);
    while (!stop_) {
        if (takeSetPoint()) return;
        const std::int64_t now = shmem::nanoseconds();
        if (now >= until || (now >= begin + kLessPatience && !armSet_.alive())) {
            ++lost_;
            waitAgain_ = time_ + drive.period();
            return;
        }
        lock.unlock();
        armSet_.wait(now + kNap);
        lock.lock();
    }
}

void Laboratory::takeOthers() {
    if (handSet_.take()) {
        bool finite = true;
        for (int i = 1; i <= 9; ++i) finite = finite && std::isfinite(handSet_.floats()[i]);
        for (std::size_t i = 0; finite && i < 9; ++i)
            data->ctrl[scene.fingerServo[i]] = handSet_.floats()[1 + i];  // clamped by the model
        if (!finite)
            event_("refused",
                   handSet_.key() + ": record " + std::to_string(handSet_.counter()) + " is not finite; the hand stays", {});
    }
    if (cameraSet_.take()) {
        const double *f = cameraSet_.floats(), rate = f[1], request = f[2], exposure = f[3];
        if (rate >= 0 && rate <= 200 && std::isfinite(request) && exposure > 0 && exposure <= 100) {
            if (rate != cameraRate_) nextGrab_ = time_;
            cameraRate_ = rate;
            exposure_ = exposure;
            if (request != request_) {
                request_ = request;
                nextGrab_ = time_;
            }
        } else {
            event_("refused", cameraSet_.key() + ": rate " + number(rate) + ", exposure " + number(exposure) +
                                  ": they must be 0 .. 200 Hz and above 0 .. 100; the camera goes on as before", {});
        }
    }
    if (laserSet_.take()) props.laser(laserSet_.floats()[1] > 0.5, laserSet_.floats()[2]);
    for (const Input* in : {&armSet_, &handSet_, &cameraSet_, &laserSet_})
        if (!in->problem().empty()) refuse(in->problem() + "; they are not taken");
}

void Laboratory::control() {
    drive.control(*data, time_);
    for (int dof : scene.fingerDof) data->qfrc_applied[dof] = data->qfrc_bias[dof];
}

// ---- records ----

void Laboratory::write() {
    const double now = time_;
    const std::array<double, 6> wrist = sensors.wrist(*data);
    const Sensors::Table table = sensors.table(*data);
    const std::array<double, 3> tips = sensors.tips(*data);
    guard(table.load);
    const double force = std::hypot(wrist[0], wrist[1], wrist[2]);
    if (force > settings_.wristLimit && drive.cause() == Cause::none)
        drive.cut(Cause::wrist,
                  "the wrist bears " + number(force) + " N; at most " + number(settings_.wristLimit) + " N are allowed",
                  now);
    armState_.at(now);
    for (int q : scene.armQpos) armState_.put(data->qpos[q]);
    for (int v : scene.armDof) armState_.put(data->qvel[v]);
    for (std::size_t i = 0; i < 6; ++i) armState_.put(drive.torque(*data, i));
    armState_.put(drive.power()).put(double(drive.cause())).put(double(drive.counter())).write();
    wristState_.at(now).put(wrist).write();
    tableState_.at(now).put(table.legs).put(tripped_).write();
    handState_.at(now);
    for (int q : scene.fingerQpos) handState_.put(data->qpos[q]);
    for (int servo : scene.fingerServo) handState_.put(data->actuator_force[servo]);
    handState_.put(tips).write();
    // Last: who is woken by the clock finds the others.
    tellTime();

    if (drive.cause() != toldCause_) {
        toldCause_ = drive.cause();
        if (toldCause_ != Cause::none) event_("stop", std::string(toText(toldCause_)) + ": " + drive.why(), {});
    }
    Drive::Stopped stop;
    if (drive.stopped(stop))
        event_("stopped", std::string(toText(stop.cause)) + ": stood after " + number(stop.seconds) + " s, the tool came " +
                              number(1000 * stop.tool) + " mm, a joint " + number(stop.joint) + " rad",
               {stop.seconds, stop.tool, stop.joint});
    int warnings = 0;
    for (int w : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) warnings += data->warning[w].number;
    if (warnings != toldWarnings_) {
        toldWarnings_ = warnings;
        event_("unstable", "the physics became unstable and was reset to its first state; the arm is braked", {});
        drive.cut(Cause::limit, "the physics has become unstable", now);
        drive.place(*data, setup_.posture);
    }
}

void Laboratory::tellTime() { clock_.at(time_).put(pace.speed()).put(pace.skipped()).write(); }

// After a reset the table may go on bearing what it bears, until that has been below the limit once: the arm could not leave otherwise.
void Laboratory::guard(double load) {
    const double limit = settings_.tableLimit + scene.tokenWeight;
    load_ = load;
    tripped_ = load > limit;
    if (!tripped_) tableRest_ = 0;
    if (load > std::max(limit, tableRest_) && drive.cause() == Cause::none)
        drive.cut(Cause::table, "the table bears " + number(load) + " N; at most " + number(limit) + " N are allowed", time_);
}

// ---- pictures ----

Shot Laboratory::shot() const {
    const mjModel& m = *scene.model;
    Shot s;
    s.qpos.assign(data->qpos, data->qpos + m.nq);
    s.mocapPosition.assign(data->mocap_pos, data->mocap_pos + 3 * m.nmocap);
    s.mocapQuaternion.assign(data->mocap_quat, data->mocap_quat + 4 * m.nmocap);
    s.look = settings_.look;
    s.width = setup_.width;
    s.height = setup_.height;
    return s;
}

// Hand the scene over to who renders it. False: this picture is left out.
bool Laboratory::grab(std::unique_lock<std::mutex>& lock) {
    if (!pictures.problem().empty()) return refuse("no pictures: " + pictures.problem()), false;
    auto inWork = [this] { return std::count_if(pending_.begin(), pending_.end(), [](const Grab& g) { return !g.done; }); };
    if (inWork() >= kMostInWork) {
        if (!waitsForPictures()) return false;
        wake_.wait(lock, [&] { return inWork() < kMostInWork || stop_; });
    }
    Shot s = shot();
    s.exposure = exposure_;
    s.noise = settings_.imageNoise;
    s.seed = setup_.seed * 1'000'003 + ++grabs_;
    pending_.push_back({time_, time_ + settings_.latency, request_, exposure_, grabs_, false, {}});
    pictures.take(std::move(s), [this, number = grabs_](Image image) {
        ++wanted_;                  // as in halt()
        std::lock_guard guard(mutex_);
        --wanted_;
        for (auto& grab : pending_)
            if (grab.number == number) {
                grab.done = true;
                grab.image = std::move(image);
            }
        wake_.notify_all();
    });
    return true;
}

void Laboratory::showCamera(std::unique_lock<std::mutex>& lock) {
    const double rate = cameraRate_ > 0 ? cameraRate_ : settings_.rate;
    if (nextGrab_ >= 0 && time_ >= nextGrab_ - kSame && (rate > 0 || request_ != 0)) {
        nextGrab_ = rate > 0 ? nextGrab_ + std::ceil((time_ - nextGrab_ + kSame) * rate) / rate : -1;
        if (!grab(lock)) ++leftOut_;
    }
    while (!pending_.empty() && time_ >= pending_.front().due - kSame) {
        Grab& front = pending_.front();
        if (!front.done) {
            if (!waitsForPictures()) return;
            wake_.wait(lock, [this, &front] { return front.done || stop_; });
            if (!front.done) return;
        }
        const Image& image = front.image;
        if (image.problem.empty()) {
            pictureTime_ += image.milliseconds;
            ++published_;
            image_.at(front.end + settings_.clockOffset + settings_.clockDrift * front.end)
                .put(image.width)
                .put(image.height)
                .put(front.exposure)
                .put(front.request)
                .write(image.rgb.data());
        } else {
            refuse("no picture: " + image.problem);
        }
        pending_.pop_front();
    }
}

// Tell it, once as long as it does not change.
void Laboratory::refuse(const std::string& problem) {
    if (problem == lastProblem_) return;
    lastProblem_ = problem;
    event_("refused", problem, {});
}

// ---- within between() ----

void Laboratory::apply(const Settings& settings) {
    if (settings.rate != settings_.rate) nextGrab_ = time_;
    settings_ = settings;
}

std::uint64_t Laboratory::after(double seconds, std::function<void(bool)> done) {
    waits_.push_back({time_ + seconds, ++tickets_, std::move(done)});
    return tickets_;
}

void Laboratory::forget(std::uint64_t ticket) {
    std::erase_if(waits_, [&](Wait& w) { return w.ticket == ticket && (w.done(false), true); });
}

void Laboratory::emergencyStop(const std::string& who) { drive.cut(Cause::emergency, "by " + who, time_); }

void Laboratory::reset() {
    drive.reset();
    if (tripped_) tableRest_ = load_ + settings_.tableLimit / 2;
    toldCause_ = Cause::none;
}

std::string Laboratory::figures() const {
    std::string out;
    auto put = [&](const char* name, const std::string& value) { out += std::string("# ") + name + " " + value + "\n"; };
    put("time", number(time_) + " s" + (settings_.paused ? ", paused" : ""));
    put("speed", number(pace.speed()));
    put("skipped", number(pace.skipped()) + " s");
    put("power", drive.power() ? "on" : "off");
    put("cause", toText(drive.cause()) + (drive.why().empty() ? std::string() : ": " + drive.why()));
    put("set-point", std::to_string(drive.counter()));
    put("lost", std::to_string(lost_));
    put("step", steps_ ? number(effort_ / 1000 / double(steps_)) + " us" : "-");
    put("pictures", pictures.problem().empty() ? std::to_string(published_) : "none: " + pictures.problem());
    if (published_) put("picture", number(pictureTime_ / double(published_)) + " ms");
    if (leftOut_) put("left out", std::to_string(leftOut_) + " pictures");
    put("ball", props.ball().text());
    return out;
}

}  // namespace simlab
