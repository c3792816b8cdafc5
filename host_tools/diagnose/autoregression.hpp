#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn::diagnosis {

/// Coefficients a of e(k) = sum a_i e(k - i) + white noise from the autocorrelation of several stretches (Yule and
/// Walker), with a touch of white noise that keeps the roots inside; zeros where there is nothing.
Eigen::VectorXd autoregression(const std::vector<Eigen::VectorXd>& residuals);

/// x(k) - sum a_i x(k - i), one stretch of rows; its first ones have no past and are left out (zero).
Eigen::MatrixXd prewhitened(const Eigen::Ref<const Eigen::MatrixXd>& rows, const Eigen::VectorXd& coefficients);

}  // namespace fxdyn::diagnosis
