#include "sceneText.h"

#include <cmath>
#include <cstdio>

namespace simlab {

namespace {

// The settings that carry tokens without a loss: elliptic cones, impratio 10, solref 0.01. A token rests on three spheres,
// because a cylinder on a cylinder touches in one point only and wobbles.
constexpr const char* kSettings = R"(
  <compiler angle="radian" coordinate="local" inertiafromgeom="auto"/>
  <option timestep="0.002" gravity="0 0 -9.81" integrator="Euler" solver="Newton" iterations="50" tolerance="1e-10" cone="elliptic" impratio="10"/>
  <visual>
    <global offwidth="800" offheight="600"/>
    <quality offsamples="4" shadowsize="2048"/>
    <headlight ambient="0.30 0.30 0.30" diffuse="0.10 0.10 0.10" specular="0 0 0"/>
    <map znear="0.01" zfar="10"/>
  </visual>
  <default>
    <geom contype="0" conaffinity="0" group="1" rgba="0.85 0.85 0.80 1"/>
    <site size="0.008" rgba="1 0 0 1" group="3"/>
    <default class="finger">
      <joint type="hinge" limited="true" damping="0.02" armature="0.0004"/>
      <general dyntype="filter" dynprm="0.02" biastype="affine" gainprm="5" biasprm="0 -5 -0.08" forcelimited="true" forcerange="-1.2 1.2" ctrllimited="true" ctrlrange="-0.6 1.4"/>
    </default>
    <default class="tip">
      <geom contype="1" conaffinity="6" condim="4" friction="1.0 0.01 0.0005" solref="0.01 1" rgba="0.1 0.1 0.1 1" priority="1"/>
    </default>
    <default class="token">
      <geom contype="2" conaffinity="11" condim="3" friction="0.5 0.005 0.0001" solref="0.01 1" group="0"/>
    </default>
    <default class="foot">
      <geom type="sphere" size="0.004" contype="8" conaffinity="6" condim="3" friction="0.5 0.005 0.0001" solref="0.01 1" group="4"/>
    </default>
  </default>
  <asset>
    <material name="glow" rgba="1 1 0.95 1" emission="1" specular="0" shininess="0"/>
    <material name="glow_2" rgba="1 1 0.95 1" emission="1" specular="0" shininess="0"/>
    <material name="spot" rgba="1 0 0 1" emission="1" specular="0" shininess="0"/>
  </asset>
)";

constexpr const char* kRoom = R"(
    <light name="lamp" pos="0.3 -0.6 2.0" dir="0.1 0.3 -1" diffuse="0.40 0.40 0.40" specular="0.1 0.1 0.1" castshadow="true"/>
    <light name="fill" pos="0.6 0.8 2.0" dir="0 -0.3 -1" diffuse="0.25 0.25 0.25" specular="0 0 0" castshadow="false"/>
    <camera name="overview" pos="1.7 -1.1 1.0" xyaxes="0.55 0.83 0 -0.42 0.28 0.86" fovy="45"/>
    <geom name="tabletop" type="plane" size="0.6 0.7 0.05" pos="0.75 0 0" contype="4" conaffinity="9" condim="3" friction="0.5 0.005 0.0001" solref="0.01 1" rgba="0.62 0.60 0.57 1"/>
    <geom type="box" size="0.6 0.7 0.02" pos="0.75 0 -0.021" rgba="0.5 0.45 0.4 1"/>
)";

// Arm, wrist sensor, palm and camera; the fingers come into the innermost body.
constexpr const char* kArm = R"(
<body name="base" pos="0 0 -0.25">
  <inertial pos="0 0 0.3" mass="38" diaginertia="1 1 0.5"/>
  <geom type="cylinder" size="0.09 0.29" pos="0 0 0.29"/>
  <body name="link_1" pos="0 0 0" quat="1 0 0 0">
    <inertial pos="0 0 0.672" mass="2" diaginertia="0.35 0.35 0.35"/>
    <joint name="joint_1" type="hinge" axis="0 0 1" limited="true" range="-2.792526803 2.792526803" armature="1.14" frictionloss="6.3" damping="0.5"/>
    <geom type="cylinder" size="0.09 0.09" pos="0 0 0.672"/>
    <site name="frame_1" pos="0 0 0.672" quat="0.7071067811865476 0.7071067811865476 0 0"/>
    <body name="link_2" pos="0 0 0.672" quat="0.7071067811865476 0.7071067811865476 0 0">
      <inertial pos="0.068 0.006 0.2275" mass="17.4" diaginertia="0.13 0.524 0.539"/>
      <joint name="joint_2" type="hinge" axis="0 0 1" limited="true" range="-0.7853981634 3.926990817" armature="4.71" frictionloss="5.5" damping="0.5"/>
      <geom type="capsule" size="0.07" fromto="0 0 0.09 0.4318 0 0.09"/>
      <site name="frame_2" pos="0.4318 0 0" quat="1 0 0 0"/>
      <body name="link_3" pos="0.4318 0 0" quat="1 0 0 0">
        <inertial pos="0 0.07 0.16415" mass="4.8" diaginertia="0.066 0.0125 0.0785"/>
        <joint name="joint_3" type="hinge" axis="0 0 1" limited="true" range="-3.926990817 0.7853981634" armature="0.827" frictionloss="2.6" damping="0.5"/>
        <geom type="capsule" size="0.05" fromto="0.0203 0 0.15005 0.0203 0.35 0.15005"/>
        <site name="frame_3" pos="0.0203 0 0.15005" quat="0.7071067811865476 -0.7071067811865476 0 0"/>
        <body name="link_4" pos="0.0203 0 0.15005" quat="0.7071067811865476 -0.7071067811865476 0 0">
          <inertial pos="0 0 0.4128" mass="0.82" diaginertia="0.0018 0.0018 0.0013"/>
          <joint name="joint_4" type="hinge" axis="0 0 1" limited="true" range="-1.919862177 2.967059728" armature="0.2" frictionloss="1.3" damping="0.5"/>
          <geom type="cylinder" size="0.04 0.035" pos="0 0 0.385"/>
          <site name="frame_4" pos="0 0 0.4318" quat="0.7071067811865476 0.7071067811865476 0 0"/>
          <body name="link_5" pos="0 0 0.4318" quat="0.7071067811865476 0.7071067811865476 0 0">
            <inertial pos="0 0 0" mass="0.34" diaginertia="0.0003 0.0003 0.0004"/>
            <joint name="joint_5" type="hinge" axis="0 0 1" limited="true" range="-1.745329252 1.745329252" armature="0.179" frictionloss="1" damping="0.5"/>
            <geom type="capsule" size="0.035" fromto="0 0 -0.02 0 0 0.02"/>
            <site name="frame_5" pos="0 0 0" quat="0.7071067811865476 -0.7071067811865476 0 0"/>
            <body name="link_6" pos="0 0 0" quat="0.7071067811865476 -0.7071067811865476 0 0">
              <inertial pos="0 0 0.032" mass="0.09" diaginertia="0.00015 0.00015 4e-05"/>
              <joint name="joint_6" type="hinge" axis="0 0 1" limited="true" range="-4.64257581 4.64257581" armature="0.193" frictionloss="1.2" damping="0.5"/>
              <geom type="cylinder" size="0.03 0.012" pos="0 0 0.044"/>
              <site name="frame_6" pos="0 0 0.05625" quat="1 0 0 0"/>
              <body name="hand" pos="0 0 0.09625">
                <!-- flange (0.05625) + force-torque sensor body (0.04); tool frame: z out of the palm -->
                <inertial pos="0 0 0.02" mass="1.1" diaginertia="0.0015 0.0015 0.0018"/>
                <geom type="cylinder" size="0.038 0.018" pos="0 0 -0.02" rgba="0.3 0.3 0.35 1"/>
                <geom type="cylinder" size="0.050 0.024" pos="0 0 0.026" rgba="0.55 0.55 0.6 1"/>
                <site name="fts" pos="0 0 0"/>
                <site name="tool" pos="0 0 0.160"/>
                <site name="laser" pos="0 0 0.052"/>
                <camera name="eecam" pos="0.115 0 0.010" xyaxes="0 1 0 0.97814760 0 0.20791169" fovy="58"/>
                <geom type="box" size="0.018 0.018 0.02" pos="0.115 0 -0.012" rgba="0.15 0.15 0.15 1"/>
                <geom type="box" size="0.03 0.010 0.005" pos="0.075 0 0.004" rgba="0.3 0.3 0.35 1"/>
)";

// One finger; # is its number.
constexpr const char* kFinger = R"(
        <inertial pos="0 0 0" mass="0.010" diaginertia="2e-6 2e-6 2e-6"/>
        <joint name="f#_ab" class="finger" axis="1 0 0" range="-0.262 0.262"/>
        <body name="f#_prox">
          <inertial pos="0 0 0.0275" mass="0.030" diaginertia="1e-5 1e-5 2e-6"/>
          <joint name="f#_pf" class="finger" axis="0 1 0" range="-0.6 1.4"/>
          <geom type="capsule" size="0.008" fromto="0 0 0 0 0 0.055" rgba="0.6 0.6 0.65 1"/>
          <body name="f#_mid" pos="0 0 0.055">
            <inertial pos="0 0 0.0175" mass="0.015" diaginertia="3e-6 3e-6 1e-6"/>
            <joint name="f#_mf" class="finger" axis="0 1 0" range="0 1.4"/>
            <geom type="capsule" size="0.007" fromto="0 0 0 0 0 0.035" rgba="0.6 0.6 0.65 1"/>
            <body name="f#_dist" pos="0 0 0.035">
              <inertial pos="0 0 0.015" mass="0.010" diaginertia="2e-6 2e-6 5e-7"/>
              <joint name="f#_df" class="finger" axis="0 1 0" range="0 1.4"/>
              <geom type="capsule" size="0.0048" fromto="0 0 0 0 0 0.029" rgba="0.6 0.6 0.65 1"/>
              <geom name="f#_tip" class="tip" type="sphere" size="0.005" pos="0 0 0.03"/>
              <site name="f#_tip" pos="0 0 0.03" size="0.006"/>
            </body>
          </body>
        </body>
)";

// Things that are moved from outside and touch nothing; below the table when they are not wanted. (The colour of a material is
// that of the geom: its class has one.)
constexpr const char* kMoved = R"(
    <body name="target" mocap="true" pos="0.6 0.6 0.3">
      <geom type="sphere" size="0.02" material="glow" rgba="1 1 0.95 1" group="0"/>
      <geom type="capsule" size="0.003" fromto="0 0 -0.02 0 0 -0.25" rgba="0.1 0.1 0.1 1" group="0"/>
    </body>
    <body name="laser_spot" mocap="true" pos="0 0 -0.5">
      <geom type="cylinder" size="0.004 0.0004" material="spot" rgba="1 0 0 1" group="2"/>
    </body>
    <body name="target_2" mocap="true" pos="0 0 -2">
      <geom type="sphere" size="0.02" material="glow_2" rgba="1 1 0.95 1" group="0"/>
    </body>
    <body name="occluder" mocap="true" pos="0 0 -2">
      <geom type="box" size="0.05 0.05 0.004" rgba="0.2 0.2 0.2 1" group="0"/>
    </body>
    <body name="person" mocap="true" pos="0 0 -2">
      <geom type="ellipsoid" size="0.045 0.035 0.014" rgba="0.85 0.62 0.52 1" group="0"/>
      <geom type="capsule" size="0.007" fromto="-0.04 0 0 -0.095 0.005 -0.035" rgba="0.85 0.62 0.52 1" group="0"/>
      <geom type="capsule" size="0.007" fromto="-0.04 0.02 0 -0.085 0.03 -0.035" rgba="0.85 0.62 0.52 1" group="0"/>
      <geom type="capsule" size="0.008" fromto="-0.01 -0.03 0 -0.07 -0.03 -0.03" rgba="0.85 0.62 0.52 1" group="0"/>
      <geom type="capsule" size="0.028" fromto="0.05 0 0.005 0.40 0 0.12" rgba="0.25 0.35 0.55 1" group="0"/>
    </body>
)";

struct Servo { double stiffness, damping, torque, low, high; };
constexpr Servo kServos[6] = {{16000, 500, 97.6, -2.792526803, 2.792526803}, {24000, 700, 186.4, -0.7853981634, 3.926990817},
                              {8000, 180, 89.4, -3.926990817, 0.7853981634}, {1600, 34, 24.2, -1.919862177, 2.967059728},
                              {1200, 30, 20.1, -1.745329252, 1.745329252}, {1000, 28, 21.3, -4.64257581, 4.64257581}};

class Text {
public:
    Text& operator<<(const char* text) { return out_ += text, *this; }
    template <class... Args> Text& put(const char* format, Args... args) {
        char line[400];
        std::snprintf(line, sizeof line, format, args...);
        return *this << line;
    }
    std::string take() { return std::move(out_); }

private:
    std::string out_;
};

std::string numbered(std::string text, int number) {
    for (char& c : text)
        if (c == '#') c = char('0' + number);
    return text;
}

void putHand(Text& out) {
    for (int i = 0; i < 3; ++i) {
        const double angle = M_PI / 3 + i * 2 * M_PI / 3, half = (angle + M_PI) / 2;      // a finger bends towards the axis
        out.put("<body name=\"f%d_base\" pos=\"%.6f %.6f 0.05\" quat=\"%.9f 0 0 %.9f\">", i + 1, 0.04 * std::cos(angle),
                0.04 * std::sin(angle), std::cos(half), std::sin(half));
        out << numbered(kFinger, i + 1).c_str() << "</body>\n";
    }
}

void putToken(Text& out, const char* colour, int number, double x, double y) {
    const bool red = colour[0] == 'r';
    out.put("    <body name=\"%s_%d\" pos=\"%.4f %.4f 0.0042\"><freejoint/><inertial pos=\"0 0 0\" mass=\"0.004\" diaginertia=\"2.5e-7 2.5e-7 4.5e-7\"/>",
            colour, number, x, y);
    out.put("<geom class=\"token\" type=\"cylinder\" size=\"0.015 0.004\" rgba=\"%s 1\"/>", red ? "0.80 0.06 0.04" : "0.95 0.80 0.05");
    out << "<geom class=\"foot\" pos=\"0.0108 0 0\"/><geom class=\"foot\" pos=\"-0.0054 0.00935 0\"/>"
           "<geom class=\"foot\" pos=\"-0.0054 -0.00935 0\"/></body>\n";
}

// Plate, dark squares, and the violet markers beyond the robot's edge: A, the larger one, at negative y.
void putBoard(Text& out, int n, double field, double centre) {
    out.put("    <body name=\"board\" pos=\"%.4f 0 0\">\n", centre);
    out << R"(      <inertial pos="0 0 0" mass="0.8" diaginertia="0.01 0.01 0.02"/>
      <joint name="board_x" type="slide" axis="1 0 0" damping="20" frictionloss="4"/>
      <joint name="board_y" type="slide" axis="0 1 0" damping="20" frictionloss="4"/>
      <joint name="board_yaw" type="hinge" axis="0 0 1" damping="2" frictionloss="0.5"/>
)";
    const double edge = n * field / 2 + 0.012;
    out.put("      <geom type=\"box\" size=\"%.4f %.4f 0.0003\" pos=\"0 0 0.0001\" rgba=\"0.93 0.90 0.80 1\"/>\n", edge, edge);
    for (int rank = 1; rank <= n; ++rank)
        for (int file = 1; file <= n; ++file)
            if ((file + rank) % 2 == 0)
                out.put("      <geom type=\"box\" size=\"%.4f %.4f 0.0003\" pos=\"%.4f %.4f 0.0004\" rgba=\"0.25 0.42 0.25 1\"/>\n", field / 2,
                        field / 2, (n / 2.0 - rank + 0.5) * field, (file - 0.5 - n / 2.0) * field);
    const double x = -n * field / 2 - 0.026, y = n * field / 2 - 0.02;
    out.put("      <geom name=\"marker_a\" type=\"cylinder\" size=\"0.013 0.0005\" pos=\"%.4f %.4f 0.0005\" rgba=\"0.50 0.05 0.75 1\"/>\n", x, -y);
    out.put("      <geom name=\"marker_b\" type=\"cylinder\" size=\"0.009 0.0005\" pos=\"%.4f %.4f 0.0005\" rgba=\"0.50 0.05 0.75 1\"/>\n", x, y);
    out << "    </body>\n";
}

// The opening position, and two spare tokens of each colour beside the board.
void putTokens(Text& out, int n, double field, double centre) {
    const int rows = n / 2 - 1;
    auto put = [&](const char* colour, int& number, double file, int rank) {
        putToken(out, colour, ++number, centre + (n / 2.0 - rank + 0.5) * field, (file - 0.5 - n / 2.0) * field);
    };
    int red = 0, yellow = 0;
    for (int rank = n; rank > n - rows; --rank)
        for (int file = 1; file <= n; ++file)
            if ((file + rank) % 2 == 0) put("red", red, file, rank);
    for (int i = 0; i < 2; ++i) put("red", red, n + 1.4, n - 2 * i);
    for (int rank = 1; rank <= rows; ++rank)
        for (int file = 1; file <= n; ++file)
            if ((file + rank) % 2 == 0) put("yellow", yellow, file, rank);
    for (int i = 0; i < 2; ++i) put("yellow", yellow, n + 1.4, 1 + 2 * i);
}

}  // namespace

std::string sceneText(int fields) {
    Text out;
    const int tokens = fields == 0 ? 0 : (fields / 2 - 1) * fields + 4;
    const double field = fields == 8 ? 0.045 : 0.040, centre = 0.56;
    out << "<mujoco model=\"lab\">" << kSettings;
    out.put("  <size nconmax=\"%d\" njmax=\"%d\"/>\n", 60 + 6 * tokens, 220 + 20 * tokens);
    out << "  <worldbody>" << kRoom << kArm;
    putHand(out);
    for (int i = 0; i < 8; ++i) out << "</body>";       // hand, six links, base
    out << "\n";
    if (fields > 0) {
        putBoard(out, fields, field, centre);
        putTokens(out, fields, field, centre);
    }
    out << kMoved << "  </worldbody>\n  <equality>\n";
    for (int i = 1; i <= 3; ++i) out.put("    <joint joint1=\"f%d_df\" joint2=\"f%d_mf\" polycoef=\"0 1 0 0 0\"/>\n", i, i);
    out << "  </equality>\n  <actuator>\n";
    for (int i = 0; i < 6; ++i) {
        const Servo& s = kServos[i];
        out.put("    <general name=\"servo_%d\" joint=\"joint_%d\" biastype=\"affine\" gainprm=\"%g\" biasprm=\"0 %g %g\" forcelimited=\"true\" "
                "forcerange=\"%g %g\" ctrllimited=\"true\" ctrlrange=\"%.10g %.10g\"/>\n",
                i + 1, i + 1, s.stiffness, -s.stiffness, -s.damping, -s.torque, s.torque, s.low, s.high);
    }
    for (int i = 1; i <= 3; ++i)
        for (const char* joint : {"ab", "pf", "mf"})
            out.put("    <general name=\"m%d_%s\" class=\"finger\" joint=\"f%d_%s\"/>\n", i, joint, i, joint);
    out << "  </actuator>\n  <sensor>\n    <force name=\"wrist_force\" site=\"fts\"/>\n    <torque name=\"wrist_torque\" site=\"fts\"/>\n";
    for (int i = 1; i <= 3; ++i) out.put("    <touch name=\"touch_%d\" site=\"f%d_tip\"/>\n", i, i);
    out << "  </sensor>\n</mujoco>\n";
    return out.take();
}

}  // namespace simlab
