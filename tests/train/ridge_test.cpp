#include "host_tools/train/ridge.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Data {
  MatrixXd x;
  VectorXd y;
};

Data random_data(Index rows, Index columns) {
  Random random(3);
  Data d{MatrixXd(rows, columns), VectorXd(rows)};
  for (Index c = 0; c < columns; ++c) {
    for (Index r = 0; r < rows; ++r) d.x(r, c) = random.normal() + (c > 0 ? 0.9 * d.x(r, c - 1) : 0);
  }
  for (Index r = 0; r < rows; ++r) d.y[r] = d.x.row(r).sum() + 0.1 * random.normal();
  return d;
}

VectorXd straightforward(const Data& d, Index n, double ridge) {
  const MatrixXd x = d.x.leftCols(n);
  MatrixXd gram = x.transpose() * x;
  gram.diagonal().array() += ridge * static_cast<double>(d.y.size());
  return gram.ldlt().solve(x.transpose() * d.y);
}

TEST(GrowingRidge, EveryNumberOfColumnsIsTheFitFromScratch) {
  const Data d = random_data(400, 30);
  Moments moments(30);
  moments.add(d.x.topRows(150), d.y.head(150));
  moments.add(d.x.bottomRows(250), d.y.tail(250));
  for (const double ridge : {0.0, 1e-4, 1e-1}) {
    GrowingRidge grown(moments, ridge);
    for (const Index n : {1, 2, 7, 19, 30}) {
      const VectorXd expected = straightforward(d, n, ridge), w = grown.solve(n);
      EXPECT_LT((w - expected).norm(), 1e-9 * expected.norm()) << n << ' ' << ridge;
      const double error = (d.y - d.x.leftCols(n) * expected).squaredNorm() / 400;
      EXPECT_NEAR(moments.mean_square(w), error, 1e-9 * moments.square / 400);
    }
    // Fewer again: nothing was lost.
    EXPECT_LT((grown.solve(7) - straightforward(d, 7, ridge)).norm(), 1e-9);
  }
}

TEST(GrowingRidge, AColumnThatIsThereAlreadyGetsNothing) {
  Data d = random_data(100, 4);
  d.x.col(2) = d.x.col(0) - 2 * d.x.col(1);
  Moments moments(4);
  moments.add(d.x, d.y);
  GrowingRidge grown(moments, 0);
  const VectorXd w = grown.solve(4);
  EXPECT_NEAR(w[2], 0, 1e-100);
  Data three{MatrixXd(100, 3), d.y};
  three.x << d.x.leftCols(2), d.x.col(3);
  const VectorXd expected = straightforward(three, 3, 0);
  EXPECT_NEAR(w[0], expected[0], 1e-8);
  EXPECT_NEAR(w[3], expected[2], 1e-8);
}

}  // namespace
}  // namespace fxdyn
