#include "host_tools/pipeline/joint_trajectory.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// With a point and a sign in the exponent: a reader of YAML 1.1, as ROS has it, takes 0 for an integer and 1e-05 for
/// text.
std::string list_of(const Eigen::MatrixXd& values, Eigen::Index row) {
  std::string out;
  for (Eigen::Index j = 0; j < values.cols(); ++j) {
    if (!std::isfinite(values(row, j)))
      throw DataError(fmt::format("trajectory: sample {}, joint {}: no finite number", row + 1, j + 1));
    out += fmt::format("{}{:.16e}", j > 0 ? ", " : "", values(row, j));
  }
  return "[" + out + "]";
}

}  // namespace

std::string joint_trajectory(const Robot& robot, const Eigen::VectorXd& t, const MotionRows& motion,
                             const Eigen::MatrixXd& effort) {
  nlohmann::json names = nlohmann::json::array();
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  std::string out = fmt::format(
      "# Written by fxdyn: trajectory_msgs/JointTrajectory. effort is the model's torque for this motion [N m | N].\n"
      "joint_names: {}\npoints:\n",
      names.dump());
  for (Eigen::Index k = 0; k < t.size(); ++k) {
    constexpr std::int64_t second = 1'000'000'000;
    const auto nanoseconds = static_cast<std::int64_t>(std::llround((t[k] - t[0]) * static_cast<double>(second)));
    out += fmt::format(
        "  - positions: {}\n    velocities: {}\n    accelerations: {}\n    effort: {}\n"
        "    time_from_start: {{sec: {}, nanosec: {}}}\n",
        list_of(motion.q, k), list_of(motion.dq, k), list_of(motion.ddq, k), list_of(effort, k), nanoseconds / second,
        nanoseconds % second);
  }
  return out;
}

}  // namespace fxdyn
