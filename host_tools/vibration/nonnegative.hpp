#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// The x with the least x' gram x whose elements are not negative and sum up to 1 (active set: Lawson, Hanson, "Solving
/// least squares problems", 1974).
/// @param gram symmetric, positive semidefinite
Eigen::VectorXd least_on_simplex(const Eigen::MatrixXd& gram);

}  // namespace fxdyn
