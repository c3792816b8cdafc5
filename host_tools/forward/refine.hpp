#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/forward/forward.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// A log as it was read, and processed with the model's filter.
struct ForwardLog {
  Log raw;
  ProcessedLog processed;
};

/// A coefficient that refine() may move.
struct RefinedParameter {
  std::string name;  ///< "m1", or "joint_1: coulomb amplitude"
  std::string unit;  ///< of an effect's
  double before = 0, after = 0;
};

/// A weight of the torque that was tried.
struct TriedWeight {
  double weight = 0;
  /// Position's RMSE over that of the fit by torque, on the gate data: geometric mean over the joints and the parts.
  /// Infinite: the motion ran away.
  double held_out = 0;
};

struct Refinement {
  IdentifiedModel model;
  Loop loop = Loop::open;
  std::string why_closed;  ///< empty: open loop
  bool kept = false;       ///< false: no weight beat the fit by torque, and `model` is that
  double weight = 0;       ///< of the torque
  std::vector<TriedWeight> tried;
  std::vector<RefinedParameter> parameters;
  Eigen::VectorXd before, after;  ///< per joint, RMSE of the position over the train logs [rad | m]
};

/// Base parameters and the effects' coefficients such that simulated positions fit the train logs; shapes, a BLS and
/// what simulation leaves out (forward_plant()) stay. Minimised from the model's values on is
///   sum of (q - measured)^2 / s^2 + weight sum of (torque - measured)^2 / r^2,
/// means over the samples, summed over the joints, s and r the model's own RMSE: the torque holds what the positions
/// do not tell. Gauss-Newton with damping; sensitivities by finite differences. Positions are those of the open loop,
/// or of the closed one where a train log runs away in open loop.
///
/// The weight is the one that is best on the validate logs, without any on the other half of each train log; against a
/// fit by torque of the same part.
/// @param given samples of each log that are known
/// @throws InputError as simulate_forward()
Refinement refine(const IdentifiedModel& model, const std::vector<ForwardLog>& train,
                  const std::vector<ForwardLog>& validate, Eigen::Index given, Progress& progress);

}  // namespace fxdyn
