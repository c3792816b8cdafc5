#pragma once

#include <Eigen/Dense>
#include <string>

#include "host_tools/forward/options.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// The part of a log's torque that moves the simulated robot [N*m | N], samples x joints, unfiltered, at the times of
/// the motion. Effects that simulate forward leaves out (forward_plant()) are subtracted along the recorded motion.
Eigen::MatrixXd driving_torque(const IdentifiedModel& model, const ProcessedLog& log);

/// A recorded torque played through the model.
struct ForwardRun {
  Eigen::MatrixXd q;       ///< samples x joints [rad | m]; the samples that are given are the measured ones
  Eigen::VectorXd rmse;    ///< per joint, of q - measured, over the samples that are not given [rad | m]
  std::string why_failed;  ///< empty: it did not; else q and rmse are empty
};

/// Positions from torques: samples 0 .. given - 1 of a log are known, the rest is simulated.
struct Forward {
  ForwardRun open;    ///< the recorded torque alone: q integrates every error twice
  ForwardRun closed;  ///< with a PD that follows the recorded motion (ClosedLoopSettings)
};

enum class Loop { open, closed };

/// A stretch of a log, [from, to), played through the model.
/// @param raw the log as it was read, with torque
/// @param log the same log, processed with the model's filter
/// @return positions at the samples of the stretch; of its first `given`, at least 3, the measured ones [rad | m]
/// @throws DataError: the model is no plant, or the motion runs away
Eigen::MatrixXd simulated_positions(const IdentifiedModel& model, const Log& raw, const ProcessedLog& log,
                                    Eigen::Index from, Eigen::Index to, Eigen::Index given, Loop loop);

/// Both runs start in the state that a parabola through the measured positions of the given samples has at the last of
/// them: q, dq, ddq by least squares. Nothing later is used in open loop.
/// @param raw the log as it was read, with torque
/// @param log the same log, processed with the model's filter
/// @param given at least 3 and fewer than the log's samples
/// @throws InputError: too few samples; a torque that stands still while its joint moves; the model explains none of
/// the torque, so it is another robot's.
Forward simulate_forward(const IdentifiedModel& model, const Log& raw, const ProcessedLog& log, Eigen::Index given,
                         const ForwardOptions& options = {});

}  // namespace fxdyn
