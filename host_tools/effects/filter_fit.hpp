#pragma once

#include <vector>

namespace fxdyn {

/// How a model's logs were filtered.
struct FilterFit {
  double position_cutoff_hz = 0, torque_cutoff_hz = 0, edge_s = 0;
  /// The logs' torque column is this far ahead of the motion: measured tau(t) = torque of the motion at t + lead. A
  /// drive that answers a command a while later has it, or signals that were sampled at different moments.
  double torque_lead_s = 0;
  // Why: see choose_filter().
  double excited_hz = 0;                             ///< holds 99.9 % of the velocities' energy, joints alike
  double crossing_hz = 0;                            ///< where the last joint's motion sinks into its noise
  std::vector<double> encoder_step, position_noise;  ///< per joint; no step found: 0; RMS of white noise [rad | m]
};

}  // namespace fxdyn
