// Least squares by blocks: sums of products, joints that feel a part of the columns, weights, priors.

#include "host_tools/diagnose/block_solver.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_matrix(Index rows, Index columns, std::uint64_t seed) {
  Random random(seed);
  MatrixXd out(rows, columns);
  for (double& value : out.reshaped()) value = random.normal();
  return out;
}

/// Blocks of 40, 30 and 30 rows; the last one judges.
Blocks three_blocks() {
  Blocks out;
  out.all = {{0, 0, 40, false, true}, {1, 40, 30, false, true}, {2, 70, 30, false, false}};
  out.of_log = out.all;
  out.fit = {0, 1};
  out.folds = {{{0, 1}, {2}}};
  return out;
}

/// Joint 0 feels columns 0 and 1, joint 1 columns 1 and 2.
class SolverOfBlocks : public testing::Test {
 protected:
  static JointRows joint(const MatrixXd& x, const VectorXd& y, std::vector<Index> columns) {
    JointRows out;
    out.x = x;
    out.y = y;
    out.column = std::move(columns);
    return out;
  }
  BlockSolver solver(std::vector<Prior> priors = {}) const {
    return BlockSolver(three_blocks(), {joint(x0_, y0_, {0, 1}), joint(x1_, y1_, {1, 2})}, 3, std::move(priors));
  }
  /// All rows that fit in one matrix, weighted.
  MatrixXd dense(double w0, double w1) const {
    MatrixXd out = MatrixXd::Zero(140, 3);
    out.block(0, 0, 70, 2) = std::sqrt(w0) * x0_.topRows(70);
    out.block(70, 1, 70, 2) = std::sqrt(w1) * x1_.topRows(70);
    return out;
  }
  VectorXd right(double w0, double w1) const {
    VectorXd out(140);
    out << std::sqrt(w0) * y0_.head(70), std::sqrt(w1) * y1_.head(70);
    return out;
  }

  const VectorXd truth_ = VectorXd::LinSpaced(3, 1, 3);
  MatrixXd x0_ = random_matrix(100, 2, 1), x1_ = random_matrix(100, 2, 2);
  VectorXd y0_ = x0_ * truth_.head(2) + 0.1 * random_matrix(100, 1, 3),
           y1_ = x1_ * truth_.tail(2) + 0.3 * random_matrix(100, 1, 4);
};

TEST_F(SolverOfBlocks, IsTheLeastSquaresSolution) {
  BlockSolver solver = this->solver();
  solver.set_weights(Eigen::Vector2d(4, 0.5));
  const LinearFit fit = solver.solve({0, 1, 2});
  const VectorXd expected = dense(4, 0.5).colPivHouseholderQr().solve(right(4, 0.5));
  EXPECT_LT((fit.x - expected).norm(), 1e-9);
  EXPECT_EQ(fit.rows, Eigen::Vector2d(70, 70));
  EXPECT_NEAR(fit.square[0], (y0_ - x0_ * fit.x.head(2)).head(70).squaredNorm(), 1e-9);
  EXPECT_LT((fit.information - dense(4, 0.5).transpose() * dense(4, 0.5)).norm(), 1e-9);
}

TEST_F(SolverOfBlocks, JudgesABlockThatItDidNotFit) {
  const BlockSolver solver = this->solver();
  const LinearFit fit = solver.solve({0, 1, 2}, {0});
  const VectorXd judged = solver.square(fit, {2});
  EXPECT_NEAR(judged[1], (y1_ - x1_ * fit.x.tail(2)).tail(30).squaredNorm(), 1e-9);
  EXPECT_EQ(solver.row_count({0, 2}), Eigen::Vector2d(70, 70));
}

TEST_F(SolverOfBlocks, LeavesOutColumnsThatAreNotAskedFor) {
  const LinearFit fit = solver().solve({2});
  const VectorXd x = x1_.col(1).head(70);
  EXPECT_NEAR(fit.x[0], x.dot(y1_.head(70)) / x.squaredNorm(), 1e-9);
  EXPECT_NEAR(fit.square[0], y0_.head(70).squaredNorm(), 1e-9);  // joint 0 does not feel it
}

TEST_F(SolverOfBlocks, APriorIsOneMoreEquation) {
  const BlockSolver solver = this->solver({{5, 0.01}, {}, {}});
  const MatrixXd x = dense(1, 1);
  MatrixXd gram = x.transpose() * x;
  gram(0, 0) += 1e4;
  VectorXd projection = x.transpose() * right(1, 1);
  projection[0] += 5e4;
  const LinearFit fit = solver.solve({0, 1, 2});
  EXPECT_LT((fit.x - gram.ldlt().solve(projection)).norm(), 1e-9);
  EXPECT_NEAR(fit.x[0], 5, 0.1);  // and not 1, as the rows have it
}

TEST_F(SolverOfBlocks, EstimatesTheNoiseOfEachJoint) {
  BlockSolver solver = this->solver();
  solver.estimate_weights();
  // Standard error of a standard deviation from 70 rows: 8 %.
  EXPECT_NEAR(1 / std::sqrt(solver.weights()[0]), 0.1, 0.025);
  EXPECT_NEAR(1 / std::sqrt(solver.weights()[1]), 0.3, 0.075);
}

TEST_F(SolverOfBlocks, AppendedColumnsAreLikeThoseFromTheStart) {
  BlockSolver solver = this->solver();
  const MatrixXd more = random_matrix(100, 2, 5);
  // Two groups: of joint 1 only, of both.
  const std::vector<std::vector<MatrixXd>> groups{{MatrixXd(), more.col(0)}, {more.col(1), x0_.col(0)}};
  EXPECT_EQ(solver.append(groups), (std::vector<Index>{3, 4}));
  EXPECT_EQ(solver.columns(), 5);
  MatrixXd x = MatrixXd::Zero(140, 5);
  x.leftCols(3) = dense(1, 1);
  x.block(70, 3, 70, 1) = more.col(0).head(70);
  x.block(0, 4, 70, 1) = more.col(1).head(70);
  x.block(70, 4, 70, 1) = x0_.col(0).head(70);
  const MatrixXd gram = x.transpose() * x;
  EXPECT_LT((solver.solve({0, 1, 2, 3, 4}).information - gram).norm(), 1e-9);
  EXPECT_LT((solver.cross({0, 2}, 3) - gram({0, 2}, {3, 4})).norm(), 1e-9);
  EXPECT_LT((solver.gram(4, 1) - gram.block(4, 4, 1, 1)).norm(), 1e-9);
  EXPECT_LT((solver.projection(3) - (x.transpose() * right(1, 1)).tail(2)).norm(), 1e-9);
}

}  // namespace
}  // namespace fxdyn::diagnosis
