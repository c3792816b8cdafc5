#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <numbers>
#include <set>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

// Names and units: Omniverse Physics, "Physx Joint Schema" (PhysxJointAxisAPI; its parser multiplies the viscous
// coefficient of an angular axis by 180/pi and takes its maxJointVelocity in degrees) and UsdPhysics (PhysicsDriveAPI:
// stiffness and damping of an angular drive are per degree).

namespace fxdyn {
namespace {

constexpr double degrees_per_radian = 180 / std::numbers::pi;

/// How many of USD's units of position one of ours is.
double units_of(const Joint& joint) { return joint.type == JointType::revolute ? degrees_per_radian : 1; }
const char* axis_of(const Joint& joint) { return joint.type == JointType::revolute ? "angular" : "linear"; }

/// As the URDF importer names prims: whatever is no letter or digit becomes an underscore.
std::string prim_name(const std::string& name) {
  std::string out;
  for (const char c : name) out += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return out.empty() || std::isdigit(static_cast<unsigned char>(out[0])) != 0 ? "_" + out : out;
}

std::string attribute(const Joint& joint, const char* schema, const char* name, double value) {
  return fmt::format("            float {}:{}:{} = {:.17g}\n", schema, axis_of(joint), name, value);
}

std::string joint_over(const Joint& joint, const SimpleJoint& said) {
  constexpr const char* friction = "physxJointAxis";
  const double units = units_of(joint);
  std::string out = fmt::format(
      "        over \"{0}\" (\n            prepend apiSchemas = [\"PhysxJointAxisAPI:{1}\", \"PhysicsDriveAPI:{1}\"]\n"
      "        )\n        {{\n",
      prim_name(joint.name), axis_of(joint));
  out += attribute(joint, friction, "armature", said.armature) +
         attribute(joint, friction, "staticFrictionEffort", said.friction) +
         attribute(joint, friction, "dynamicFrictionEffort", said.friction) +
         attribute(joint, friction, "viscousFrictionCoefficient", said.damping / units);
  if (joint.limits && joint.limits->velocity > 0)
    out += attribute(joint, friction, "maxJointVelocity", joint.limits->velocity * units);
  out += attribute(joint, "drive", "physics:stiffness", 0) + attribute(joint, "drive", "physics:damping", 0);
  if (said.effort > 0) out += attribute(joint, "drive", "physics:maxForce", said.effort);
  return out + "        }\n";
}

/// @throws InputError: two names that are one in USD
void check_prim_names(const SimpleRobot& robot) {
  std::set<std::string> taken;
  for (const Joint& joint : robot.robot.joints) {
    if (taken.insert(prim_name(joint.name)).second) continue;
    throw InputError(
        fmt::format("{}: USD knows joint '{}' by the name '{}', which another joint has too: rename it, "
                    "then export again",
                    robot.urdf.string(), joint.name, prim_name(joint.name)));
  }
}

/// A number in the block of one joint.
double read_attribute(const std::string& text, const Joint& joint, const char* name,
                      const std::filesystem::path& file) {
  const std::string start = fmt::format("over \"{}\" (", prim_name(joint.name));
  const std::string before = fmt::format("float physxJointAxis:{}:{} = ", axis_of(joint), name);
  const std::size_t block = text.find(start), end = block == std::string::npos ? block : text.find('}', block);
  const std::size_t at = block == std::string::npos ? block : text.find(before, block);
  if (at == std::string::npos || at > end)
    throw DataError(fmt::format("{}: joint '{}' has no {}", file.string(), joint.name, name));
  try {
    return std::stod(text.substr(at + before.size(), 40));
  } catch (const std::logic_error&) {
    throw DataError(fmt::format("{}: {} of joint '{}' is no number", file.string(), name, joint.name));
  }
}

}  // namespace

void write_usd(const SimpleRobot& robot, const std::filesystem::path& file) {
  check_prim_names(robot);
  write_bodies(robot, file);
  const std::string name = prim_name(robot.robot.name);
  std::string text = fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"{0}\"\n    doc = \"\"\"Written by fxdyn. Put this layer over the robot that "
      "was "
      "imported from {1}.\nJoints at the output of the gear: friction in N m, armature in kg m^2, the viscous "
      "coefficient "
      "in N m s per degree,\nvelocity in degrees per second (sliding joints: N, kg, N s/m, m/s). The drives' gains are "
      "zero: a controller sends torque.\"\"\"\n)\n\nover \"{0}\"\n{{\n    over \"joints\"\n    {{\n",
      name, bodies_of(file).filename().string());
  for (std::size_t j = 0; j < robot.joints.size(); ++j) text += joint_over(robot.robot.joints[j], robot.joints[j]);
  write_file(file, text + "    }\n}\n");
}

ReplayedTorque replay_usd(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s) {
  const std::string text = read_file(file);
  std::vector<SimpleJoint> said;
  for (const Joint& joint : robot_of(expected).joints) {
    const auto number = [&](const char* name) { return read_attribute(text, joint, name, file); };
    said.push_back({number("viscousFrictionCoefficient") * units_of(joint), number("dynamicFrictionEffort"),
                    number("armature"), 0});
  }
  return replay_joints(file, std::move(said), expected, motion, step_s);
}

}  // namespace fxdyn
