#include "puma.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace puma {

namespace {

using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846, kTurn = 2 * kPi;
constexpr double kD1 = 0.672, kA2 = 0.4318, kA3 = 0.0203, kD3 = 0.15005, kD4 = 0.4318, kD6 = 0.05625;
constexpr double kNearWrist = 0.03;
constexpr double kSame = 1e-9;          // angles, and sines of angles, that are closer are the same

struct Link {
    double a, d, ca, sa;                // cosine and sine of alpha
    double mass;
    double x, y, z;                     // centre of mass in its own frame
};
// Link 1 only turns about the vertical: its mass does not matter.
constexpr Link kLinks[6] = {
    {0, kD1, 0, 1, 0, 0, 0, 0},
    {kA2, 0, 1, 0, 17.4, -0.3638, 0.006, 0.2275},
    {kA3, kD3, 0, -1, 4.8, -0.0203, -0.0141, 0.070},
    {0, kD4, 0, 1, 0.82, 0, -0.019, 0},
    {0, 0, 0, -1, 0.34, 0, 0, 0},
    {0, kD6, 1, 0, 0.09, 0, 0, -0.02425},
};

struct Frame {
    Vector3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, p{0, 0, 0};

    Frame next(const Link& link, double q) const {
        double c = std::cos(q), s = std::sin(q);
        Frame f;
        f.x = c * x + s * y;
        Vector3d t = c * y - s * x;
        f.y = link.ca * t + link.sa * z;
        f.z = link.ca * z - link.sa * t;
        f.p = p + link.d * z + link.a * f.x;
        return f;
    }
    Vector3d at(double u, double v, double w) const { return p + u * x + v * y + w * z; }
};

// Frame 0 to frame 6.
struct Chain {
    Frame frames[7];

    explicit Chain(const Joints& q) {
        for (int i = 0; i < 6; ++i) frames[i + 1] = frames[i].next(kLinks[i], q[i]);
    }
};

Distances distancesOf(double rho2, double height, double wrist) {
    double k = (rho2 + height * height - kA2 * kA2 - kA3 * kA3 - kD4 * kD4) / (2 * kA2);
    return {std::sqrt(std::max(rho2, 0.0)), std::sqrt(kA3 * kA3 + kD4 * kD4) - std::abs(k), wrist};
}

// An angle in its limits, as near to `to` as possible; else the one nearest to `to`, which is then outside.
double shifted(double angle, double to, double low, double high, bool& within) {
    constexpr double kRound = 6755399441055744.0;           // 1.5 * 2^52: adding it rounds to a whole number
    to = std::clamp(to, low, high);
    double turns = ((to - angle) * (1 / kTurn) + kRound) - kRound;
    double nearest = angle + turns * kTurn;
    double back = nearest > high + kSame ? nearest - kTurn : nearest < low - kSame ? nearest + kTurn : nearest;
    bool fits = back <= high + kSame && back >= low - kSame;
    within &= fits;
    return fits ? std::clamp(back, low, high) : nearest;
}

}  // namespace

Joints Limits::degrees(double q1, double q2, double q3, double q4, double q5, double q6) {
    Joints q;
    q << q1, q2, q3, q4, q5, q6;
    return q * (kPi / 180);
}

Pose forward(const Joints& q) {
    Frame f;
    for (int i = 0; i < 6; ++i) f = f.next(kLinks[i], q[i]);
    Pose pose;
    pose << f.x, f.y, f.z, f.p;
    return pose;
}

Jacobian jacobian(const Joints& q) {
    Chain chain(q);
    Jacobian j;
    for (int i = 0; i < 6; ++i) {
        auto& f = chain.frames[i];
        j.block<3, 1>(0, i) = f.z.cross(chain.frames[6].p - f.p);
        j.block<3, 1>(3, i) = f.z;
    }
    return j;
}

Joints gravity(const Joints& q, double acceleration, double load, const Vector3d& centre) {
    Chain chain(q);
    // The links from i on: their mass, and the sum of their centres times mass.
    double mass = load;
    Vector3d moment = load * chain.frames[6].at(centre[0], centre[1], centre[2]);
    Joints torque;
    for (int i = 5; i >= 0; --i) {
        auto& link = kLinks[i];
        mass += link.mass;
        moment += link.mass * chain.frames[i + 1].at(link.x, link.y, link.z);
        auto& f = chain.frames[i];
        Vector3d arm = moment - mass * f.p;
        torque[i] = acceleration * (f.z[0] * arm[1] - f.z[1] * arm[0]);     // height gained by turning about z of frame i
    }
    return torque;
}

Distances distances(const Joints& q) {
    double c2 = std::cos(q[1]), s2 = std::sin(q[1]), c23 = std::cos(q[1] + q[2]), s23 = std::sin(q[1] + q[2]);
    double radius = kA2 * c2 + kA3 * c23 - kD4 * s23, height = kA2 * s2 + kA3 * s23 + kD4 * c23;
    return distancesOf(radius * radius, height, std::abs(std::sin(q[4])));
}

unsigned singularities(const Distances& d) {
    return kShoulder * (d.shoulder < 0.03) | kElbow * (d.elbow < 0.005) | kWrist * (d.wrist < kNearWrist);
}

namespace {

// The last three joints, without their whole turns.
struct Wrist {
    double q4, q5, q6, sine;
    bool straight;                      // joints 4 and 6 turn about one axis: only their sum counts
};

// u, v, w: the axes of the forearm, from which the wrist turns to the flange.   q4: for a straight wrist.
inline Wrist wristOf(const Vector3d& u, const Vector3d& v, const Vector3d& w, const Pose& pose, double q4) {
    const Vector3d n = pose.col(0), o = pose.col(1), a = pose.col(2);
    const double q13 = u.dot(a), q23 = v.dot(a), q33 = w.dot(a), sine = std::sqrt(q13 * q13 + q23 * q23);
    if (sine > kSame) [[likely]]
        return {std::atan2(-q23, -q13), std::atan2(sine, q33), std::atan2(-w.dot(o), w.dot(n)), sine, false};
    const double c4 = std::cos(q4), s4 = std::sin(q4), q11 = u.dot(n), q21 = v.dot(n), m11 = c4 * q11 + s4 * q21;
    return {q4, q33 > 0 ? 0 : kPi, std::atan2(c4 * q21 - s4 * q11, q33 > 0 ? m11 : -m11), sine, true};
}

// Into the order, by distance.
inline void enlist(Solutions& out, int i) {
    int at = out.count++;
    for (; at > 0 && out.distance[std::size_t(i)] < out.distance[std::size_t(out.order[std::size_t(at - 1)])]; --at)
        out.order[std::size_t(at)] = out.order[std::size_t(at - 1)];
    out.order[std::size_t(at)] = i;
}

}  // namespace

void inverse(const Pose& pose, const Joints& posture, const Limits& limits, const Joints& weights, Solutions& out) {
    const Vector3d centre = wristCentre(pose);
    const double x = centre[0], y = centre[1], z = centre[2] - kD1;
    out.count = 0;
    out.within.fill(false);

    double rho2 = x * x + y * y - kD3 * kD3;
    if (rho2 < -kSame * kD3 * kD3) {
        out.reach = Solutions::tooClose;
        return;
    }
    static const double length = std::sqrt(kA3 * kA3 + kD4 * kD4), bend = std::atan2(kD4, kA3);
    static const double cosBend = kA3 / length, sinBend = kD4 / length;
    const double k = (rho2 + z * z - kA2 * kA2 - kA3 * kA3 - kD4 * kD4) / (2 * kA2);
    double cosElbow = k / length;
    if (std::abs(cosElbow) > 1 + kSame) {
        out.reach = Solutions::tooFar;          // folded too much as well: the same formula, and the same to the caller
        return;
    }
    out.reach = Solutions::reachable;
    rho2 = std::max(rho2, 0.0);
    cosElbow = std::clamp(cosElbow, -1.0, 1.0);
    const double rho = std::sqrt(rho2), sinElbow = std::sqrt((1 - cosElbow) * (1 + cosElbow));
    const Distances far = distancesOf(rho2, z, 1);
    const unsigned nearArm = singularities(far);

    const double toWrist = std::atan2(y, x), offset = std::atan2(kD3, rho), rise = std::atan2(z, rho);
    const double upper = kA2 + length * cosElbow, across = length * sinElbow;   // the forearm seen from the upper arm
    const double lift = std::atan2(across, upper), elbow = std::acos(cosElbow);
    const double perWaist = 1 / (x * x + y * y), perReach = 1 / (upper * upper + across * across);

    bool fits[3][4];
    double third[2];
    for (int e = 0; e < 2; ++e) {
        fits[2][e] = !(e && sinElbow < kSame);
        third[e] = shifted((e ? -elbow : elbow) - bend, posture[2], limits.lower[2], limits.upper[2], fits[2][e]);
    }
    for (int s = 0; s < 2; ++s) {
        const double r = s ? -rho : rho;
        fits[0][s] = !(s && rho < kSame);
        const double first = shifted(toWrist + (s ? kPi - offset : offset), posture[0], limits.lower[0], limits.upper[0], fits[0][s]);
        const double c1 = (x * r - y * kD3) * perWaist, s1 = (x * kD3 + y * r) * perWaist;
        for (int e = 0; e < 2; ++e) {
            const double sign = e ? -1 : 1, b = sign * across;
            bool arm = fits[0][s] && fits[2][e];
            const double second = shifted((s ? kPi - rise : rise) - sign * lift, posture[1], limits.lower[1], limits.upper[1], arm);
            const double c2 = (upper * r + b * z) * perReach, s2 = (upper * z - b * r) * perReach;
            const double c3 = cosElbow * cosBend + sign * sinElbow * sinBend, s3 = sign * sinElbow * cosBend - cosElbow * sinBend;
            const double c = c2 * c3 - s2 * s3, h = s2 * c3 + c2 * s3;
            // The forearm's axes; the wrist turns from these to the flange.
            const Vector3d u(c1 * c, s1 * c, h), v(-s1, c1, 0), w(-c1 * h, -s1 * h, c);
            const Wrist wrist = wristOf(u, v, w, pose, posture[3]);
            for (int f = 0; f < 2; ++f) {
                const int i = 4 * s + 2 * e + f;
                const double turn = f && !wrist.straight ? kPi : 0;
                bool within = arm && !(f && wrist.straight);
                auto& q = out.q[std::size_t(i)];
                q[0] = first, q[1] = second, q[2] = third[e];
                q[3] = shifted(wrist.q4 + turn, posture[3], limits.lower[3], limits.upper[3], within);
                q[4] = shifted(f ? -wrist.q5 : wrist.q5, posture[4], limits.lower[4], limits.upper[4], within);
                q[5] = shifted(wrist.q6 + turn, posture[5], limits.lower[5], limits.upper[5], within);
                out.within[std::size_t(i)] = within;
                out.near[std::size_t(i)] = nearArm | kWrist * (wrist.sine < kNearWrist);
                out.distance[std::size_t(i)] = ((q - posture).array().abs() * weights.array()).maxCoeff();
                if (within) enlist(out, i);
            }
        }
    }
}

Vector3d wristCentre(const Pose& pose) { return pose.col(3) - kD6 * pose.col(2); }

Reach reachOf(const Vector3d& w) {
    double forearm = std::sqrt(kA3 * kA3 + kD4 * kD4), z = w[2] - kD1;
    return {std::sqrt(w[0] * w[0] + w[1] * w[1] - kD3 * kD3 + z * z), forearm - kA2, forearm + kA2};
}

bool isPose(const Pose& pose) {
    if (!pose.allFinite()) return false;
    const Eigen::Matrix3d r = pose.leftCols<3>();
    return (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-6 && r.determinant() > 0;
}

}  // namespace puma
