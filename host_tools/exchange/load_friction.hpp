#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/exchange/simple_robot.hpp"

namespace fxdyn {

/// Torques of the simple robot over a motion, samples x joints [N*m | N]: as_model() and GearFriction, whose motor
/// torque is the torque that is asked for.
Eigen::MatrixXd torque_of(const SimpleRobot& simple, const IdentifiedModel& model, const MotionRows& motion,
                          double step_s);

/// The model without its joints' load friction.
ModelValue without_load_friction(ModelValue model);

struct LoadFrictionOptions {
  /// A larger model of BAM is taken where it leaves less than this share of what a smaller one leaves [-]; hand.
  double worth = 0.9;
  /// Most of the motor's torque that friction takes, always and at low speed, each [-]: below BAM's own bound of 0.5,
  /// as a joint whose two shares reach 1 holds itself; hand. Also of m6's squares, at the largest torque of the logs.
  /// The two and the square of the motor's torque may reach twice that together.
  double most = 0.45;
};

/// Joints whose model has load friction get BAM's: m3, or m4 with a Stribeck effect; else m5 or (with a Stribeck
/// effect) m6, where that leaves less. All numbers of friction are fitted together, by least squares without negative
/// numbers, to what the train logs' torque of the model leaves beside bodies and rotor. The motor's torque there is the
/// model's. The same without the model's load friction, m1 or m2, becomes SimpleRobot::beside_load.
void fit_load_friction(SimpleRobot& simple, const IdentifiedModel& model, const std::vector<ProcessedLog>& train,
                       const ProjectionOptions& projection = {}, const LoadFrictionOptions& options = {});

}  // namespace fxdyn
