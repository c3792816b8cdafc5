#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn {

// The covariance of least squares whose residual is not white: bread (X^T X)^-1, and between it the sum of
// r_i r_k x_i^T x_k over the pairs of rows that are correlated.

/// Rows are correlated within blocks (Liang, Zeger 1986); times B / (B - p) for B blocks and p parameters.
/// @param ends one past the last row of each block
Eigen::MatrixXd middle_of_blocks(const Eigen::MatrixXd& x, const Eigen::VectorXd& residual,
                                 const std::vector<Eigen::Index>& ends);

/// Sums of neighbouring residuals' products over lags 0 .. last, a row's mean, until they fall below `faded` of lag 0.
Eigen::VectorXd autocovariance(const Eigen::VectorXd& residual, double faded);
/// Successive rows are correlated alike all along (Newey, West 1987): sum over lags of gamma X_k^T X_{k+lag}.
Eigen::MatrixXd middle_of_lags(const Eigen::MatrixXd& x, const Eigen::VectorXd& autocovariance);

/// bread middle bread^T
Eigen::MatrixXd sandwich(const Eigen::MatrixXd& bread, const Eigen::MatrixXd& middle);

}  // namespace fxdyn
