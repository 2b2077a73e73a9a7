// puma -- the kinematics of a Puma 560: no arm moves.
//
//     puma EXEC forward FMSG 6 q...           -> FMSG 12      pose of the flange in the base frame, three rows of the 4x4 matrix
//     puma EXEC inverse FMSG 18 pose... q...  -> FMSG 6*n     all postures within the limits, the one nearest to q first
//
// As a unit of a circuit it does without words what -task says.
#include <array>
#include <cmath>
#include <limits>

#include <sorma.h>

#include "puma.h"

namespace {

using puma::Joints;
using puma::Pose;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "PUMA WORD", 2,
                             "{}: bad word \"{}\": must be one of configurations, distances, forward, gravity, inverse, jacobian, or nearest"};
const sorma::Prototype kFloats{Severity::error, "PUMA FLOATS", 1, "{}: {} expects {}, got {} floats"};
const sorma::Prototype kValue{Severity::error, "PUMA VALUE", 1, "{}: float {} is {}; all must be finite numbers"};
const sorma::Prototype kPose{Severity::error, "PUMA POSE", 1,
                             "{}: the left 3x3 of the pose is not a rotation: its columns must have length 1, right angles, and be "
                             "right-handed, to 1e-6"};
const sorma::Prototype kTooClose{Severity::error, "PUMA UNREACHABLE", 1,
                                 "{}: unreachable: the wrist centre {} {} {} m is less than 0.15005 m from the waist's axis"};
const sorma::Prototype kTooFar{Severity::error, "PUMA UNREACHABLE", 1,
                               "{}: unreachable: the wrist centre {} {} {} m is {} m from the shoulder, which the arm bridges from "
                               "{} to {} m"};
const sorma::Prototype kLimits{Severity::error, "PUMA LIMITS", 1,
                               "{}: all 8 solutions are outside the limits; the nearest one has joint {} at {}, allowed are "
                               "{} .. {} rad"};
const sorma::Prototype kOrder{Severity::error, "OPTION VALUE", 2, "{}: {} {} of joint {} is above its -upper {}"};

enum Task { configurations, distances, forward, gravity, inverse, jacobian, nearest };
constexpr std::array<const char*, 7> kTasks = {"configurations", "distances", "forward", "gravity", "inverse", "jacobian", "nearest"};

Task taskOf(std::string_view word) {
    for (std::size_t i = 0; i < kTasks.size(); ++i)
        if (word == kTasks[i]) return Task(i);
    return Task(-1);
}

class Puma : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        const std::string angles = "by joint, waist to flange";
        return sorma::Class::of<Puma>("puma", "kinematics and gravity of a Puma 560 arm")
            .choice("-task", &Puma::task_, {kTasks.begin(), kTasks.end()}, {.help = "the meaning of EXEC without words"})
            .vector("-lower", &Puma::lower_, {.unit = "rad", .low = -10, .high = 10, .help = "least angles, " + angles, .minLength = 6, .maxLength = 6})
            .vector("-upper", &Puma::upper_, {.unit = "rad", .low = -10, .high = 10, .help = "largest angles, " + angles, .minLength = 6, .maxLength = 6})
            .vector("-posture", &Puma::posture_, {.unit = "rad", .low = -10, .high = 10,
                                                  .help = "posture to which solutions are to be near, when a request gives none", .minLength = 6, .maxLength = 6})
            .vector("-weights", &Puma::weights_, {.unit = "1", .low = 0, .high = 1e6,
                                                  .help = "of the angles in \"near\": the largest weighted difference counts", .minLength = 6, .maxLength = 6})
            .real("-gravity", &Puma::gravity_, {.unit = "m/s2", .low = 0, .high = 100, .help = "acceleration, against z of the base"})
            .real("-load", &Puma::load_, {.unit = "kg", .low = 0, .high = 20, .help = "mass that the flange carries, hand included"})
            .vector("-loadCentre", &Puma::loadCentre_, {.unit = "m", .low = -2, .high = 2, .help = "centre of the load, in the flange's frame",
                                                        .minLength = 3, .maxLength = 3})
            .words("?configurations|distances|forward|gravity|inverse|jacobian|nearest?")
            .reads(floats, sorma::between(6, 18), "",
                   "distances, forward, gravity, jacobian: joint angles [rad] (6); others: pose of the flange (12), then the "
                   "present joint angles, or none")
            .writes(floats, sorma::between(0, 48), "",
                    "forward: pose (12); gravity: torques [N m] (6); jacobian: rows vx vy vz wx wy wz (36); inverse: the n solutions "
                    "within the limits, nearest first (6n); nearest: the first of them (6); configurations: all 8 (48); distances "
                    "from the singularities of shoulder [m], elbow [m] and wrist (3)")
            .writes(ints, sorma::between(0, 8), "",
                    "inverse, nearest: the configuration of each, 0 .. 7; configurations: for each 1 when it is within the limits")
            .writes(text, {}, "", "singularities that the first solution, or the posture, is near to: shoulder, elbow, wrist")
            .realtime()
            .repeatable({"configurations", "distances", "forward", "gravity", "inverse", "jacobian"})
            .example("puma EXEC forward FMSG 6 0 0 0 0 0 0");
    }

    void born() override {
        changed({});
        ints_.reserve(8);
        text_.reserve(32);
    }
    void changed(std::span<const sorma::Option* const>) override {
        for (std::size_t i = 0; i < 6; ++i)
            if (lower_[i] > upper_[i]) fail(kOrder, name(), "-lower", lower_[i], i + 1, upper_[i]);
        limits_.lower = Eigen::Map<const Joints>(lower_.data());
        limits_.upper = Eigen::Map<const Joints>(upper_.data());
    }

    void exec(Message& m) override {
        Task task = taskOf(m.words.empty() ? std::string_view(task_) : std::string_view(m.words[0]));
        if (task == Task(-1) || m.words.size() > 1) [[unlikely]] fail(kWord, name(), m.words[m.words.size() > 1 ? 1 : 0]);
        const std::size_t n = m.floats.size();
        const bool fromPose = takesPose(task);
        if (fromPose ? n != 12 && n != 18 : n != 6) [[unlikely]]
            fail(kFloats, name(), kTasks[task], fromPose ? "12 floats, or 18 with the present angles" : "6 joint angles", n);
        for (std::size_t i = 0; i < n; ++i)
            if (!std::isfinite(m.floats[i])) [[unlikely]] fail(kValue, name(), i + 1, m.floats[i]);
        fromPose ? answerPose(task, m) : answerAngles(task, m);
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override {
        static constexpr std::size_t kWrites[] = {48, 3, 12, 6, sorma::Pin::kOpen, 36, 6};
        const Task task = taskOf(task_);
        sorma::Pin out{"out", false, 0, kWrites[task], task == nearest ? "rad" : task == gravity ? "N m" : "", {}};
        if (!takesPose(task)) return {{"in", true, 0, 6, "rad", "joint angles"}, std::move(out)};
        return {{"pose", true, 0, 12, "", "of the flange, three rows of the 4x4 matrix"},
                {"posture", true, 12, 6, "rad", "what the solutions shall be near to"}, std::move(out)};
    }

    std::string selftest() override {
        Joints q = Joints::Constant(0.3);
        puma::inverse(puma::forward(q), q, puma::Limits{}, Joints::Ones(), solutions_);
        double error = solutions_.count ? (solutions_.q[std::size_t(solutions_.order[0])] - q).cwiseAbs().maxCoeff() : 1;
        return error < 1e-9 ? "ok: inverse of forward is the posture" : "inverse of forward is another posture";
    }

private:
    static bool takesPose(Task task) { return task == inverse || task == nearest || task == configurations; }

    void answerAngles(Task task, Message& m) {
        const Joints q = Eigen::Map<const Joints>(m.floats.data());
        m.clear();
        auto put = [&](const auto& values) { m.floats.assign(values.data(), values.data() + values.size()); };
        if (task == forward) return put(puma::forward(q));
        if (task == jacobian) return put(puma::jacobian(q));
        if (task == gravity) return put(puma::gravity(q, gravity_, load_, Eigen::Map<const Eigen::Vector3d>(loadCentre_.data())));
        auto d = puma::distances(q);
        m.floats.assign({d.shoulder, d.elbow, d.wrist});
        tellNear(puma::singularities(d), m);
    }

    void answerPose(Task task, Message& m) {
        const Pose pose = Eigen::Map<const Pose>(m.floats.data());
        if (!puma::isPose(pose)) [[unlikely]] fail(kPose, name());
        const double* posture = m.floats.size() == 18 ? m.floats.data() + 12 : posture_.data();
        auto& s = solutions_;
        puma::inverse(pose, Eigen::Map<const Joints>(posture), limits_, Eigen::Map<const Joints>(weights_.data()), s);
        if (s.reach != puma::Solutions::reachable) [[unlikely]] failReach(pose);
        if (s.count == 0 && task != configurations) [[unlikely]] failLimits();
        m.clear();
        if (m.ints.capacity() < 8) m.ints.swap(ints_);      // memory from before the first tick
        auto append = [&](const Joints& q) { m.floats.insert(m.floats.end(), q.data(), q.data() + 6); };
        if (task == configurations) {
            for (auto& q : s.q) append(q);
            m.ints.assign(s.within.begin(), s.within.end());
            return;
        }
        const int n = task == nearest ? 1 : s.count;
        for (int i = 0; i < n; ++i) append(s.q[std::size_t(s.order[std::size_t(i)])]);
        m.ints.assign(s.order.begin(), s.order.begin() + n);
        tellNear(s.near[std::size_t(s.order[0])], m);
    }

    void tellNear(unsigned near, Message& m) {
        if (near && m.text.capacity() < 32) m.text.swap(text_);
        auto add = [&](const char* word) { (m.text.empty() ? m.text : m.text += ' ') += word; };
        if (near & puma::kShoulder) add("shoulder");
        if (near & puma::kElbow) add("elbow");
        if (near & puma::kWrist) add("wrist");
    }

    [[noreturn]] void failReach(const Pose& pose) const {
        const Eigen::Vector3d w = puma::wristCentre(pose);
        if (solutions_.reach == puma::Solutions::tooClose) fail(kTooClose, name(), w[0], w[1], w[2]);
        auto reach = puma::reachOf(w);
        fail(kTooFar, name(), w[0], w[1], w[2], reach.distance, reach.least, reach.most);
    }

    [[noreturn]] void failLimits() const {
        double least = std::numeric_limits<double>::infinity(), angle = 0;
        int joint = 0;
        for (auto& q : solutions_.q) {
            const Joints excess = (q - limits_.upper).cwiseMax(limits_.lower - q);
            int i;
            if (double most = excess.maxCoeff(&i); most < least) least = most, joint = i, angle = q[i];
        }
        fail(kLimits, name(), joint + 1, angle, limits_.lower[joint], limits_.upper[joint]);
    }

    static std::vector<double> list(const Joints& q) { return {q.data(), q.data() + 6}; }

    puma::Limits limits_;
    puma::Solutions solutions_;         // of the last request
    std::vector<std::int64_t> ints_;    // memory for the first answer
    std::string text_;
    std::string task_ = "forward";
    std::vector<double> lower_ = list(limits_.lower), upper_ = list(limits_.upper);
    std::vector<double> posture_ = std::vector<double>(6, 0.0), weights_ = std::vector<double>(6, 1.0);
    double gravity_ = 9.81, load_ = 0;
    std::vector<double> loadCentre_ = {0, 0, 0};
};

}  // namespace

extern "C" SORMA_EXPORT int Puma_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::puma", "1.0", {Puma::describe()});
}
