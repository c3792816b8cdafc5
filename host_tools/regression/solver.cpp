#include "host_tools/regression/solver.hpp"

#include <cmath>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SymmetricSolver::SymmetricSolver(const MatrixXd& a) : scale_(a.diagonal().cwiseSqrt()) {
  for (double& s : scale_) s = s > 0 ? 1 / s : 0;
  scaled_ = scale_.asDiagonal() * a * scale_.asDiagonal();
  ldlt_.compute(scaled_ + 1e-12 * MatrixXd::Identity(a.rows(), a.cols()));
}

VectorXd SymmetricSolver::solve(const VectorXd& b) const {
  const VectorXd rhs = scale_.cwiseProduct(b);
  VectorXd x = ldlt_.solve(rhs);
  for (int round = 0; round < 2; ++round) x += ldlt_.solve(rhs - scaled_ * x);
  return scale_.cwiseProduct(x);
}

MatrixXd SymmetricSolver::inverse() const {
  return scale_.asDiagonal() * ldlt_.solve(MatrixXd::Identity(scaled_.rows(), scaled_.cols())) * scale_.asDiagonal();
}

namespace {

/// Squared share of a column that the ones before it leave: less is rounding.
constexpr double nothing_left = 1e-12;
/// A pivot that takes its column out.
constexpr double taken_out = 1e150;

}  // namespace

void GrowingSolver::grow(Index size) {
  const Index old = size_, more = size - old;
  if (more <= 0) return;
  factor_.conservativeResize(size, size);
  factor_.rightCols(more).setZero();
  forward_.conservativeResize(size);
  // [L 0; B C] [L^T B^T; 0 C^T]: B = G_21 L^-T, C C^T = G_22 - B B^T
  auto below = factor_.bottomLeftCorner(more, old);
  below = a_->block(old, 0, more, old);
  if (old > 0)
    factor_.topLeftCorner(old, old).triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
  MatrixXd rest = a_->block(old, old, more, more);
  const VectorXd whole = rest.diagonal();
  rest.diagonal().array() += ridge_;
  rest.noalias() -= below * below.transpose();
  // Column by column: a pivot that is rounding must not be divided by.
  for (Index k = 0; k < more; ++k) {
    const double pivot = rest(k, k) - factor_.block(old + k, old, 1, k).squaredNorm();
    const bool dependent = !(pivot > nothing_left * whole[k]);
    const double root = dependent ? taken_out : std::sqrt(pivot);
    factor_(old + k, old + k) = root;
    const Index left = more - k - 1;
    if (left == 0) continue;
    auto column = factor_.block(old + k + 1, old + k, left, 1);
    column = rest.block(k + 1, k, left, 1);
    column.noalias() -= factor_.block(old + k + 1, old, left, k) * factor_.block(old + k, old, 1, k).transpose();
    column /= root;
  }
  VectorXd right = b_->segment(old, more);
  if (old > 0) right.noalias() -= below * forward_.head(old);
  forward_.tail(more) = factor_.bottomRightCorner(more, more).triangularView<Eigen::Lower>().solve(right);
  size_ = size;
}

VectorXd GrowingSolver::solve(Index n) {
  grow(n);
  return factor_.topLeftCorner(n, n).triangularView<Eigen::Lower>().transpose().solve(forward_.head(n));
}

}  // namespace fxdyn
