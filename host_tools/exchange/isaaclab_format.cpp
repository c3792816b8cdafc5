#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/exchange/posterior.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

// Names of the configurations: Isaac Lab, isaaclab/actuators/actuator_base_cfg.py (ActuatorBaseCfg; dynamic and viscous
// friction since 2.2); mjlab, mjlab/actuator/actuator.py (ActuatorCfg) and pd_actuator.py (IdealPdActuatorCfg).

namespace fxdyn {
namespace {

using nlohmann::ordered_json;

constexpr const char* head = R"(# Written by fxdyn: the joints of '{robot}', for Isaac Lab and mjlab.
# Links and masses: {bodies}, beside this file. Its joints have no friction: this file has it.
#
# All numbers are at the output of the gear, in radians: torque = ARMATURE ddq + VISCOUS_FRICTION dq + FRICTION sign(dq).
# Sliding joints: N, m and kg in place of N*m, rad and kg*m^2. Nothing here is per degree.
import math
import random as _random
import re

)";

constexpr const char* tail = R"(

def _cholesky(matrix):
    size = len(matrix)
    lower = [[0.0] * size for _ in range(size)]
    for i in range(size):
        for k in range(i + 1):
            rest = matrix[i][k] - sum(lower[i][m] * lower[k][m] for m in range(k))
            if i == k:
                lower[i][i] = math.sqrt(max(rest, 0.0))
            elif lower[k][k] > 0:
                lower[i][k] = rest / lower[k][k]
    return lower


def nominal(joint):
    """The numbers of a joint as they were identified."""
    return {{"armature": ARMATURE[joint], "friction": FRICTION[joint], "viscous_friction": VISCOUS_FRICTION[joint]}}


def draw(joint, random=_random):
    """Numbers of a joint that the logs allow, with their correlations: uniform in the ellipsoid that holds the true
    ones with a probability of 90 %. None is negative. The means are those of the friction alone: FRICTION and
    VISCOUS_FRICTION also take what they can of effects that no joint has. `random`: a random.Random, for a seed."""
    numbers, known = nominal(joint), RANGES[joint]
    size = len(known["parameters"])
    if size == 0:
        return numbers
    direction = [random.gauss(0.0, 1.0) for _ in range(size)]
    radius = known["radius"] * random.random() ** (1.0 / size) / math.sqrt(sum(z * z for z in direction))
    lower = _cholesky(known["correlation"])
    for i, name in enumerate(known["parameters"]):
        step = known["std"][i] * radius * sum(lower[i][k] * direction[k] for k in range(i + 1))
        numbers[name] = max(0.0, known["mean"][i] + step)
    return numbers


def isaaclab_actuators(numbers=None, stiffness=0.0, damping=0.0):
    """`actuators` of an ArticulationCfg, one a joint. stiffness and damping are gains of your controller.
    numbers: {{joint: draw(joint)}}; None: as identified. PhysX holds a joint by `friction` and brakes it by
    `dynamic_friction`: the identified number is that of sliding, and stands for both."""
    from isaaclab.actuators import IdealPDActuatorCfg

    actuators = {{}}
    for joint in JOINTS:
        known = numbers[joint] if numbers else nominal(joint)
        actuators[joint] = IdealPDActuatorCfg(
            joint_names_expr=[re.escape(joint)],
            effort_limit=EFFORT_LIMIT.get(joint),
            velocity_limit=VELOCITY_LIMIT.get(joint),
            stiffness=stiffness,
            damping=damping,
            armature=known["armature"],
            friction=known["friction"],
            dynamic_friction=known["friction"],
            viscous_friction=known["viscous_friction"],
        )
    return actuators


def mjlab_actuators(numbers=None, stiffness=0.0, damping=0.0):
    """`actuators` of an EntityArticulationInfoCfg, one a joint; arguments as above."""
    from mjlab.actuator import IdealPdActuatorCfg

    actuators = []
    for joint in JOINTS:
        known = numbers[joint] if numbers else nominal(joint)
        actuators.append(
            IdealPdActuatorCfg(
                target_names_expr=(re.escape(joint),),
                stiffness=stiffness,
                damping=damping,
                effort_limit=EFFORT_LIMIT.get(joint, math.inf),
                velocity_limit=VELOCITY_LIMIT.get(joint),
                armature=known["armature"],
                frictionloss=known["friction"],
                viscous_damping=known["viscous_friction"],
            )
        )
    return tuple(actuators)
)";

/// Mean, standard deviations and correlations of the numbers that are not certain.
ordered_json range_of(const JointRange& range) {
  const std::array<const char*, 3> names{"viscous_friction", "friction", "armature"};
  const Eigen::Matrix3d& covariance = range.covariance;
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (covariance(k, k) > 0) open.push_back(i);
  }
  ordered_json out = {{"parameters", ordered_json::array()},
                      {"mean", ordered_json::array()},
                      {"std", ordered_json::array()},
                      {"correlation", ordered_json::array()},
                      {"radius", std::sqrt(squared_radius_90(open.size(), range.freedom))}};
  for (const std::size_t i : open) {
    const auto a = static_cast<Eigen::Index>(i);
    ordered_json row = ordered_json::array();
    for (const std::size_t k : open) {
      const auto b = static_cast<Eigen::Index>(k);
      row.push_back(a == b ? 1.0 : covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b)));
    }
    out["parameters"].push_back(names[i]);
    out["mean"].push_back(range.mean[a]);
    out["std"].push_back(std::sqrt(covariance(a, a)));
    out["correlation"].push_back(row);
  }
  return out;
}

/// NAME = {..}: JSON on one line, which is Python too.
std::string assignment(const char* name, const char* comment, const ordered_json& value) {
  return fmt::format("{} = {}  # {}\n", name, value.dump(), comment);
}

/// @throws DataError: no such line, or no table in it
nlohmann::json table_of(const std::string& text, const std::string& name, const std::filesystem::path& file) {
  const std::string start = "\n" + name + " = ";
  const std::size_t from = text.find(start);
  const std::size_t to = text.find("  # ", from == std::string::npos ? 0 : from);
  if (from == std::string::npos || to == std::string::npos)
    throw DataError(fmt::format("{}: has no line '{} = ..'", file.string(), name));
  const auto table = nlohmann::json::parse(text.substr(from + start.size(), to - from - start.size()), nullptr, false);
  if (table.is_discarded()) throw DataError(fmt::format("{}: {} is no table", file.string(), name));
  return table;
}

}  // namespace

void write_isaaclab(const SimpleRobot& robot, const std::filesystem::path& file) {
  ordered_json names = ordered_json::array(), effort = ordered_json::object(), velocity = effort, armature = effort,
               friction = effort, viscous = effort, ranges = effort;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.robot.joints[j];
    const SimpleJoint& said = robot.joints[j];
    if (joint.name.find_first_of("\r\n") != std::string::npos || joint.name.find("  # ") != std::string::npos)
      throw InputError(
          fmt::format("{}: joint '{}' has a name that no line of Python holds: rename it, then export again",
                      robot.urdf.string(), joint.name));
    names.push_back(joint.name);
    if (said.effort > 0) effort[joint.name] = said.effort;
    if (joint.limits && joint.limits->velocity > 0) velocity[joint.name] = joint.limits->velocity;
    armature[joint.name] = said.armature;
    friction[joint.name] = said.friction;
    viscous[joint.name] = said.damping;
    ranges[joint.name] = range_of(robot.ranges.empty() ? JointRange{} : robot.ranges.at(j));
  }
  write_bodies(robot, file);
  const std::string bodies = bodies_of(file).filename().string();
  std::string text = fmt::format(head, fmt::arg("robot", robot.robot.name), fmt::arg("bodies", bodies));
  text += assignment("JOINTS", "in the order of the chain", names) +
          assignment("EFFORT_LIMIT", "of the drive [N*m]", effort) +
          assignment("VELOCITY_LIMIT", "of the URDF [rad/s]", velocity) +
          assignment("ARMATURE", "rotor and gears [kg*m^2]", armature) +
          assignment("FRICTION", "dry friction [N*m]", friction) +
          assignment("VISCOUS_FRICTION", "[N*m*s/rad]", viscous) +
          assignment("RANGES", "of friction alone: what the logs leave open; radius: 90 %, of Student's t", ranges);
  write_file(file, text + fmt::format(tail));
}

ReplayedTorque replay_isaaclab(const std::filesystem::path& file, const IdentifiedModel& expected,
                               const MotionRows& motion, double step_s) {
  const std::string text = read_file(file);
  const nlohmann::json armature = table_of(text, "ARMATURE", file), friction = table_of(text, "FRICTION", file),
                       viscous = table_of(text, "VISCOUS_FRICTION", file);
  std::vector<SimpleJoint> said;
  for (const Joint& joint : robot_of(expected).joints) {
    said.push_back({number_of(viscous, joint.name, file), number_of(friction, joint.name, file),
                    number_of(armature, joint.name, file), 0});
  }
  return replay_joints(file, std::move(said), expected, motion, step_s);
}

}  // namespace fxdyn
