#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// A x = b for a symmetric positive semidefinite A: unit diagonal by scaling; a diagonal of 1e-12 keeps directions that
/// the data does not excite finite, and refinement takes its effect out of all others.
class SymmetricSolver {
 public:
  explicit SymmetricSolver(const Eigen::MatrixXd& a);
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
  Eigen::MatrixXd inverse() const;

 private:
  Eigen::VectorXd scale_;
  Eigen::MatrixXd scaled_;
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};

/// The same for the first n unknowns, as many n as one likes, growing: the Cholesky factor of the leading n rows is the
/// leading block of the factor of all, and so is L^-1 b. What is there is not touched, and each n costs one triangular
/// solution. Copies go on from where the original is. No refinement: unknowns whose column is, within rounding, a sum
/// of those before it get zero.
class GrowingSolver {
 public:
  /// @param a, b must outlive it and its copies; of all unknowns
  GrowingSolver(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) : a_(&a), b_(&b) {}

  Eigen::Index size() const { return size_; }
  /// Added to the diagonal of the unknowns that are taken in from now on.
  void set_ridge(double ridge) { ridge_ = ridge; }
  /// Takes in the unknowns up to `size`; fewer: nothing happens.
  void grow(Eigen::Index size);
  /// The first n unknowns, without those behind them; grows to n where needed.
  Eigen::VectorXd solve(Eigen::Index n);

 private:
  const Eigen::MatrixXd* a_;
  const Eigen::VectorXd* b_;
  double ridge_ = 0;
  Eigen::Index size_ = 0;
  Eigen::MatrixXd factor_;   ///< L, lower
  Eigen::VectorXd forward_;  ///< L^-1 b
};

}  // namespace fxdyn
