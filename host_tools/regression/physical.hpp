#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/regression/consistent.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/pseudo_inertia.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The fit of a robot: see ConsistentProblem.
struct PhysicalProblem {
  const Robot& robot;
  const DhChain& chain;
  const BaseSet& base;
  Eigen::MatrixXd information;   ///< (base + theta)^2: weighted X^T W X of the fit
  Eigen::VectorXd projection;    ///< X^T W tau
  Eigen::VectorXd lower, upper;  ///< of theta (all joints' coefficients); +-1e30: unbounded
  double variance = 1;           ///< of a row's weighted residual: 1 where W is one over the residual's variance
  Eigen::MatrixXd known{};  ///< base^2: part of information / variance that comes from no log (BasePrior); empty: none
};

/// How much of a parameter the data decided: 1 - variance after / variance before, before being the prior with a
/// standard deviation of about its own size. 0: the value is the prior's.
struct DataShare {
  double mass = 0;
  // x, y, z of the link's URDF frame
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();  ///< m c, what gravity acts on
};
/// From here on a parameter counts as determined by the data.
inline constexpr double determined_share = 0.99;

struct PhysicalFit {
  std::vector<LinkInertia<Real>> inertia;  ///< DH frames, all ten parameters of each link
  Eigen::VectorXd beta, theta;
  bool constrained = false;                 ///< false: beta and theta are the unconstrained solution itself
  std::vector<double> smallest_eigenvalue;  ///< of each pseudo-inertia
  std::vector<DataShare> share;
  Eigen::VectorXd rotor;  ///< by joint: inertia in beta that turns faster than a link, reflected to it [kg m^2 | kg]
  std::string prior;      ///< what it was, for people
  double mass = 0;        ///< of all links together [kg]
  double mass_share = 0;  ///< how much of that the data decided
};

/// Prior: the URDF's inertias where it has them; for other links solid ellipsoids of one density around the segment to
/// the next joint, the density that fits the data best. Where bodies alone explain the data worse, the joints whose
/// rotor the base parameters absorb get one: as much about one axis, and nothing about the others, no body has.
PhysicalFit fit_physical(const PhysicalProblem& problem);

/// The same of a fitter whose weights are one over the residuals' variance; coefficients keep the bounds of the
/// catalogue (those of a BLS have none).
PhysicalFit fit_physical(const Fitter& fitter, const Robot& robot, double variance = 1);
/// The same with the information of other logs in place of the fitter's own (X^T W X and X^T W tau of its unknowns).
PhysicalFit fit_physical(const Fitter& fitter, const Robot& robot, Eigen::MatrixXd information,
                         Eigen::VectorXd projection, double variance);
/// A fitter's solution with beta and theta of the physical fit in place of its own.
Solution physical_solution(Solution solution, const PhysicalFit& fit);

/// Of each link, for people who read only its inertia: how much of it the data decided.
std::vector<std::string> share_comments(const PhysicalFit& fit);

/// Masses and centres of the fit beside the URDF's, in the links' URDF frames.
struct LinkMass {
  std::string link;
  Inertial identified;
  DataShare share;
  std::optional<Inertial> urdf;
};
struct MassCheck {
  std::vector<LinkMass> links;
  double mass = 0, mass_share = 0;
  std::optional<double> urdf_mass;  ///< where all links have an inertia there
};
MassCheck mass_check(const Robot& robot, const DhChain& chain, const PhysicalFit& fit);

}  // namespace fxdyn
