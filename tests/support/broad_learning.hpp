#pragma once

#include <string>
#include <utility>
#include <vector>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::test {

/// Every set of inputs with every activation.
inline std::vector<std::pair<std::string, std::string>> bls_kinds() {
  std::vector<std::pair<std::string, std::string>> kinds;
  for (const char* inputs : {"physical", "bristles", "extended", "state"}) {
    for (const char* activation : {"tanh", "relu"}) kinds.emplace_back(inputs, activation);
  }
  return kinds;
}

/// Random nodes for a joint, weights on the grid that training uses; scaled to the joint's limits.
inline BroadLearningFit random_bls(const std::string& inputs, const std::string& activation, const JointFit& joint,
                                   Eigen::Index nodes, double weight, std::uint64_t seed) {
  Random random(seed);
  BroadLearningFit bls;
  bls.inputs = inputs;
  bls.activation = activation;
  bls.reference_velocity = 0.02 * joint.dq_limit;
  bls.span = std::asinh(joint.dq_limit / bls.reference_velocity);
  bls.torque = joint.rated_torque;
  bls.wavenumber = 2;
  bls.velocity = joint.dq_limit;
  bls.stribeck = 0.05 * joint.dq_limit;
  bls.share = 0.6;
  bls.acceleration = joint.ddq_limit;
  bls.middle = (joint.q_lower + joint.q_upper) / 2;
  bls.half_range = (joint.q_upper - joint.q_lower) / 2;
  const Eigen::Index count = bls_inputs(bls);
  bls.weights = Eigen::MatrixXd::NullaryExpr(nodes, count + 1,
                                             [&] { return std::round(512 * random.uniform(-weight, weight)) / 512; });
  bls.coefficients = Eigen::VectorXd::NullaryExpr(count + nodes, [&] { return random.uniform(-5, 5); });
  return bls;
}

/// A joint that turns against gravity, with a BLS only.
inline IdentifiedModel joint_with_bls(const std::string& inputs, const std::string& activation) {
  IdentifiedModel model;
  model.robot.gravity = {0, -9.81, 0};
  Joint joint;
  joint.name = "joint";
  model.robot.joints.push_back(joint);
  model.inertia.push_back({3, {0.5, 0.1, 0.02}, 0.1, 0.12, 0.08, 0.01, -0.01, 0.005});
  JointFit fit;
  fit.sign_width = 0.02;
  fit.rated_torque = 20;
  fit.tau_limit = 1e3;
  fit.q_lower = -1.9;
  fit.q_upper = 2.3;
  fit.dq_limit = 3;
  fit.ddq_limit = 15;
  fit.bls = random_bls(inputs, activation, fit, 7, 1, 4);
  fit.bls->weights.rightCols(1).array() += 1.5;  // no ramp stays at zero
  model.joints.push_back(fit);
  return model;
}

}  // namespace fxdyn::test
