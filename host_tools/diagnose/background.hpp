#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/blocks.hpp"

namespace fxdyn::diagnosis {

/// Functions of the state that a healthy joint has already and no effect explains, with a prior that keeps each to the
/// size of the noise: |y - X x - B b|^2 + prior |b|^2. Their coefficients are never of interest, so b is eliminated
/// once: with C(v) = (B^T B + prior)^-1 B^T v of the rows that fit, every column v becomes v - B C(v) and gets extra
/// rows, - sqrt(prior) C(v). Sums of products of such columns are those of the whole problem less b.
class Background {
 public:
  /// @param functions rows x functions, of any size: they are scaled to RMS 1 @param prior of |b|^2 [noise variances]
  Background(Eigen::MatrixXd functions, const Blocks& blocks, double prior);

  /// Columns (all rows) without the background; their extra rows below.
  Eigen::MatrixXd eliminate(const Eigen::MatrixXd& columns) const;
  /// What the background makes of the rows, from a residual's extra rows.
  Eigen::VectorXd part(const Eigen::VectorXd& extra_residual) const;

  const Eigen::MatrixXd& functions() const { return b_; }
  /// (B^T B + prior)^-1 of the rows that fit
  const Eigen::MatrixXd& inverse() const { return inverse_; }

 private:
  std::vector<Block> fit_;
  double prior_;
  Eigen::MatrixXd b_, inverse_;
};

}  // namespace fxdyn::diagnosis
