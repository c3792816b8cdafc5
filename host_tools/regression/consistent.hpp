#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn {

/// Bodies pi (10 a body) and rotors r that are physically possible, and coefficients theta within bounds, closest to
/// the data:
///   minimise (z - z*)^T information (z - z*) / variance, z = [beta; theta], beta = grouping * pi + rotors * r,
///   subject to P_i > 0, r > 0 and lower <= theta <= upper.
struct ConsistentProblem {
  Eigen::MatrixXd information;         ///< X^T W X over [beta; theta]
  Eigen::VectorXd projection;          ///< X^T W tau
  Eigen::VectorXd lower, upper;        ///< of theta; +-1e30: unbounded
  Eigen::MatrixXd grouping;            ///< beta x 10 bodies, the unit matrix in `columns`
  std::vector<Eigen::Index> columns;   ///< the parameters that stand for beta
  std::vector<Eigen::Matrix4d> prior;  ///< one a body, P > 0
  double variance = 1;                 ///< of a row's weighted residual: 1 where W is one over the residual's variance
  Eigen::MatrixXd rotors{};       ///< beta x rotors: base parameters of a rotor of 1 kg m^2 (kg), see rotor_in_base()
  Eigen::VectorXd rotor_prior{};  ///< > 0 [kg m^2 | kg]
};

struct ConsistentFit {
  std::vector<Eigen::Matrix4d> bodies;
  Eigen::VectorXd rotors;  ///< inertia of each [kg m^2 | kg]
  Eigen::VectorXd beta, theta;
  bool constrained = false;  ///< false: beta and theta are the least squares solution itself
  double excess = 0;         ///< nats; half of the squared error / variance beyond the least squares solution's
};

/// Interior-point Newton whose barrier is the prior: the divergence between pseudo-inertias
///   D(P || P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4
/// (Lee, Wensing, Park, "Geometric robot dynamic identification", T-RO 2020), which no choice of units or frames
/// changes, and r / r0 - log(r / r0) - 1 for a rotor. Its weight falls to that of one
/// row of the data. Where some possible bodies make the least squares solution, that is the result and the prior only
/// chooses among those.
ConsistentFit fit_consistent(const ConsistentProblem& problem);

}  // namespace fxdyn
