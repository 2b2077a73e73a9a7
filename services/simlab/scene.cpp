#include "scene.h"

#include <cmath>
#include <cstring>

#include "sceneText.h"

namespace simlab {

namespace {

constexpr double kTokenHeight = 0.008, kTokenRest = 0.0042;     // [m] a token's centre lies so high

struct Kind { const char* name; int fields; };
constexpr Kind kKinds[] = {{"8x8", 8}, {"10x10", 10}, {"tracker", 0}};

const Kind* kindOf(const std::string& what) {
    for (auto& k : kKinds)
        if (what == k.name) return &k;
    return nullptr;
}

// MuJoCo reads files alone: a text is one of its virtual file system.
mjModel* loadText(const std::string& text, char* error, int size) {
    auto vfs = std::make_unique<mjVFS>();
    mj_defaultVFS(vfs.get());
    mj_makeEmptyFileVFS(vfs.get(), "lab.xml", int(text.size()));
    std::memcpy(vfs->filedata[0], text.data(), text.size());
    mjModel* model = mj_loadXML("lab.xml", vfs.get(), error, size);
    mj_deleteVFS(vfs.get());
    return model;
}

}  // namespace

std::string Scene::text(const std::string& what) {
    const Kind* kind = kindOf(what);
    return kind ? sceneText(kind->fields) : std::string();
}

Scene::Scene(const std::string& what) : what_(what) {
    char error[500] = "";
    const Kind* kind = kindOf(what);
    model.reset(kind ? loadText(text(what), error, sizeof error) : mj_loadXML(what.c_str(), nullptr, error, sizeof error));
    if (!model) {
        std::string reason = error;
        while (!reason.empty() && reason.back() == '\n') reason.pop_back();
        throw SceneError(reason + "; it must be 8x8, 10x10, tracker, or a MuJoCo file (DBX -scene prints one to start from)");
    }
    for (std::size_t i = 0; i < 6; ++i) {
        const std::string n = std::to_string(i + 1);
        const int joint = need(mjOBJ_JOINT, "joint_" + n);
        armQpos[i] = model->jnt_qposadr[joint];
        armDof[i] = model->jnt_dofadr[joint];
        servo[i] = need(mjOBJ_ACTUATOR, "servo_" + n);
    }
    for (std::size_t f = 0; f < 3; ++f) {
        const std::string n = std::to_string(f + 1);
        static constexpr const char* kJoints[] = {"_ab", "_pf", "_mf", "_df"};
        for (std::size_t j = 0; j < 4; ++j) {
            const int joint = need(mjOBJ_JOINT, "f" + n + kJoints[j]);
            fingerQpos[4 * f + j] = model->jnt_qposadr[joint];
            fingerDof[4 * f + j] = model->jnt_dofadr[joint];
            if (j < 3) fingerServo[3 * f + j] = need(mjOBJ_ACTUATOR, "m" + n + kJoints[j]);
        }
        touch[f] = model->sensor_adr[need(mjOBJ_SENSOR, "touch_" + n)];
    }
    hand = need(mjOBJ_BODY, "hand");
    wristForce = model->sensor_adr[need(mjOBJ_SENSOR, "wrist_force")];
    wristTorque = model->sensor_adr[need(mjOBJ_SENSOR, "wrist_torque")];
    tabletop = need(mjOBJ_GEOM, "tabletop");
    laser = need(mjOBJ_SITE, "laser");
    tool = need(mjOBJ_SITE, "tool");
    camera = need(mjOBJ_CAMERA, "eecam");

    for (const char* colour : {"red_", "yellow_"})
        for (int i = 1;; ++i) {
            const std::string name = colour + std::to_string(i);
            const int body = find(mjOBJ_BODY, name);
            if (body < 0) break;
            const int joint = model->body_jntadr[body];
            if (joint < 0 || model->jnt_type[joint] != mjJNT_FREE)
                throw SceneError("body " + name + " must have a free joint");
            tokens.push_back({name, model->jnt_qposadr[joint], model->jnt_dofadr[joint]});
            tokenWeight += model->body_mass[body] * 9.81;
        }
    auto mocap = [&](const char* name) {
        const int body = find(mjOBJ_BODY, name);
        return body < 0 ? -1 : model->body_mocapid[body];
    };
    target = mocap("target");
    secondTarget = mocap("target_2");
    spot = mocap("laser_spot");
    occluder = mocap("occluder");
    person = mocap("person");
    boardBody = find(mjOBJ_BODY, "board");
    if (boardBody < 0) return;
    static constexpr const char* kBoard[] = {"board_x", "board_y", "board_yaw"};
    for (std::size_t i = 0; i < 3; ++i) boardQpos[i] = model->jnt_qposadr[need(mjOBJ_JOINT, kBoard[i])];
    // A square of the board tells its size: the plate comes first, then the squares, half the fields dark.
    int squares = 0;
    for (int g = model->body_geomadr[boardBody] + 1; g < model->body_geomadr[boardBody] + model->body_geomnum[boardBody];
         ++g) {
        if (model->geom_type[g] != mjGEOM_BOX) continue;
        fieldSize = 2 * model->geom_size[3 * g];
        ++squares;
    }
    fields = int(std::lround(std::sqrt(2.0 * squares)));
}

int Scene::find(int type, const std::string& name) const { return mj_name2id(model.get(), type, name.c_str()); }

int Scene::need(int type, const std::string& name) const {
    const int id = find(type, name);
    if (id < 0)
        throw SceneError(what_ + " has no " + mju_type2Str(type) + " named " + name +
                         ", without which it is no laboratory (DBX -scene prints one that is)");
    return id;
}

FieldPose Scene::place(const mjData& d, double file, double rank, double h) const {
    const mjtNum* origin = model->body_pos + 3 * boardBody;
    const double yaw = d.qpos[boardQpos[2]], c = std::cos(yaw), s = std::sin(yaw);
    const double x = (fields / 2.0 - rank + 0.5) * fieldSize, y = (file - 0.5 - fields / 2.0) * fieldSize;
    return {origin[0] + d.qpos[boardQpos[0]] + c * x - s * y, origin[1] + d.qpos[boardQpos[1]] + s * x + c * y,
            kTokenRest + h * kTokenHeight, yaw};
}

const Token* Scene::token(std::string_view name) const {
    for (auto& t : tokens)
        if (t.name == name) return &t;
    return nullptr;
}

}  // namespace simlab
