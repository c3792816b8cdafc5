#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/unknowns.hpp"

namespace fxdyn::diagnosis {

/// A numeric choice: less of a column than this (squared) is rounding.
inline constexpr double nothing_left = 1e-5;

/// Products of a group's columns, weighted, once the columns that are fitted beside them have taken their part.
struct Reduced {
  Eigen::MatrixXd gram;
  Eigen::VectorXd projection;  ///< with y
  Eigen::VectorXd size;        ///< diagonal of the gram before
};

/// What a group gains: the largest reduction of the weighted squares within the bounds.
struct Gain {
  double square = 0;  ///< of the weighted residual, less
  double kept = 0;    ///< largest share of a direction that is left, squared
  int rank = 0;
  Eigen::VectorXd theta;
};

/// @param lower bounds of the coefficients @param share the coefficient is 1 by definition
/// @param beyond standard deviations: coefficients further below their bounds gain nothing
Gain gain_of(const Reduced& reduced, const std::vector<double>& lower, bool share, double beyond);

/// A candidate whose coefficient is a share, 1 by definition.
bool is_share(const Group& group);

}  // namespace fxdyn::diagnosis
