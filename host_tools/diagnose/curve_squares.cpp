#include "host_tools/diagnose/curve_squares.hpp"

#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double judged_with_curves(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns,
                          const MatrixXd& curves, double prior, const Fold& fold) {
  const BlockSolver& solver = problem.solver();
  const JointRows& rows = solver.rows(joint);
  const double w = solver.weights()[static_cast<Index>(joint)];
  MatrixXd gram;
  VectorXd projection;
  solver.normal(columns, fold.fit, gram, projection);
  const Index p = gram.rows(), c = curves.cols();
  MatrixXd whole = MatrixXd::Zero(p + c, p + c);
  VectorXd right(p + c);
  whole.topLeftCorner(p, p) = gram;
  right.head(p) = projection;
  right.tail(c).setZero();
  if (c > 0) {
    for (const std::size_t b : fold.fit) {
      const Block& block = problem.blocks().all[b];
      if (block.healthy) continue;
      const auto f = curves.middleRows(block.first, block.count);
      whole.bottomRightCorner(c, c).noalias() += w * f.transpose() * f;
      right.tail(c).noalias() += w * f.transpose() * rows.y.segment(block.first, block.count);
      for (Index i = 0; i < p; ++i) {
        const Index local = rows.place(columns[static_cast<std::size_t>(i)]);
        if (local < 0) continue;
        const VectorXd product = w * f.transpose() * rows.x.col(local).segment(block.first, block.count);
        whole.block(p, i, c, 1) += product;
        whole.block(i, p, 1, c) += product.transpose();
      }
    }
    const auto f = curves.bottomRows(curves.rows() - rows.y.size());
    if (f.rows() > 0) {
      whole.bottomRightCorner(c, c).noalias() += w * f.transpose() * f;
      right.tail(c).noalias() += w * f.transpose() * rows.extra_y;
      for (Index i = 0; i < p; ++i) {
        const Index local = rows.place(columns[static_cast<std::size_t>(i)]);
        if (local < 0) continue;
        const VectorXd product = w * f.transpose() * rows.extra_x.col(local);
        whole.block(p, i, c, 1) += product;
        whole.block(i, p, 1, c) += product.transpose();
      }
    }
    whole.bottomRightCorner(c, c).diagonal().array() += prior;
  }
  const VectorXd x = SymmetricSolver(whole).solve(right);
  double sum = 0;
  for (const std::size_t b : fold.judge) {
    const Block& block = problem.blocks().all[b];
    if (block.healthy) continue;
    VectorXd e = rows.y.segment(block.first, block.count) - curves.middleRows(block.first, block.count) * x.tail(c);
    for (Index i = 0; i < p; ++i) {
      const Index local = rows.place(columns[static_cast<std::size_t>(i)]);
      if (local >= 0) e -= x[i] * rows.x.col(local).segment(block.first, block.count);
    }
    sum += w * e.squaredNorm();
  }
  return sum;
}

}  // namespace fxdyn::diagnosis
