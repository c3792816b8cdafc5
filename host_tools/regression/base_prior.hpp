#pragma once

#include <Eigen/Dense>

#include "host_tools/regression/regressor.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// What is known of the base parameters before any log: normal, (beta - mean)^T information (beta - mean).
struct BasePrior {
  Eigen::MatrixXd information;  ///< base x base; singular where nothing is known
  Eigen::VectorXd mean;
  bool empty() const { return information.size() == 0; }
  double square(const Eigen::VectorXd& beta) const { return (beta - mean).dot(information * (beta - mean)); }
};

/// The URDF's links, with `relative_error` as the standard deviation of a mass, and of the other nine parameters as
/// much as the geometry of possible bodies gives them: C = relative_error^2 H^-1, H the Hessian of -log det P at the
/// link's pseudo-inertia P (barrier_hessian(); the metric of Lee, Wensing, Park 2020). beta = G pi has the covariance
/// G C G^T. Of rotors nothing is known: where a base parameter holds one, its direction has no information.
/// @throws InputError: a link without inertia
BasePrior prior_of_urdf(const Robot& robot, const DhChain& chain, const BaseSet& base, double relative_error);

}  // namespace fxdyn
