#include "host_tools/page/class_means.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

TEST(ClassMeans, OfTwoClassesByHand) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const VectorXd x = (VectorXd(6) << 4, 1, none, 2, 3, 9).finished();
  const VectorXd y = (VectorXd(6) << 10, 2, 99, 4, 8, none).finished();
  const ClassMeans means = class_means(x, y, 2);  // (1, 2), (2, 4) and (3, 8), (4, 10)
  ASSERT_EQ(means.x.size(), 2);
  EXPECT_EQ(means.x, Eigen::Vector2d(1.5, 3.5));
  EXPECT_EQ(means.y, Eigen::Vector2d(3, 9));
  EXPECT_EQ(means.spread, Eigen::Vector2d(1, 1));
  EXPECT_DOUBLE_EQ(means.explained, 1 - 4.0 / 40);  // squares within, and about the mean of 6: 16 + 4 + 4 + 16
}

TEST(ClassMeans, ExplainAFunctionAndNotWhatDoesNotDependOnIt) {
  const VectorXd t = VectorXd::LinSpaced(20'000, 0, 100), x = t.array().sin();
  EXPECT_GT(class_means(x, x.array().cube()).explained, 0.999);
  EXPECT_LT(class_means(x, t.array().cos()).explained, 0.02);  // both signs at each x
  EXPECT_EQ(class_means(x, VectorXd::Constant(x.size(), 2)).explained, 0);
}

TEST(ClassMeans, FewSamplesAreAClassEachAndNoneIsNone) {
  EXPECT_EQ(class_means(Eigen::Vector2d(2, 1), Eigen::Vector2d(5, 6)).y, Eigen::Vector2d(6, 5));
  EXPECT_EQ(class_means(VectorXd(), VectorXd()).x.size(), 0);
}

}  // namespace
}  // namespace fxdyn
