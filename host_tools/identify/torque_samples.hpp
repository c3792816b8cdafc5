#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Some hundred samples of the train logs, filtered, for fits that have to be quick: samples x joints.
struct TorqueSamples {
  Eigen::MatrixXd q, dq, ddq, tau;
  double independent = 0;  ///< samples of noise below the torque's cut-off: 2 f T, over all train logs
  std::vector<std::vector<Eigen::Index>> at{};  ///< per log: which of its samples these are, one log after the other
  Eigen::Index size() const { return tau.rows(); }
};

/// About `wanted` of them, spread over the motion. Not at even distances: those may keep step with a motion that
/// repeats itself, and all samples would show one pose. Torques are those of `lead_s` before the motion [s].
TorqueSamples sample_torque(std::span<const ProcessedLog> logs, Eigen::Index wanted, double lead_s = 0);

}  // namespace fxdyn
