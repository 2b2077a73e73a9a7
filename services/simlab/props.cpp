#include "props.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace simlab {

namespace {
constexpr double kHeap = 0.02;          // [m] tokens nearer than that to each other in the plane lie on one heap
}

// ---- tokens and board ----

const Token& Props::find(const std::string& name) const {
    if (const Token* t = scene_.token(name)) return *t;
    if (scene_.tokens.empty()) throw std::invalid_argument("this scene has no tokens");
    throw std::invalid_argument("no token " + name + ": there are " + scene_.tokens.front().name + " .. " +
                                scene_.tokens.back().name);
}

void Props::needBoard() const {
    if (scene_.fields == 0) throw std::invalid_argument("this scene has no board");
}

Point Props::position(const Token& t) const { return {data_.qpos[t.qpos], data_.qpos[t.qpos + 1], data_.qpos[t.qpos + 2]}; }

void Props::put(const Token& t, double x, double y, double z, double yaw) {
    const double pose[7] = {x, y, z, std::cos(yaw / 2), 0, 0, std::sin(yaw / 2)};
    std::copy_n(pose, 7, data_.qpos + t.qpos);
    std::fill_n(data_.qvel + t.dof, 6, 0.0);
    std::fill_n(data_.qacc_warmstart + t.dof, 6, 0.0);
}

void Props::fieldOf(const Point& p, double& file, double& rank) const {
    const FieldPose centre = scene_.place(data_, scene_.fields / 2.0 + 0.5, scene_.fields / 2.0 + 0.5, 0);
    const double c = std::cos(centre.yaw), s = std::sin(centre.yaw), dx = p[0] - centre.x, dy = p[1] - centre.y;
    rank = scene_.fields / 2.0 + 0.5 - (c * dx + s * dy) / scene_.fieldSize;
    file = scene_.fields / 2.0 + 0.5 + (c * dy - s * dx) / scene_.fieldSize;
}

bool Props::onBoard(const Point& p) const {
    double file, rank;
    fieldOf(p, file, rank);
    const double most = scene_.fields + 0.5;
    return file > 0.5 && file < most && rank > 0.5 && rank < most && p[2] > 0 && p[2] < 0.2;
}

void Props::moveToken(const std::string& name, double file, double rank, double h) {
    needBoard();
    const Token& t = find(name);
    const double n = scene_.fields + 4;
    if (!(file > -4 && file < n && rank > -4 && rank < n && h >= 0 && h < 30))
        throw std::invalid_argument("file and rank must be -4 .. " + std::to_string(int(n)) + ", tokens underneath 0 .. 30");
    const FieldPose p = scene_.place(data_, file, rank, h);
    for (auto& other : scene_.tokens) {
        const Point o = position(other);
        if (&other != &t && std::hypot(o[0] - p.x, o[1] - p.y) < kHeap && std::fabs(o[2] - p.z) < 0.006)
            throw std::invalid_argument(other.name + " lies there already");
    }
    put(t, p.x, p.y, p.z + 0.0002, p.yaw);
}

// Beside each other at the far left corner of the table, where no camera looks.
void Props::stealToken(const std::string& name) {
    const Token& t = find(name);
    const auto i = double(&t - scene_.tokens.data());
    put(t, 1.3 - 0.04 * std::floor(i / 12), 0.65 - 0.04 * std::fmod(i, 12), 0.0044, 0);
}

std::string Props::addToken(const std::string& colour, double file, double rank, double h) {
    needBoard();
    for (auto& t : scene_.tokens)
        if (t.name.rfind(colour + "_", 0) == 0 && !onBoard(position(t))) {
            moveToken(t.name, file, rank, h);
            return t.name;
        }
    if (colour != "red" && colour != "yellow")
        throw std::invalid_argument("bad colour \"" + colour + "\": must be red or yellow");
    throw std::invalid_argument("all " + colour + " tokens are on the board");
}

void Props::moveBoard(double dx, double dy, double turn) {
    needBoard();
    const FieldPose before = scene_.place(data_, scene_.fields / 2.0 + 0.5, scene_.fields / 2.0 + 0.5, 0);
    const double at[3] = {dx, dy, turn}, c = std::cos(turn), s = std::sin(turn);
    if (std::hypot(dx, dy) > 0.5 || std::fabs(turn) > 3.2) throw std::invalid_argument("at most 0.5 m and 3.2 rad at a time");
    for (auto& t : scene_.tokens) {
        const Point p = position(t);
        if (!onBoard(p)) continue;
        const mjtNum* q = data_.qpos + t.qpos + 3;
        const double yaw = 2 * std::atan2(q[3], q[0]), x = p[0] - before.x, y = p[1] - before.y;
        put(t, before.x + c * x - s * y + dx, before.y + s * x + c * y + dy, p[2], yaw + turn);
    }
    for (std::size_t i = 0; i < 3; ++i) data_.qpos[scene_.boardQpos[i]] += at[i];
}

std::vector<Props::Lying> Props::tokens() const {
    std::vector<Lying> out;
    for (auto& t : scene_.tokens) {
        Lying& here = out.emplace_back(Lying{t.name, 0, 0, position(t)});
        fieldOf(here.at, here.file, here.rank);
    }
    return out;
}

// ---- tokens in the air ----

void Props::setMocap(int id, const Point& p) {
    if (id >= 0) std::copy_n(p.begin(), 3, data_.mocap_pos + 3 * id);
}

void Props::setBall(Trajectory path, double now) {
    if (scene_.target < 0) throw std::invalid_argument("this scene has no ball");
    ball_ = std::move(path);
    ballBegan_ = now;
}

void Props::move(Prop prop, const Point& to, double seconds, double now) {
    Mover& m = movers_[prop];
    // A prop that was out of sight appears at its new place.
    const bool hidden = m.to[2] < -1;
    const double part = m.end > m.begin ? std::clamp((now - m.begin) / (m.end - m.begin), 0.0, 1.0) : 1;
    Point at;
    for (std::size_t i = 0; i < 3; ++i) at[i] = hidden ? to[i] : m.from[i] + part * (m.to[i] - m.from[i]);
    m = {at, to, now, now + seconds};
}

void Props::hide(Prop prop) { movers_[prop] = {}; }

std::string Props::placeOf(Prop prop) const {
    const Point& p = movers_[prop].to;
    if (p[2] < -1) return "away";
    char text[80];
    std::snprintf(text, sizeof text, "%.4g %.4g %.4g", p[0], p[1], p[2]);
    return text;
}

void Props::push(const Point& force, double seconds, double now) {
    force_ = force;
    forceEnd_ = now + seconds;
}

void Props::laser(bool on, double blinkRate) {
    laserOn_ = on;
    blinkRate_ = blinkRate;
}

void Props::setFriction(double tokens, double tips) {
    mjModel& m = *scene_.model;
    if (usual_.empty())
        for (int g = 0; g < m.ngeom; ++g) usual_.push_back(m.geom_friction[3 * g]);
    for (int g = 0; g < m.ngeom; ++g)       // a tip's friction decides over that of what it touches
        m.geom_friction[3 * g] = usual_[std::size_t(g)] * (m.geom_priority[g] > 0 ? tips : tokens);
}

void Props::update(double now) {
    setMocap(scene_.target, ballAt(now));
    const int ids[3] = {scene_.secondTarget, scene_.occluder, scene_.person};
    for (int i = 0; i < 3; ++i) {
        const Mover& m = movers_[i];
        const double u = m.end > m.begin ? std::clamp((now - m.begin) / (m.end - m.begin), 0.0, 1.0) : 1;
        setMocap(ids[i], {m.from[0] + u * (m.to[0] - m.from[0]), m.from[1] + u * (m.to[1] - m.from[1]),
                          m.from[2] + u * (m.to[2] - m.from[2])});
    }
    for (std::size_t k = 0; k < 3; ++k)
        data_.xfrc_applied[6 * std::size_t(scene_.hand) + k] = now < forceEnd_ ? force_[k] : 0;
    Point spot{0, 0, -0.5};
    if (laserOn_ && (blinkRate_ <= 0 || std::fmod(now * blinkRate_, 1) < 0.5)) {
        const mjtNum* from = data_.site_xpos + 3 * scene_.laser;
        const mjtNum* axes = data_.site_xmat + 9 * scene_.laser;
        const mjtNum along[3] = {axes[2], axes[5], axes[8]};
        static constexpr mjtByte kGroups[mjNGROUP] = {1, 1, 0, 1, 1, 1};        // 2: the spot itself
        int geom = -1;
        const double far = mj_ray(scene_.model.get(), &data_, from, along, kGroups, 1, scene_.hand, &geom);
        if (far > 0) spot = {from[0] + far * along[0], from[1] + far * along[1], from[2] + far * along[2]};
    }
    setMocap(scene_.spot, spot);
}

}  // namespace simlab
