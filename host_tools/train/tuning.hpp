#pragma once

#include <array>
#include <cstdint>

#include "host_tools/identify/fitter.hpp"

namespace fxdyn {

/// Hyperparameters of one joint's BLS.
struct BlsShape {
  Eigen::Index nodes = 20;
  int windows = 1;
  double ridge = 1e-4;
  double scale = 1;                  ///< of the nodes' input weights in the first window
  double distance = 1e-3;            ///< middle presliding distance, of the joint's range
  double spread = 3;                 ///< between two presliding distances
  double reference_velocity = 0.02;  ///< of the joint's top speed
};

/// Makes designs of one joint: the fitter's own with a BLS in it.
class BlsDesigner {
 public:
  BlsDesigner(const Fitter& fitter, std::size_t joint, std::uint64_t seed);
  /// Feature weights are random, drawn once (paper Eqs. 23 and 25): fewer nodes are the first of more. Window w of W
  /// has weights of scale * 3^(w / (W - 1)): coarse and fine ones.
  JointFit operator()(const BlsShape& shape) const;

 private:
  JointFit nominal_;
  std::uint64_t seed_;
  double range_ = 0, top_speed_ = 0;
};

/// The search space of a swarm. Lengths, scales and the ridge on logarithms.
class BlsSpace {
 public:
  explicit BlsSpace(const PsoSettings& settings);
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }
  BlsShape operator()(const Eigen::VectorXd& x) const;

 private:
  Eigen::VectorXd lower_, upper_;
};

/// Whether fixed point can hold the coefficients: sums of |c| above so many times rated torque would show.
bool is_quiet(const Judgement& judgement, double rated_torque);
/// See train().
double fitness(const Judgement& judgement, const JointFit& design);

}  // namespace fxdyn
