#pragma once

#include <Eigen/Dense>
#include <string>

#include "host_tools/robot/robot.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// A motion with its feedforward as trajectory_msgs/JointTrajectory in YAML, as `ros2 topic pub` takes it: positions,
/// velocities, accelerations and effort of every joint, at the output of the gear [rad, rad/s, rad/s^2, N*m | m, m/s,
/// m/s^2, N], in the chain's order. time_from_start counts from the first sample.
/// @param t [s], ascending @param effort samples x joints
/// @throws DataError: a number is not finite
std::string joint_trajectory(const Robot& robot, const Eigen::VectorXd& t, const MotionRows& motion,
                             const Eigen::MatrixXd& effort);

}  // namespace fxdyn
