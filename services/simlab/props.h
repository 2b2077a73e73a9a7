// props.h -- actions of people in the laboratory: on tokens, board and ball; a hand over the board; a push.
//
// Threads: none of its own; called by the thread that steps the model, or with the laboratory's lock held.
#pragma once

#include "trajectory.h"
#include "scene.h"

namespace simlab {

class Props {
public:
    Props(Scene& scene, mjData& data) : scene_(scene), data_(data) {}

    // Each step, before it.
    void update(double now);

    // These throw std::invalid_argument, whose message says what is there instead.
    void moveToken(const std::string& name, double file, double rank, double h);
    void stealToken(const std::string& name);
    std::string addToken(const std::string& colour, double file, double rank, double h);    // a spare one; returns its name
    void moveBoard(double dx, double dy, double turn);                                      // with what lies on it
    struct Lying {
        std::string name;
        double file, rank;
        Point at;                                   // [m]
    };
    std::vector<Lying> tokens() const;

    void setBall(Trajectory path, double now);
    const Trajectory& ball() const { return ball_; }
    Point ballAt(double now) const { return ball_.at(now - ballBegan_); }
    enum Prop { secondBall, occluder, person };
    void move(Prop prop, const Point& to, double seconds, double now);
    void hide(Prop prop);
    std::string placeOf(Prop prop) const;           // where it goes: x y z, or away
    void push(const Point& force, double seconds, double now);      // [N] at the hand, world
    void laser(bool on, double blinkRate);
    void setFriction(double tokens, double tips);                   // factors

private:
    struct Mover { Point from{}, to{0, 0, -2}; double begin = 0, end = 0; };
    void put(const Token& t, double x, double y, double z, double yaw);
    const Token& find(const std::string& name) const;
    const Token* above(const Token& t) const;       // the token that lies on it
    Point position(const Token& t) const;
    void fieldOf(const Point& p, double& file, double& rank) const;
    bool onBoard(const Point& p) const;
    void needBoard() const;
    void setMocap(int id, const Point& p);

    Scene& scene_;
    mjData& data_;
    Trajectory ball_;
    double ballBegan_ = 0;
    Mover movers_[3];
    Point force_{};
    double forceEnd_ = 0;
    bool laserOn_ = false;
    double blinkRate_ = 0;
    std::vector<double> usual_;         // sliding friction of all geoms
};

}  // namespace simlab
