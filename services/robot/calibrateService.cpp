// calibrate -- weighs the hand: holds it still in several orientations, and finds its mass, its centre, and the offset of
// the sensor.
//
//     calibrate CTRL -file hand.dict
//     calibrate EXEC
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>

#include <Eigen/QR>

#include "calibrate.h"

namespace robot {

using sorma::Message;

namespace {

constexpr double kGravity = 9.81;           // [m/s2]
constexpr double kAlike = 0.05;             // the least share of the weakest direction in the strongest

Eigen::Matrix3d cross(const Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

// Rests at the end of each leg; the second half of the rest counts.
class Weigher final : public PathMotion {
public:
    Weigher(const Now& now, std::vector<Leg> legs, std::vector<Joints> postures)
        : PathMotion(now.settings.frames, now.settings.limits, std::move(legs)), sums_(postures.size()) {
        for (auto& q : postures) orientations_.push_back(now.settings.frames.toolOf(q).r);
    }
    std::vector<Weighing> weighings() const {
        std::vector<Weighing> out;
        for (std::size_t i = 0; i < sums_.size(); ++i)
            if (sums_[i].count > 0) out.push_back({orientations_[i].conjugate() * Vector3d::UnitZ(),
                                                   sums_[i].felt / sums_[i].count});
        return out;
    }

private:
    struct Sum {
        Wrench felt = Wrench::Zero();
        int count = 0;
    };
    void resting(std::size_t leg, double rested, const Senses& senses) noexcept override {
        if (rested < 0.5 || !senses.sensed) return;
        sums_[leg].felt += senses.raw;
        ++sums_[leg].count;
    }
    std::vector<Sum> sums_;
    std::vector<Quaterniond> orientations_;
};

// As options of the arm.
std::vector<std::string> wordsOf(const Load& load) {
    auto list = [](const auto& v) {
        return sorma::toText(sorma::Value(std::vector<double>(v.data(), v.data() + v.size())));
    };
    return {"-handMass", sorma::toText(sorma::Value(load.mass)), "-handCentre", list(load.centre), "-sensorOffset",
            list(load.offset)};
}

}  // namespace

bool weigh(const std::vector<Weighing>& weighings, Load& load) {
    const auto n = Eigen::Index(weighings.size());
    if (n < 3) return false;
    // The sensor shows the force that carries the hand: m g up + offset; and its moment about the sensor: centre x (m g up)
    // + offset.
    Eigen::MatrixXd a(3 * n, 4), b(3 * n, 6);
    Eigen::VectorXd f(3 * n), m(3 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const auto& w = weighings[std::size_t(i)];
        a.middleRows<3>(3 * i) << kGravity * w.up, Eigen::Matrix3d::Identity();
        f.segment<3>(3 * i) = w.felt.head<3>();
        m.segment<3>(3 * i) = w.felt.tail<3>();
    }
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> forces(a);
    forces.setThreshold(kAlike / kGravity);
    if (forces.rank() < 4) return false;
    const Eigen::VectorXd x = forces.solve(f);
    load.mass = x[0];
    for (Eigen::Index i = 0; i < n; ++i)
        b.middleRows<3>(3 * i) << -cross(load.mass * kGravity * weighings[std::size_t(i)].up), Eigen::Matrix3d::Identity();
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> moments(b);
    moments.setThreshold(kAlike / kGravity);
    if (moments.rank() < 6) return false;
    const Eigen::VectorXd y = moments.solve(m);
    load.centre = y.head<3>();
    load.offset << x.tail<3>(), y.tail<3>();
    load.forceResidual = (a * x - f).norm() / std::sqrt(3 * n);
    load.momentResidual = (b * y - m).norm() / std::sqrt(3 * n);
    return true;
}

sorma::Class Calibrate::describe() {
    using enum sorma::Field;
    auto c = sorma::Class::of<Calibrate>("calibrate", "weighs the hand with the wrist's sensor");
    Mover::describe<Calibrate>(c);
    c.vector("-postures", &Calibrate::postures_, {.unit = "rad", .low = -10, .high = 10,
                                                  .help = "joint angles of at least three postures, 6 each; empty: the "
                                                          "present one, the wrist turned"})
        .real("-jointSpeed", &Calibrate::jointSpeed_, {.unit = "rad/s", .low = 0.01, .high = 2,
                                                       .help = "of the fastest joint between them"})
        .real("-rest", &Calibrate::rest_, {.unit = "s", .low = 0.1, .high = 60,
                                           .help = "at each of them; what is felt in its second half counts"})
        .real("-mostResidual", &Calibrate::mostResidual_, {.unit = "N", .low = 0.001, .high = 100,
                                                           .help = "with more than that the result is refused"})
        .named("-file", &Calibrate::file_, {.help = "dictionary to write the result to, as the entry ARM.calibration; "
                                                   "empty: none"})
        .writes(floats, sorma::exactly(12), "", "mass [kg], centre from the sensor [m] (3), the sensor's offset [N] (3) [N "
                                                "m] (3), residuals [N] [N m]")
        .example("calibrate CTRL -rest 0.5");
    return c;
}

void Calibrate::changed(std::span<const sorma::Option* const>) {
    if (postures_.size() % 6 != 0 || (!postures_.empty() && postures_.size() < 18))
        fail(kOrder, name(), "-postures", "6 numbers for each of at least three postures, got " +
                                          std::to_string(postures_.size()));
}

void Calibrate::exec(Message& m) {
    (void)file_.permit(*this);                  // before the arm moves
    launch(m, [this](const Now& now) { return plan(now); },
           [this](Message& reply, const Now&, Motion& motion) {
               Load load;
               const auto weighings = static_cast<Weigher&>(motion).weighings();
               if (!weigh(weighings, load))
                   fail(kCalibration, name(), "the orientations are too alike, or too few; -postures must turn the hand so "
                                              "that gravity acts along all its axes");
               if (load.forceResidual > mostResidual_)
                   fail(kCalibration, name(), "the residual is " + number(load.forceResidual) + " N, -mostResidual " +
                        number(mostResidual_) +
                                                  ": something touches the hand, or it moves");
               const auto words = wordsOf(load);
               save(words, load);
               Message set;
               set.words = words;
               pino().invoke(sorma::Method::ctrl, set);
               reply.floats = {load.mass};
               reply.floats.insert(reply.floats.end(), load.centre.data(), load.centre.data() + 3);
               reply.floats.insert(reply.floats.end(), load.offset.data(), load.offset.data() + 6);
               reply.floats.insert(reply.floats.end(), {load.forceResidual, load.momentResidual});
           });
}

Job::Plan Calibrate::plan(const Now& now) {
    if (!now.sensed) fail(kSensor, name(), "nothing can be weighed without it");
    std::vector<Joints> postures;
    for (std::size_t i = 0; i < postures_.size(); i += 6) postures.push_back(Eigen::Map<const Joints>(&postures_[i]));
    if (postures.empty()) {
        // Towards the middle of the wrist's range, so that the limits are far.
        const double bend = now.q[4] > 0 ? -0.9 : 0.9, roll = now.q[3] > 0 ? -1 : 1;
        for (auto [q4, q5] : {std::pair{0.0, 0.0}, {0.0, bend}, {roll, 0.0}, {-0.5 * roll, 0.0}}) {
            postures.push_back(now.q);
            postures.back()[3] += q4, postures.back()[4] += q5;
        }
    }
    std::vector<PathMotion::Leg> legs;
    Knot at{now.q, {}};
    for (auto& q : postures) {
        Path path(Path::Kind::joints, at, 1);
        path.add({q, {}});
        legs.push_back({path, Profile(path.length(), jointSpeed_, 1), rest_});
        at.q = q;
    }
    auto all = guards(now);
    PathMotion trial(now.settings.frames, now.settings.limits, legs);
    verify(now, trial, all);
    return {std::make_unique<Weigher>(now, std::move(legs), std::move(postures)), std::move(all)};
}

void Calibrate::save(const std::vector<std::string>& words, const Load& load) {
    if (file_.empty()) return;
    char date[32];
    const std::time_t now = std::time(nullptr);
    std::tm local;
    std::strftime(date, sizeof date, "%Y-%m-%d %H:%M:%S", localtime_r(&now, &local));
    const std::string& file = file_.use(*this);
    std::ofstream out(file);
    out << "# weighed by " << name() << " on " << date << ", residuals " << number(load.forceResidual) << " N "
        << number(load.momentResidual) << " N m\n"
        << pino().name() << ".calibration";
    for (std::size_t i = 0; i < words.size(); i += 2) out << " " << words[i] << " {" << words[i + 1] << "}";
    out << "\n";
    out.close();
    if (!out) fail(kFile, name(), file, std::strerror(errno));
}

}  // namespace robot
