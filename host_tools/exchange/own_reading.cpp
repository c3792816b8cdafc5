#include "host_tools/exchange/own_reading.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/load_friction.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

std::filesystem::path bodies_of(const std::filesystem::path& file) {
  return std::filesystem::path(file).replace_extension(".urdf");
}

void write_bodies(const SimpleRobot& robot, const std::filesystem::path& file) {
  SimpleRobot bodies = robot;
  bodies.joints.assign(robot.joints.size(), {});
  write_urdf_dynamics(bodies, bodies_of(file));
}

ReplayedTorque replay_joints(const std::filesystem::path& file, std::vector<SimpleJoint> said,
                             const IdentifiedModel& expected, const MotionRows& motion, double step_s) {
  const std::filesystem::path bodies = bodies_of(file);
  SimpleRobot found{read_urdf(bodies), std::move(said), {}};
  for (std::size_t j = 0; j < robot_of(expected).size(); ++j) {
    const std::string& name = robot_of(expected).joints[j].name;
    if (found.robot.size() != robot_of(expected).size() || found.robot.joints[j].name != name)
      throw DataError(fmt::format("{}: joint {} is not '{}'", bodies.string(), j + 1, name));
  }
  ReplayedTorque out;
  out.tau = torque_of(found, expected, motion, step_s);
  out.sliding = (motion.dq.array() != 0).cast<double>();
  return out;
}

double number_of(const nlohmann::json& table, const std::string& key, const std::filesystem::path& file) {
  if (!table.is_object() || !table.contains(key) || !table.at(key).is_number())
    throw DataError(fmt::format("{}: has no number for '{}'", file.string(), key));
  return table.at(key).get<double>();
}

}  // namespace fxdyn
