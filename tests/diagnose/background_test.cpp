// Functions whose coefficients are never of interest are eliminated: the rest is fitted as if they were there.

#include "host_tools/diagnose/background.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

class EliminatedBackground : public testing::Test {
 protected:
  static constexpr Index rows = 60;
  static constexpr double prior = 3;

  EliminatedBackground() {
    Random random(7);
    x_.resize(rows, 2);
    b_.resize(rows, 3);
    for (double& value : x_.reshaped()) value = random.normal();
    for (double& value : b_.reshaped()) value = random.normal();
    for (Index c = 0; c < b_.cols(); ++c) b_.col(c) *= std::sqrt(static_cast<double>(rows)) / b_.col(c).norm();
    y_ = x_ * Eigen::Vector2d(2, -1) + b_ * Eigen::Vector3d(0.7, 0, -0.4);
    blocks_.all = blocks_.of_log = {{0, 0, rows, false, true}};
    blocks_.fit = {0};
  }

  MatrixXd x_, b_;
  VectorXd y_;
  Blocks blocks_;
};

TEST_F(EliminatedBackground, LeavesTheCoefficientsOfTheWholeProblem) {
  const Background background(5 * b_, blocks_, prior);  // scaled to RMS 1 again
  const MatrixXd x = background.eliminate(x_), y = background.eliminate(y_);
  ASSERT_EQ(x.rows(), rows + 3);
  const VectorXd reduced = (x.transpose() * x).ldlt().solve(x.transpose() * y);
  MatrixXd all(rows, 5);
  all << x_, b_;
  MatrixXd gram = all.transpose() * all;
  gram.diagonal().tail(3).array() += prior;
  const VectorXd whole = gram.ldlt().solve(all.transpose() * y_);
  EXPECT_LT((reduced - whole.head(2)).norm(), 1e-9);
  // .. and what remains, less the background's part, is the residual of the whole problem.
  const VectorXd rest = y - x * reduced;
  const VectorXd residual = rest.head(rows);
  EXPECT_LT((residual - (y_ - all * whole)).norm(), 1e-9);
  EXPECT_LT((background.part(rest.tail(3)) + b_ * whole.tail(3)).norm(), 1e-9);
}

TEST_F(EliminatedBackground, KnowsOnlyTheRowsThatFit) {
  blocks_.all = {{0, 0, 30, false, true}, {0, 30, 30, false, false}};
  const Background background(b_, blocks_, prior);
  const MatrixXd mine = b_.topRows(30);
  const MatrixXd gram = mine.transpose() * mine + prior * MatrixXd::Identity(3, 3);
  EXPECT_LT((background.inverse() - gram.inverse()).norm(), 1e-9);
}

}  // namespace
}  // namespace fxdyn::diagnosis
