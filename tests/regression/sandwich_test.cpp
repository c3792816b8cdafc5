// Covariances of a mean whose residuals are correlated.

#include "host_tools/regression/sandwich.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(Sandwich, EqualResidualsInABlockCountOnce) {
  // Two blocks of three rows: sums 3 and -6, times B / (B - p) = 2.
  const VectorXd residual = (VectorXd(6) << 1, 1, 1, -2, -2, -2).finished();
  EXPECT_DOUBLE_EQ(middle_of_blocks(MatrixXd::Ones(6, 1), residual, {3, 6})(0, 0), 2 * (9 + 36));
}

TEST(Sandwich, LagsCountOncePerPairOfRows) {
  // gamma 2 on four rows, gamma 1 on three pairs, either way round.
  EXPECT_DOUBLE_EQ(middle_of_lags(MatrixXd::Ones(4, 1), Eigen::Vector2d(2, 1))(0, 0), 4 * 2 + 2 * 3 * 1);
}

TEST(Sandwich, IndependentRowsGiveTheUsualCovariance) {
  Random random(1);
  const Eigen::Index n = 4000;
  VectorXd residual(n);
  MatrixXd x(n, 2);
  std::vector<Eigen::Index> ends;
  for (Eigen::Index k = 0; k < n; ++k) {
    residual[k] = 0.5 * random.normal();
    x.row(k) << 1, random.normal();
    ends.push_back(k + 1);
  }
  const MatrixXd bread = (x.transpose() * x).inverse(), usual = 0.25 * bread;
  EXPECT_TRUE(sandwich(bread, middle_of_blocks(x, residual, ends)).isApprox(usual, 0.1));
  const VectorXd gamma = autocovariance(residual, 0.05);
  EXPECT_EQ(gamma.size(), 1);
  EXPECT_TRUE(sandwich(bread, middle_of_lags(x, gamma)).isApprox(usual, 0.1));
}

TEST(Sandwich, AutocovarianceEndsWhereItHasFaded) {
  // Each value twice: lag 1 is half of lag 0.
  Random random(2);
  VectorXd residual(4000);
  for (Eigen::Index k = 0; k < 4000; k += 2) residual[k] = residual[k + 1] = random.normal();
  const VectorXd gamma = autocovariance(residual, 0.1);
  ASSERT_EQ(gamma.size(), 2);
  EXPECT_NEAR(gamma[1] / gamma[0], 0.5, 0.05);
}

}  // namespace
}  // namespace fxdyn
