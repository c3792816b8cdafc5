#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"

namespace fxdyn {

/// Thresholds of a judgement. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct JudgementOptions {
  /// times; the improvement that is asked for where the blocks are of one log and resemble the fit's data; hand
  double of_one_log = 4;
  /// share of the blocks; on how many it has to be better, of one log on all; hand
  double better_blocks = 0.75;
  /// share of the coefficient of the effect that it replaces; much less of it is something else; hand
  double least_of_replaced = 0.5;
};

/// How one joint did on the rows that judge.
struct Judgement {
  double rmse = 1e300;         ///< of the residual over all judging blocks [N*m | N]
  std::vector<double> blocks;  ///< RMSE of each judging block
  bool physical = true;        ///< the effect that was added last keeps its bounds in every fold
  double coefficient_sum = 0;  ///< sum of |c| of the BLS, most of any fold [N*m | N]

  bool blocks_of_one_log =
      false;  ///< the blocks resemble the fit's data: four times the improvement is asked for, on every block

  /// Better by `worth` over all, better at all on three blocks in four, and physical.
  bool beats(const Judgement& other, double worth, const JudgementOptions& options = {}) const;
};

/// Whether the linear parameters of the last effect keep their bounds. Only those: viscous friction that is zero in
/// truth comes out a little negative, and that must not keep another effect out. (With a BLS beside it, one coefficient
/// means nothing.)
bool last_is_physical(const JointFit& design, const Eigen::VectorXd& theta, const JudgementOptions& options = {});

}  // namespace fxdyn
