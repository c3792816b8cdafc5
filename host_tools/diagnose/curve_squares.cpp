#include "host_tools/diagnose/curve_squares.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Adds products of curves on some rows: among themselves, with y and with the columns before them.
/// @param column_of a column of the joint on the same rows
template <typename Curves, typename Values, typename ColumnOf>
void add_products(const JointRows& rows, const std::vector<Index>& columns, double w, const Curves& f, const Values& y,
                  const ColumnOf& column_of, MatrixXd& gram, VectorXd& projection) {
  const Index p = static_cast<Index>(columns.size()), c = f.cols();
  gram.bottomRightCorner(c, c).noalias() += w * f.transpose() * f;
  projection.tail(c).noalias() += w * f.transpose() * y;
  for (Index i = 0; i < p; ++i) {
    const Index local = rows.place(columns[static_cast<std::size_t>(i)]);
    if (local < 0) continue;
    const VectorXd product = w * f.transpose() * column_of(local);
    gram.block(p, i, c, 1) += product;
    gram.block(i, p, 1, c) += product.transpose();
  }
}

/// X^T W X and X^T W y of columns of the problem and curves of one joint on blocks, without the curves' prior.
struct Normal {
  MatrixXd gram;
  VectorXd projection;
};

Normal normal_of(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns,
                 const MatrixXd& curves, const std::vector<std::size_t>& blocks) {
  const BlockSolver& solver = problem.solver();
  const JointRows& rows = solver.rows(joint);
  const double w = solver.weights()[static_cast<Index>(joint)];
  MatrixXd gram;
  VectorXd projection;
  solver.normal(columns, blocks, gram, projection);
  const Index p = gram.rows(), c = curves.cols();
  Normal out{MatrixXd::Zero(p + c, p + c), VectorXd::Zero(p + c)};
  out.gram.topLeftCorner(p, p) = gram;
  out.projection.head(p) = projection;
  if (c == 0) return out;
  // Of the healthy session too: where a background has been taken out, curves have rows there.
  for (const std::size_t b : blocks) {
    const Block& block = problem.blocks().all[b];
    add_products(
        rows, columns, w, curves.middleRows(block.first, block.count), rows.y.segment(block.first, block.count),
        [&](Index local) { return rows.x.col(local).segment(block.first, block.count); }, out.gram, out.projection);
  }
  if (curves.rows() > rows.y.size()) {
    add_products(
        rows, columns, w, curves.bottomRows(curves.rows() - rows.y.size()), rows.extra_y,
        [&](Index local) { return rows.extra_x.col(local); }, out.gram, out.projection);
  }
  return out;
}

/// A joint's rows of a block: the columns, then the curves.
MatrixXd rows_of(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns,
                 const MatrixXd& curves, const Block& block) {
  const JointRows& rows = problem.solver().rows(joint);
  const auto p = static_cast<Index>(columns.size());
  MatrixXd out = MatrixXd::Zero(block.count, p + curves.cols());
  for (Index i = 0; i < p; ++i) {
    const Index local = rows.place(columns[static_cast<std::size_t>(i)]);
    if (local >= 0) out.col(i) = rows.x.col(local).segment(block.first, block.count);
  }
  out.rightCols(curves.cols()) = curves.middleRows(block.first, block.count);
  return out;
}

/// Squares of a fit that has no solution.
constexpr double impossible = 1e30;

/// ln det and solutions of a positive definite matrix, scaled to a unit diagonal.
class Definite {
 public:
  explicit Definite(const MatrixXd& a) : scale_(a.diagonal().cwiseSqrt().cwiseInverse()) {
    llt_.compute(scale_.asDiagonal() * a * scale_.asDiagonal());
  }
  bool is_definite() const { return llt_.info() == Eigen::Success; }
  VectorXd solve(const VectorXd& b) const { return scale_.cwiseProduct(llt_.solve(scale_.cwiseProduct(b))); }
  double log_determinant() const {
    return 2 * (llt_.matrixLLT().diagonal().array().log().sum() - scale_.array().log().sum());
  }

 private:
  VectorXd scale_;
  Eigen::LLT<MatrixXd> llt_;
};

}  // namespace

double judged_with_curves(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns,
                          const MatrixXd& curves, double prior, const Fold& fold) {
  Normal normal = normal_of(problem, joint, columns, curves, fold.fit);
  normal.gram.bottomRightCorner(curves.cols(), curves.cols()).diagonal().array() += prior;
  const VectorXd x = SymmetricSolver(normal.gram).solve(normal.projection);
  const VectorXd& y = problem.solver().rows(joint).y;
  double sum = 0;
  for (const std::size_t b : fold.judge) {
    const Block& block = problem.blocks().all[b];
    if (block.healthy) continue;
    sum += (y.segment(block.first, block.count) - rows_of(problem, joint, columns, curves, block) * x).squaredNorm();
  }
  return problem.solver().weights()[static_cast<Index>(joint)] * sum;
}

PredictiveDeviance::PredictiveDeviance(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns,
                                       const MatrixXd& curves, const Fold& fold)
    : curves_(curves.cols()) {
  // Deviation of a coefficient about its fit without curves, in those that its own column gives it: so wide that data
  // decide, and finite where beside a curve they don't.
  constexpr double widest = 1e3;
  Normal normal = normal_of(problem, joint, columns, curves, fold.fit);
  const Index p = normal.gram.rows() - curves_;
  const double w = problem.solver().weights()[static_cast<Index>(joint)];
  start_ = VectorXd::Zero(normal.gram.rows());
  start_.head(p) = SymmetricSolver(normal.gram.topLeftCorner(p, p)).solve(normal.projection.head(p));
  right_ = normal.projection - normal.gram * start_;
  fitted_ = std::move(normal.gram);
  for (Index i = 0; i < p; ++i) fitted_(i, i) += std::max(fitted_(i, i), 1e-300) / (widest * widest);
  judged_ = MatrixXd::Zero(fitted_.rows(), fitted_.cols());
  products_ = VectorXd::Zero(fitted_.rows());
  const VectorXd& y = problem.solver().rows(joint).y;
  for (const std::size_t b : fold.judge) {
    const Block& block = problem.blocks().all[b];
    if (block.healthy) continue;
    const MatrixXd j = rows_of(problem, joint, columns, curves, block);
    const VectorXd e = y.segment(block.first, block.count) - j * start_;
    square_ += w * e.squaredNorm();
    products_ += w * (j.transpose() * e);
    judged_ += w * (j.transpose() * j);
  }
}

double Deviance::of_any_noise(double rows) const {
  constexpr double rounding = 1e-6;  // noise variances: with less, squares are differences of large numbers
  return rows * std::log(std::max(square / std::max(rows, 1.0), rounding)) + log_determinant;
}

Deviance PredictiveDeviance::operator()(double prior) const {
  MatrixXd gram = fitted_;
  gram.bottomRightCorner(curves_, curves_).diagonal().array() += prior;
  const Definite fitted(gram), all(gram + judged_);
  if (!fitted.is_definite() || !all.is_definite()) return {impossible, 0};
  const VectorXd x = fitted.solve(right_);
  const VectorXd products = products_ - judged_ * x;
  const double square = square_ - 2 * products_.dot(x) + x.dot(judged_ * x) - products.dot(all.solve(products));
  if (!std::isfinite(square)) return {impossible, 0};
  return {std::max(square, 0.0), all.log_determinant() - fitted.log_determinant()};
}

}  // namespace fxdyn::diagnosis
