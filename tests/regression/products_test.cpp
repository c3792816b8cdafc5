#include "host_tools/regression/products.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "host_tools/support/random.hpp"
#include "host_tools/support/vectors.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Rows {
  MatrixXd base, own;
  VectorXd weights, torque;

  Rows(Index rows, Index base_columns, Index own_columns) {
    Random random(static_cast<std::uint64_t>(rows + 100 * own_columns));
    const auto draw = [&] { return random.normal(); };
    base = MatrixXd::NullaryExpr(rows, base_columns, draw);
    own = MatrixXd::NullaryExpr(rows, own_columns, draw);
    torque = VectorXd::NullaryExpr(rows, draw);
    weights = VectorXd::NullaryExpr(rows, [&] { return random.uniform() < 0.2 ? 0 : random.uniform(0.5, 2); });
  }
  JointMoments products() const { return weighted_products(base, own, weights, torque); }
};

TEST(Products, AreTheSumsOfASmallExample) {
  MatrixXd base(3, 1), own(3, 2);
  base << 1, 2, 3;
  own << 1, 0, 2, 1, 0, 4;
  const VectorXd weights{{1, 0.5, 2}}, torque{{10, 20, 30}};
  const JointMoments sums = weighted_products(base, own, weights, torque);
  EXPECT_EQ(sums.cross, (MatrixXd(1, 2) << 1 + 2, 1 + 24).finished());
  EXPECT_EQ(sums.gram, (MatrixXd(2, 2) << 3, 1, 1, 32.5).finished());
  EXPECT_EQ(sums.projection, (VectorXd{{30, 250}}));
}

/// Numbers of rows, base columns and own columns: whole panels, parts of them, none.
class ProductsOf : public testing::TestWithParam<std::array<Index, 3>> {};

TEST_P(ProductsOf, AreThoseOfTheMatrices) {
  const auto [count, base, own] = GetParam();
  const Rows rows(count, base, own);
  const JointMoments sums = rows.products();
  const MatrixXd weighted = rows.weights.asDiagonal() * rows.own;
  const double tolerance = 1e-13 * static_cast<double>(count);
  ASSERT_EQ(sums.cross.rows(), base);
  ASSERT_EQ(sums.gram.cols(), own);
  EXPECT_LE((sums.cross - rows.base.transpose() * weighted).norm(), tolerance);
  EXPECT_LE((sums.gram - rows.own.transpose() * weighted).norm(), tolerance);
  EXPECT_LE((sums.projection - weighted.transpose() * rows.torque).norm(), tolerance);
  EXPECT_EQ(sums.gram, sums.gram.transpose().eval());
}

TEST_P(ProductsOf, HaveTheSameBitsWhateverTheProcessor) {
  const auto [count, base, own] = GetParam();
  const Rows rows(count, base, own);
  const JointMoments wide = rows.products();
  const int widest = at_once;
  for (const int width : {4, 2}) {
    at_once = std::min(widest, width);
    const JointMoments narrow = rows.products();
    at_once = widest;
    EXPECT_EQ(narrow.cross, wide.cross) << width;
    EXPECT_EQ(narrow.gram, wide.gram) << width;
    EXPECT_EQ(narrow.projection, wide.projection) << width;
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, ProductsOf,
                         testing::Values(std::array<Index, 3>{256, 4, 8}, std::array<Index, 3>{257, 5, 9},
                                         std::array<Index, 3>{1000, 3, 1}, std::array<Index, 3>{700, 13, 27},
                                         std::array<Index, 3>{10, 2, 0}, std::array<Index, 3>{10, 0, 3}));

}  // namespace
}  // namespace fxdyn
