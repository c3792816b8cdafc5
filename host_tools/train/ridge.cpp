#include "host_tools/train/ridge.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Squared share of a column that the ones before it leave: less is rounding.
constexpr double nothing_left = 1e-12;
/// A pivot that takes its column out.
constexpr double taken_out = 1e150;

}  // namespace

Moments::Moments(Index columns) : gram(MatrixXd::Zero(columns, columns)), projection(VectorXd::Zero(columns)) {}

void Moments::add(const Eigen::Ref<const MatrixXd>& x, const Eigen::Ref<const VectorXd>& y) {
  gram.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
  gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
  projection.noalias() += x.transpose() * y;
  square += y.squaredNorm();
  rows += static_cast<double>(y.size());
}

double Moments::mean_square(const VectorXd& w) const {
  if (rows == 0) return 0;
  const Index n = w.size();
  const double sum = square - 2 * w.dot(projection.head(n)) + w.dot(gram.topLeftCorner(n, n) * w);
  return std::max(0.0, sum) / rows;
}

void GrowingRidge::grow(Index columns) {
  const Index old = size_, more = columns - old;
  if (more <= 0) return;
  factor_.conservativeResize(columns, columns);
  factor_.rightCols(more).setZero();
  forward_.conservativeResize(columns);
  // [L 0; B C] [L^T B^T; 0 C^T]: B = G_21 L^-T, C C^T = G_22 - B B^T
  auto below = factor_.bottomLeftCorner(more, old);
  below = moments_->gram.block(old, 0, more, old);
  if (old > 0)
    factor_.topLeftCorner(old, old).triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
  MatrixXd rest = moments_->gram.block(old, old, more, more);
  const VectorXd whole = rest.diagonal();
  rest.diagonal().array() += ridge_ * moments_->rows;
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
  VectorXd right = moments_->projection.segment(old, more);
  if (old > 0) right.noalias() -= below * forward_.head(old);
  forward_.tail(more) = factor_.bottomRightCorner(more, more).triangularView<Eigen::Lower>().solve(right);
  size_ = columns;
}

VectorXd GrowingRidge::solve(Index n) {
  grow(n);
  return factor_.topLeftCorner(n, n).triangularView<Eigen::Lower>().transpose().solve(forward_.head(n));
}

}  // namespace fxdyn
