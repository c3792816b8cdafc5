#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// A x = b for a symmetric positive semidefinite A: unit diagonal by scaling; a diagonal of 1e-12 keeps directions that
/// the data does not excite finite, and refinement takes its effect out of all others.
class SymmetricSolver {
 public:
  explicit SymmetricSolver(const Eigen::MatrixXd& a) : scale_(a.diagonal().cwiseSqrt()) {
    for (double& s : scale_) s = s > 0 ? 1 / s : 0;
    scaled_ = scale_.asDiagonal() * a * scale_.asDiagonal();
    ldlt_.compute(scaled_ + 1e-12 * Eigen::MatrixXd::Identity(a.rows(), a.cols()));
  }
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const {
    const Eigen::VectorXd rhs = scale_.cwiseProduct(b);
    Eigen::VectorXd x = ldlt_.solve(rhs);
    for (int round = 0; round < 2; ++round) x += ldlt_.solve(rhs - scaled_ * x);
    return scale_.cwiseProduct(x);
  }
  Eigen::MatrixXd inverse() const {
    return scale_.asDiagonal() * ldlt_.solve(Eigen::MatrixXd::Identity(scaled_.rows(), scaled_.cols())) *
           scale_.asDiagonal();
  }

 private:
  Eigen::VectorXd scale_;
  Eigen::MatrixXd scaled_;
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};

}  // namespace fxdyn
