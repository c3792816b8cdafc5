#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

// BAM (Rhoban, "Better Actuator Models"; Duclusaud, Passault et al. 2024, arXiv 2410.08650), bam/model.py:
//   |friction| = friction_base + friction_stribeck exp(-|dq / dtheta_stribeck|^alpha) + friction_viscous |dq|
// m1 has no Stribeck term, m2 has one. m3 (without a Stribeck term) to m6 have GearFriction besides (simple_robot.hpp).

namespace fxdyn {
namespace {

using ordered_json = nlohmann::ordered_json;

/// The exponent of our Stribeck effect (model/effects/stribeck.hpp).
constexpr double stribeck_alpha = 2;

/// Of a bell that nothing is multiplied with: BAM divides by it [rad/s].
constexpr double no_stribeck_velocity = 1;

/// 1 .. 6
int model_of(const SimpleJoint& said) {
  if (said.load.model > 0) return said.load.model;
  return said.stribeck > 0 ? 2 : 1;
}

bool has_stribeck(int model) { return model != 1 && model != 3; }

void add_load(const GearFriction& load, ordered_json& out) {
  if (load.model < 5) {
    out["load_friction_base"] = load.motor;
    if (load.model == 4) out["load_friction_stribeck"] = load.motor_stribeck;
    return;
  }
  out["load_friction_motor"] = load.motor;
  out["load_friction_external"] = load.external;
  out["load_friction_motor_stribeck"] = load.motor_stribeck;
  out["load_friction_external_stribeck"] = load.external_stribeck;
  if (load.model < 6) return;
  out["load_friction_motor_quad"] = load.motor_quad;
  out["load_friction_external_quad"] = load.external_quad;
}

ordered_json entry_of(const SimpleJoint& said) {
  const int model = model_of(said);
  ordered_json out = {{"model", bam_model(said)},
                      {"armature", said.armature},
                      {"friction_base", said.friction},
                      {"friction_viscous", said.damping}};
  if (has_stribeck(model)) {
    out["friction_stribeck"] = said.stribeck;
    out["dtheta_stribeck"] = said.stribeck_velocity > 0 ? said.stribeck_velocity : no_stribeck_velocity;
    out["alpha"] = stribeck_alpha;
  }
  if (model > 2) add_load(said.load, out);
  return out;
}

SimpleJoint read_entry(const nlohmann::json& entry, const std::string& joint, const std::filesystem::path& file) {
  const auto number = [&](const char* key) { return number_of(entry, key, file); };
  SimpleJoint out{number("friction_viscous"), number("friction_base"), number("armature"), 0};
  const std::string name = entry.value("model", "");
  const int model = name.size() == 2 && name[0] == 'm' ? name[1] - '0' : 0;
  if (model < 1 || model > 6 || (has_stribeck(model) && number("alpha") != stribeck_alpha))
    throw DataError(fmt::format("{}: joint '{}' is none of m1 to m6 with alpha = 2", file.string(), joint));
  if (has_stribeck(model)) {
    out.stribeck = number("friction_stribeck");
    out.stribeck_velocity = number("dtheta_stribeck");
  }
  if (model < 3) return out;
  out.load.model = model;
  if (model < 5) {
    out.load.motor = out.load.external = number("load_friction_base");
    if (model == 4) out.load.motor_stribeck = out.load.external_stribeck = number("load_friction_stribeck");
    return out;
  }
  out.load.motor = number("load_friction_motor");
  out.load.external = number("load_friction_external");
  out.load.motor_stribeck = number("load_friction_motor_stribeck");
  out.load.external_stribeck = number("load_friction_external_stribeck");
  if (model < 6) return out;
  out.load.motor_quad = number("load_friction_motor_quad");
  out.load.external_quad = number("load_friction_external_quad");
  return out;
}

}  // namespace

std::string bam_model(const SimpleJoint& said) { return fmt::format("m{}", model_of(said)); }

void write_bam(const SimpleRobot& robot, const std::filesystem::path& file) {
  write_bodies(robot, file);
  nlohmann::ordered_json all = nlohmann::ordered_json::object();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) all[robot.robot.joints[j].name] = entry_of(robot.joints[j]);
  write_file(file, all.dump(1) + "\n");
}

ReplayedTorque replay_bam(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s) {
  const nlohmann::json all = nlohmann::json::parse(read_file(file), nullptr, false);
  std::vector<SimpleJoint> said;
  for (const Joint& joint : robot_of(expected).joints) {
    if (!all.is_object() || !all.contains(joint.name) || !all.at(joint.name).is_object())
      throw DataError(fmt::format("{}: has no joint '{}'", file.string(), joint.name));
    said.push_back(read_entry(all.at(joint.name), joint.name, file));
  }
  return replay_joints(file, std::move(said), expected, motion, step_s);
}

}  // namespace fxdyn
