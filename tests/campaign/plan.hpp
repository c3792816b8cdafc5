#pragma once

#include "host_tools/signals/motion.hpp"
#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

/// The healthy robot and the motion of its train logs: what effects are scaled with.
struct Plan {
  IdentifiedModel healthy;
  std::vector<Motion> motions;                                           ///< exact, coarser than the logs
  std::vector<Eigen::MatrixXd> torque;                                   ///< of the healthy robot over them [N*m | N]
  Eigen::VectorXd largest_velocity, largest_torque, largest_structural;  ///< per joint
  Eigen::MatrixXd range;                                                 ///< of q per joint: lowest, highest
  double longest_delay_s = 0.028;                                        ///< that the plant can play

  std::size_t joints() const { return healthy.joints.size(); }
};
/// Torque over a motion that is part of a session: drift has run on until it begins.
Eigen::MatrixXd torque_of(const IdentifiedModel& model, const Motion& motion, Eigen::MatrixXd* deflections = nullptr);

Plan make_plan(const IdentifiedModel& healthy, std::vector<Motion> motions);

/// The model with one effect more, at a joint or on the body.
IdentifiedModel with_effect(IdentifiedModel model, std::optional<std::size_t> joint, const EffectFit& fit);

/// Torque change over each of the plan's motions, samples x joints.
std::vector<Eigen::MatrixXd> torque_change(const Plan& plan, const IdentifiedModel& changed);

/// RMS of each joint's column over all motions, share of rated torque.
Eigen::VectorXd shares_of_rated(const Plan& plan, const std::vector<Eigen::MatrixXd>& torque);

}  // namespace fxdyn::campaign
