#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/diagnose/deflection_rows.hpp"

namespace fxdyn::diagnosis {

/// An effect between motor and link, with its shape.
struct DeflectionPart {
  std::string effect;
  std::vector<double> shape;
};

/// Effects that make up a joint's deflection together.
struct DeflectionSet {
  std::vector<DeflectionPart> parts;
  Eigen::VectorXd theta;          ///< coefficients of the parts, in their order
  Eigen::VectorXd std;            ///< of polish() with all that is uncertain, else with load and shapes as they are
  std::vector<double> shape_std;  ///< of polish(), by part; 0: not estimated
  double square = 1e300, score = -1e300;
  double likelihood = -1e300;  ///< score whatever the signs of the coefficients
  double noise = 0;            ///< variance of the whitened residual

  /// Where the coefficients of a part begin; how many it has.
  Eigen::Index first(std::size_t part) const;
  Eigen::Index count(std::size_t part) const;
  Eigen::VectorXd theta_of(std::size_t part) const { return theta.segment(first(part), count(part)); }
};

/// Columns of all parts, behind one offset a log.
Eigen::MatrixXd design(const DeflectionRows& rows, const std::vector<DeflectionPart>& parts);

/// Fits a set's coefficients in rows whitened by `colour`, and scores it: N ln(N / RSS) - penalties for parameters.
void fit(const DeflectionRows& rows, const Eigen::VectorXd& colour, DeflectionSet& set);

/// Forward: the effect that brings most, as long as one brings something. The load moves with it to where torque and
/// deflection together have it most likely.
/// @param rows their load is moved @param covariance of the base parameters; empty: the load is taken as it is
/// @param uncertainty of the load, as it was found
DeflectionSet best_set(DeflectionRows& rows, const IdentifiedModel& model, const Eigen::MatrixXd& covariance,
                       LoadUncertainty& uncertainty, const DeflectionOptions& options, bool with_rotor = true);

/// RMS of a part's deflection over the rows.
double size_of(const DeflectionRows& rows, const DeflectionPart& part, const Eigen::VectorXd& theta);

}  // namespace fxdyn::diagnosis
