#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/broad_learning_inputs.hpp"

namespace fxdyn {

/// One effect of one joint with its fitted parameters, in the order of the effect's ParameterInfo lists.
struct EffectFit {
  std::string effect;
  std::vector<double> shape, linear;
  std::vector<double> shape_std, linear_std;  ///< empty or 0: not estimated
  bool named = false;                         ///< found by diagnosis; else nominal
};

/// The BLS of one joint (model/broad_learning.hpp).
struct BroadLearningFit : BroadLearningScales {
  std::string inputs = "physical";  ///< names of types there: physical, bristles, extended, state
  std::string activation = "tanh";  ///< tanh, relu
  Eigen::MatrixXd weights;          ///< nodes x (inputs + 1): input weights, bias [-]
  Eigen::VectorXd coefficients;     ///< of inputs, then nodes [N*m | N]
  double ridge = 0;
  Eigen::Index nodes() const { return weights.rows(); }
  Eigen::Index input_count() const { return weights.cols() - 1; }
  Eigen::Index coefficient_count() const { return input_count() + nodes(); }
};

/// One joint's gear, by a second encoder on its link (host_tools/identify/flexible.hpp). Prismatic joints: N/m, N*s/m,
/// kg.
struct FlexibleJoint {
  std::size_t joint = 0;                          ///< from 0
  double stiffness = 0, stiffness_std = 0;        ///< K [N*m/rad]
  double damping = 0, damping_std = 0;            ///< B [N*m*s/rad]
  double effective_inertia = 0, inertia_std = 0;  ///< J_eff: rotor and gears [kg*m^2]; 0: not known
  double deflection_rms = 0;                      ///< of q - qlink about its mean, filtered [rad | m]
  double explained = 0;                           ///< share of its power that the fit explains
  bool found = false;                             ///< else the figures are noise and `note` says why
  std::string note;                               ///< what a reader should know, empty if nothing
};

/// Of the joint's largest speed: no motion shows a sign's width that is less; one that is more has no dry friction in
/// it, and is viscous friction of another form.
inline constexpr double narrowest_sign = 1e-4, widest_sign = 0.3;

struct JointFit {
  double sign_width = 0.01;   ///< s = tanh(dq / width) [rad/s | m/s]
  double sign_width_std = 0;  ///< 0: not estimated
  std::vector<EffectFit> effects;
  std::optional<BroadLearningFit> bls;
  std::optional<FlexibleJoint> flexible;  ///< where the joint has a link encoder
  double rated_torque = 0;                ///< [N*m | N]
  double q_lower = 0, q_upper = 0, dq_limit = 0, ddq_limit = 0, tau_limit = 0;
  const EffectFit* find(std::string_view effect) const;
};

}  // namespace fxdyn
