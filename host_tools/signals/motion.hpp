#pragma once

#include <Eigen/Dense>
#include <string>
#include <utility>

namespace fxdyn {

/// Positions, velocities and accelerations, samples x joints [rad | m, and per s, per s^2]: what everything that moves
/// carries.
struct MotionRows {
  Eigen::MatrixXd q, dq, ddq;
};

/// A motion on a uniform time grid.
struct Motion : MotionRows {
  std::string name;
  double step_s = 0;
  Eigen::VectorXd t;  ///< [s]

  Motion() = default;
  Motion(std::string named, double step, Eigen::VectorXd times, Eigen::MatrixXd position, Eigen::MatrixXd velocity,
         Eigen::MatrixXd acceleration)
      : MotionRows{std::move(position), std::move(velocity), std::move(acceleration)},
        name(std::move(named)),
        step_s(step),
        t(std::move(times)) {}
};

}  // namespace fxdyn
