#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/page/class_means.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/report/shown_log.hpp"

namespace fxdyn {

/// The signal over which torque is drawn.
struct ShownSignal {
  std::string label;  ///< with unit, as in "velocity [rad/s]"
  std::string name;   ///< "velocity"
  Eigen::VectorXd x;  ///< NaN between two logs
};

/// What a finding's picture shows: the finding's own torque over the signal that tells most of it, and the data behind
/// it, joint side of the gearbox [N*m | N]. What is missing and has no name is drawn the same way, without a curve.
struct FindingPicture {
  std::size_t joint = 0;           ///< from 0; of a finding on the robot the joint that feels most of it
  std::string effect, parameters;  ///< names, and "amplitude 2.1 ± 0.05 N*m"; empty: unknown
  ShownSignal over;
  double explained = 0;           ///< share of the effect's torque (unknown: of what is left) that is a function of it
  Eigen::VectorXd without, with;  ///< residual of the model without the effect (not fitted again), and with it
  ClassMeans torque;              ///< of the effect alone: predicted with it minus without
  Eigen::VectorXd band;           ///< 1.96 standard deviations of `torque`; empty: not known
};

/// One for each effect that diagnosis put into the model, and one for each joint at which structure is left.
/// The signal is the one of position, velocity, acceleration, load and time whose classes explain most of the torque;
/// for an effect that repeats with the position, the position within one period. The band comes from the parameters'
/// standard deviations to first order, each alone: model.json has no covariance.
/// @param diagnosis null: only what model.json says was found
std::vector<FindingPicture> finding_pictures(const IdentifiedModel& model, const std::vector<ShownLog>& logs,
                                             const DiagnosisResult* diagnosis);

}  // namespace fxdyn
