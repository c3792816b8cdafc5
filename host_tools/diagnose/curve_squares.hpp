#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Squared residual of one joint on a fold's judge, weighed, columns of the problem and curves of the joint fitted to
/// the rest.
/// @param curves columns of the joint: rows, below them those that its background adds (Linearised::make())
/// @param prior one over the variance of a curve's coefficients, whose mean is 0
double judged_with_curves(const Linearised& problem, std::size_t joint, const std::vector<Eigen::Index>& columns,
                          const Eigen::MatrixXd& curves, double prior, const Fold& fold);

}  // namespace fxdyn::diagnosis
