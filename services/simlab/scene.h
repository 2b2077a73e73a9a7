// scene.h -- the MuJoCo model of a laboratory, and the indices of the arm, the hand and the tokens in it.
//
// Threads: one at a time. The owner may change the model; each thread that needs one has its own.
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace simlab {

using Joints = std::array<double, 6>;

struct ModelDeleter { void operator()(mjModel* m) const { mj_deleteModel(m); } };
struct DataDeleter { void operator()(mjData* d) const { mj_deleteData(d); } };
using Model = std::unique_ptr<mjModel, ModelDeleter>;
using Data = std::unique_ptr<mjData, DataDeleter>;

struct SceneError : std::runtime_error { using std::runtime_error::runtime_error; };

// A free body that can be put somewhere.
struct Token {
    std::string name;
    int qpos, dof;                  // first of 7; first of 6
};

// Where a field of the board is, in the world.
struct FieldPose { double x, y, z, yaw; };

class Scene {
public:
    // The parameter what is 8x8, 10x10, tracker, or the path of a file. Throws SceneError, whose message says what is missing
    // in the file.
    explicit Scene(const std::string& what);

    static std::string text(const std::string& what);   // of a built-in scene; empty: there is no such scene

    Model model;
    std::array<int, 6> armQpos, armDof, servo;
    std::array<int, 12> fingerQpos, fingerDof;          // ab pf mf df of fingers 1 .. 3
    std::array<int, 9> fingerServo;                     // ab pf mf
    int hand, wristForce, wristTorque, tabletop, laser, camera, tool;
    std::array<int, 3> touch;
    std::vector<Token> tokens;
    // A scene may lack these; then the index is -1.
    std::array<int, 3> boardQpos{-1, -1, -1};           // x, y, yaw
    int boardBody = -1, target = -1, secondTarget = -1, spot = -1, occluder = -1,
        person = -1;                                    // the last five: mocap bodies
    int fields = 0;                                     // on a side of the board; 0: there is none
    double fieldSize = 0;                               // [m]
    double tokenWeight = 0;                             // [N] of all tokens

    // file, rank: reals, 1 .. fields on the board; h: tokens underneath. Where the centre of a token lies that rests there.
    FieldPose place(const mjData& d, double file, double rank, double h) const;
    const Token* token(std::string_view name) const;

private:
    int find(int type, const std::string& name) const;      // -1
    int need(int type, const std::string& name) const;
    std::string what_;
};

}  // namespace simlab
