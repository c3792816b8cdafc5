#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/excite/limits.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// Step at which moves between poses are searched; every move takes whole steps [s].
inline constexpr double coarse_step_s = 0.1;

/// A static trajectory: from pose to pose at half of the velocity and acceleration limits, with a dwell of one second
/// at each.
struct PoseWalk {
  std::vector<Eigen::VectorXd> poses;  ///< [rad | m]
  std::vector<double> moves_s;         ///< between them
  static constexpr double dwell_s = 1;

  /// Poses x joints.
  Eigen::MatrixXd matrix() const;
  Motion motion(double step_s) const;
  /// One pose more, if the move to it keeps torque limits and box with `extra` margin; whether it is there now.
  bool extend(const Eigen::VectorXd& pose, const LimitCheck& check, double extra);
};

/// Duration of a move at which its quintic, with peaks of 1.875 d / T and 5.7735 d / T^2, keeps half of the velocity
/// and acceleration limits; whole coarse steps.
double move_duration(const Eigen::VectorXd& from, const Eigen::VectorXd& to, const LimitCheck& check);

}  // namespace fxdyn
