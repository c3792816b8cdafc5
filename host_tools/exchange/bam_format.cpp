#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

// BAM (Rhoban, "Better Actuator Models"; Duclusaud, Passault et al. 2024, arXiv 2410.08650), bam/model.py:
//   |friction| = friction_base + friction_stribeck exp(-|dq / dtheta_stribeck|^alpha) + friction_viscous |dq|
// m1 has no Stribeck term, m2 has one. m3 to m6 let friction grow with |external - motor torque|, which is not the load
// of our load_friction: they are not written.

namespace fxdyn {
namespace {

/// The exponent of our Stribeck effect (model/effects/stribeck.hpp).
constexpr double stribeck_alpha = 2;

nlohmann::ordered_json entry_of(const SimpleJoint& said) {
  nlohmann::ordered_json out = {{"model", said.stribeck > 0 ? "m2" : "m1"},
                                {"armature", said.armature},
                                {"friction_base", said.friction},
                                {"friction_viscous", said.damping}};
  if (said.stribeck > 0) {
    out["friction_stribeck"] = said.stribeck;
    out["dtheta_stribeck"] = said.stribeck_velocity;
    out["alpha"] = stribeck_alpha;
  }
  return out;
}

SimpleJoint read_entry(const nlohmann::json& entry, const std::string& joint, const std::filesystem::path& file) {
  const auto number = [&](const char* key) { return number_of(entry, key, file); };
  SimpleJoint out{number("friction_viscous"), number("friction_base"), number("armature"), 0};
  const std::string model = entry.value("model", "");
  if (model == "m1") return out;
  if (model != "m2" || number("alpha") != stribeck_alpha)
    throw DataError(fmt::format("{}: joint '{}' is no m1, and no m2 with alpha = 2", file.string(), joint));
  out.stribeck = number("friction_stribeck");
  out.stribeck_velocity = number("dtheta_stribeck");
  return out;
}

}  // namespace

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
  for (const Joint& joint : expected.robot.joints) {
    if (!all.is_object() || !all.contains(joint.name) || !all.at(joint.name).is_object())
      throw DataError(fmt::format("{}: has no joint '{}'", file.string(), joint.name));
    said.push_back(read_entry(all.at(joint.name), joint.name, file));
  }
  return replay_joints(file, std::move(said), expected, motion, step_s);
}

}  // namespace fxdyn
