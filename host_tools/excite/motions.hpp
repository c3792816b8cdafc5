#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/excite/limits.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// A rest-to-rest move along the straight line of joint space, s = 10 u^3 - 15 u^4 + 6 u^5, sampled with dwells:
/// dwell, move, dwell, .. dwell. Ends with the last instant at rest.
Motion dwell_and_move(const Eigen::MatrixXd& poses, const std::vector<double>& moves_s, double dwell_s, double step_s);

/// `periods` of the series, the last instant included.
Motion play(const std::vector<FourierJoint>& series, double period_s, int periods, double step_s);

/// One instant at rest.
Motion one_pose(const Eigen::VectorXd& q);

/// The motion of a robot that moves freely: random states, uniform within +-pi (sliding joints: +-0.5 m) and within the
/// velocity and acceleration limits.
Motion free_motion(const Robot& robot, const MotionLimits& limits);

}  // namespace fxdyn
