#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/block_solver.hpp"
#include "host_tools/diagnose/log_columns.hpp"

namespace fxdyn::diagnosis {

/// Standard deviation of normal noise from its median: what sticks may be far off without being noise. values: not
/// empty
double robust_sigma(Eigen::VectorXd values);

/// The noise of each joint's rows: an autoregression, and rows that count less as their friction is in doubt.
class NoiseModel {
 public:
  NoiseModel() = default;
  /// @param whitening per joint the autoregression's coefficients
  /// @param doubt per joint: what uncertain friction adds to each row's variance, in units of the noise's
  /// @param doubtful so much of it makes a row doubtful
  NoiseModel(const Blocks& blocks, std::vector<Eigen::VectorXd> whitening, const std::vector<Eigen::VectorXd>& doubt,
             double doubtful);

  const std::vector<Eigen::VectorXd>& whitening() const { return whitening_; }
  /// Rows of one log for a joint, filtered and decimated, with noise that is white and of one size.
  Eigen::MatrixXd apply(std::size_t log, std::size_t joint, const Eigen::MatrixXd& rows) const;

  /// In a doubtful row uncertain friction makes more than the noise, or as much of it as `doubtful` says.
  bool is_doubtful(std::size_t joint, Eigen::Index row) const;
  /// Share of a joint's rows.
  double doubtful_share(std::size_t joint) const;
  /// Sum of ln(row scale) of the rows that fit: part of their likelihood.
  double log_scale(std::size_t joint) const;

 private:
  Blocks blocks_;
  double least_scale_ = 0;  ///< of a row that is not doubtful
  std::vector<Eigen::VectorXd> whitening_;
  std::vector<Eigen::VectorXd> row_scale_;  ///< per joint: one over the root of a row's variance
};

/// From the residual of a fit of all columns to rows that are not whitened yet: the scale of a row comes before the
/// noise's colour, as rows near standstill may be far off.
/// @param fit,quiet of the blocks whose residual is the noise: the healthy session's, where there is one
/// @param whitening coefficients to be kept; empty: from the residual
NoiseModel estimate_noise(const LogColumns& columns, const BlockSolver& solver, const LinearFit& fit,
                          const std::vector<std::size_t>& quiet, std::vector<Eigen::VectorXd> whitening);

}  // namespace fxdyn::diagnosis
