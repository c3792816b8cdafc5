#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// What functions of a variable leave of a joint, as judged_with_curves().
struct LeftBy {
  double left = 1e300;
  const char* variable = "";
};

/// The best of the variables of which there is no curve effect: the other joints' velocities and their products with
/// the own, the own acceleration, the own jerk.
/// @param columns of the problem that are fitted beside them @param prior one over the variance of their coefficients
/// @param moving by log and row: 1 where the joint moves, else 0
LeftBy left_without_curve(const Linearised& problem, std::size_t joint, const std::vector<Eigen::Index>& columns,
                          double prior, const std::vector<Fold>& folds, const std::vector<Eigen::VectorXd>& moving);

}  // namespace fxdyn::diagnosis
