#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// An effect seen between motor and link.
struct DeflectionEffect {
  std::size_t joint = 0;  ///< from 0
  EffectFit fit;
  double score = 0;      ///< N ln(RSS without / RSS with) - penalties
  double closure = 0;    ///< share of the deflection's power on data that did not fit it
  bool held_out = true;  ///< else there were none, and it is that of the rows that fitted
  double rotor = 0;      ///< inertia that the base parameters have and the gear does not carry [kg m^2 | kg]
};

struct Deflections {
  std::vector<DeflectionEffect> found;
  std::vector<std::size_t> unexplained;  ///< joints whose deflection no set of effects closes, unlike a healthy one
};

/// Elasticity, backlash and eccentricity of the joints that have a link encoder, from
///   q - qlink = offset + compliance load + half_gap tanh(structural / scale) + sin sin(q) + cos cos(q),
/// load the rigid-body torque of `model` through the gear's relaxation: every set of them on an autoregressive noise,
/// shapes on a grid and refined; the set with the best score. The load of a joint that carries little is known from the
/// torque only within its noise, but encoders are fine: the base parameters move within their covariance to where the
/// deflection fits best (maximum a posteriori, Gauss-Newton over parameters of load and effects). A rotor that the base
/// parameters have is found the same way: the gear does not carry it. What a healthy
/// session has alike (within a third) is not reported but returned in `background`.
/// Called before any torque is looked at, and again with the model that knows what else was missing.
/// @param base_covariance of the model's base parameters
/// @param now logs of the current session (train fits, validate judges) @param before healthy ones, may be empty
Deflections find_deflections(const IdentifiedModel& model, const Eigen::MatrixXd& base_covariance,
                             const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                             std::vector<DeflectionEffect>& background, const DeflectionOptions& options);

/// What was found at a joint, by name.
std::vector<DeflectionEffect> at_joint(const Deflections& all, std::size_t joint);

/// What was found with one load and with another, joint by joint.
struct Refitted {
  Deflections taken;  ///< of the later one, where it is the same set of effects and closes at most `lost_closure` less
  Deflections kept;   ///< of the former, where it is not
};
Refitted take_where_better(const Deflections& before, const Deflections& again, std::size_t joints,
                           const DeflectionOptions& options);

}  // namespace fxdyn::diagnosis
