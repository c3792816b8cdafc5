// What a group of columns gains beside others: by products alone.

#include "host_tools/diagnose/gain.hpp"

#include <gtest/gtest.h>

namespace fxdyn::diagnosis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double free = -1e300;

Reduced products(const MatrixXd& x, const VectorXd& y) {
  const MatrixXd gram = x.transpose() * x;
  return {gram, x.transpose() * y, gram.diagonal()};
}

const MatrixXd x = (MatrixXd(4, 2) << 1, 0, 1, 1, 0, 2, 1, -1).finished();
const VectorXd y = (VectorXd(4) << 1, 2, 3, 0.5).finished();

TEST(GainOfColumns, IsTheReductionOfTheSquares) {
  const VectorXd theta = x.colPivHouseholderQr().solve(y);
  const Gain gain = gain_of(products(x, y), {free, free}, false, 3);
  EXPECT_NEAR(gain.square, y.squaredNorm() - (y - x * theta).squaredNorm(), 1e-9);
  EXPECT_LT((gain.theta - theta).norm(), 1e-9);
  EXPECT_EQ(gain.rank, 2);
}

TEST(GainOfColumns, CountsADirectionOnce) {
  MatrixXd twice(4, 2);
  twice << x.col(0), 3 * x.col(0);
  const Gain gain = gain_of(products(twice, y), {free, free}, false, 3),
             one = gain_of(products(x.col(0), y), {free}, false, 3);
  EXPECT_EQ(gain.rank, 1);
  EXPECT_NEAR(gain.square, one.square, 1e-9);
}

TEST(GainOfColumns, IsNothingBeyondABound) {
  EXPECT_GT(gain_of(products(x.col(0), y), {0}, false, 3).square, 0);
  EXPECT_EQ(gain_of(products(x.col(0), -y), {0}, false, 3).square, 0);
  // Of several, clearly beyond: by more than three standard deviations, here 1 / sqrt(3) each.
  EXPECT_EQ(gain_of(products(x, -10 * y), {0, 0}, false, 3).square, 0);
  EXPECT_GT(gain_of(products(x, -0.1 * y), {0, 0}, false, 3).square, 0);
}

TEST(GainOfColumns, OfAShareIsThatOfOne) {
  const Reduced of = products(x.col(0), 2 * x.col(0));
  EXPECT_NEAR(gain_of(of, {0}, true, 3).square, (2 * x.col(0)).squaredNorm() - x.col(0).squaredNorm(), 1e-9);
}

TEST(GainOfColumns, IsNothingWhereOthersHaveTakenAll) {
  Reduced of = products(x.col(0), y);
  of.gram *= 1e-6;
  const Gain gain = gain_of(of, {free}, false, 3);
  EXPECT_EQ(gain.rank, 0);
  EXPECT_EQ(gain.square, 0);
  EXPECT_NEAR(gain.kept, 1e-6, 1e-12);
}

}  // namespace
}  // namespace fxdyn::diagnosis
