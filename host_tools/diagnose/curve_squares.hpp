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

/// -2 ln of the density that a fit predicts other rows with, e^T S^-1 e + ln det S, without the constant of their
/// number.
struct Deviance {
  double square = 0;  ///< e^T S^-1 e, e the error
  double log_determinant =
      0;  ///< of S = I + J cov J^T, J the rows, cov the covariance that the fit leaves coefficients

  double sum() const { return square + log_determinant; }
  /// .. where the noise is not known beforehand, but what suits these rows best.
  double of_any_noise(double rows) const;
};

/// The deviance of a fold's judge, one joint's rows, by a fit of the rest. Where curves can do a column's work on the
/// rows that fit, neither is known, and other rows can't be predicted: their squares alone say nothing there. Source:
/// Bishop 2006, Pattern Recognition and Machine Learning, eq. (3.58).
class PredictiveDeviance {
 public:
  /// Parameters are those of judged_with_curves().
  PredictiveDeviance(const Linearised& problem, std::size_t joint, const std::vector<Eigen::Index>& columns,
                     const Eigen::MatrixXd& curves, const Fold& fold);
  /// @param prior one over the variance of a curve's coefficients, whose mean is 0
  Deviance operator()(double prior) const;

 private:
  Eigen::Index curves_;
  Eigen::VectorXd start_;     ///< coefficients without curves
  Eigen::VectorXd right_;     ///< what is left of the fit's X^T W y there
  Eigen::MatrixXd fitted_;    ///< X^T W X of the rows that fit
  Eigen::MatrixXd judged_;    ///< .. of those that judge
  Eigen::VectorXd products_;  ///< X^T W e of those that judge, e the error there
  double square_ = 0;         ///< e^T W e
};

}  // namespace fxdyn::diagnosis
