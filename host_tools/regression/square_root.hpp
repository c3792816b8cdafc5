#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn {

/// Weighted least squares as a triangle: what the rows taken in so far ask of x is R x = z, and what they leave over is
/// `rest`. Sum over those rows of the squared residual = |R x - z|^2 + rest^2 for every x; R^T R is their information
/// (Bierman 1977, square-root information filter). Rows can be forgotten and taken in at any time.
class SquareRootInformation {
 public:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  explicit SquareRootInformation(Eigen::Index unknowns = 0) : triangle_(RowMajor::Zero(unknowns + 1, unknowns + 1)) {}
  /// @param triangle [R z; 0 rest], upper; @param rows how many rows it holds, by their weights
  SquareRootInformation(RowMajor triangle, double rows) : triangle_(std::move(triangle)), rows_(rows) {}

  Eigen::Index unknowns() const { return triangle_.rows() - 1; }
  const RowMajor& triangle() const { return triangle_; }
  /// Taken in so far, by their weights.
  double rows() const { return rows_; }

  /// What is known counts `share` of what it did.
  void forget(double share);
  /// Rows [coefficients of `columns` (ascending) | right side], each multiplied by the root of its weight; together
  /// they count `weight` rows. Many rows of few columns are brought to a triangle of their own first, which asks the
  /// same and is soon rotated in.
  void take_in(const Eigen::MatrixXd& rows, const std::vector<Eigen::Index>& columns, double weight);

  /// The least squares solution; unknowns that the rows say nothing of (beyond those before them) are zero.
  Eigen::VectorXd solve() const;
  /// The same where these unknowns have to be zero.
  Eigen::VectorXd solve_without(const std::vector<Eigen::Index>& zeros) const;
  /// Asks for x instead of its own solution, as strongly as before in every direction.
  void recentre(const Eigen::VectorXd& x);

  Eigen::MatrixXd information() const;  ///< X^T W X
  Eigen::VectorXd projection() const;   ///< X^T W y
  Eigen::VectorXd deviations() const;   ///< roots of the diagonal of the information's inverse; 0: says nothing
  double variance_of_row() const;       ///< the squared residual that a row leaves over

 private:
  RowMajor triangle_;
  double rows_ = 0;
};

}  // namespace fxdyn
