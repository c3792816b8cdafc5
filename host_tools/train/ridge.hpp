#pragma once

#include <Eigen/Dense>

#include "host_tools/regression/solver.hpp"

namespace fxdyn {

/// Sums of products over rows: all that least squares of y on the columns of X needs of them.
struct Moments {
  Eigen::MatrixXd gram;        ///< X^T X
  Eigen::VectorXd projection;  ///< X^T y
  double square = 0;           ///< y^T y
  double rows = 0;

  explicit Moments(Eigen::Index columns = 0);
  void add(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y);
  /// Mean square of y - X(:, 0..n-1) w, n the size of w. No rows: 0.
  double mean_square(const Eigen::VectorXd& w) const;
};

/// Ridge regression on the first columns of X, as many as one likes (paper Eqs. 26-30):
///   w_n = argmin 1/N |y - X_n w|^2 + ridge |w|^2 = (X_n^T X_n + N ridge I)^-1 X_n^T y
/// Nodes are added without touching what is there (the BLS's incremental learning, see GrowingSolver). Chen, Liu 2018
/// update a pseudo-inverse instead: N rows where this has n.
class GrowingRidge {
 public:
  /// @param moments must outlive it
  GrowingRidge(const Moments& moments, double ridge) : solver_(moments.gram, moments.projection) {
    solver_.set_ridge(ridge * moments.rows);
  }
  /// Weights of the first n columns; grows to n where needed. Columns that are, within rounding, sums of those before
  /// them get zero.
  Eigen::VectorXd solve(Eigen::Index n) { return solver_.solve(n); }

 private:
  GrowingSolver solver_;
};

}  // namespace fxdyn
