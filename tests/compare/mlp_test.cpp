#include "host_tools/compare/mlp.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// y = sin(2 x_0) + x_1^2 / 2, x uniform in -1 .. 1.
Examples examples(Index rows, std::uint64_t seed) {
  Random random(seed);
  Examples out{MatrixXd(rows, 2), VectorXd(rows)};
  for (double& x : out.x.reshaped()) x = random.uniform(-1, 1);
  for (Index r = 0; r < rows; ++r) out.y[r] = std::sin(2 * out.x(r, 0)) + 0.5 * out.x(r, 1) * out.x(r, 1);
  return out;
}

TEST(Mlp, TheGradientIsThatOfFiniteDifferences) {
  const Examples some = examples(40, 1);
  constexpr Index hidden = 5;
  const Mlp net(some, some, hidden, 1, 1, 1);
  Random random(2);
  VectorXd w(hidden * (some.x.cols() + 2) + 1);
  for (double& one : w) one = random.uniform(-1, 1);
  VectorXd gradient, unused;
  net.loss(w, some.x, some.y, gradient);
  ASSERT_EQ(gradient.size(), w.size());
  constexpr double step = 1e-5;
  for (Index i = 0; i < w.size(); ++i) {
    VectorXd up = w, down = w;
    up[i] += step;
    down[i] -= step;
    const double difference =
        (net.loss(up, some.x, some.y, unused) - net.loss(down, some.x, some.y, unused)) / (2 * step);
    EXPECT_NEAR(gradient[i], difference, 1e-8 * std::max(1.0, gradient.norm())) << i;
  }
}

TEST(Mlp, FitsAKnownFunctionOnRowsItHasNotSeen) {
  const Examples train = examples(400, 3), judge = examples(200, 4), test = examples(300, 5);
  const Mlp net(train, judge, 16, 1);
  const double rms = std::sqrt((test.y.array() - test.y.mean()).square().mean());
  const double error = std::sqrt((net(test.x) - test.y).squaredNorm() / 300);
  EXPECT_LT(error, 0.01 * rms);
  EXPECT_NEAR(std::sqrt(net.judged()), std::sqrt((net(judge.x) - judge.y).squaredNorm() / 200), 1e-9);
  EXPECT_EQ(net.multiplications(), 16 * 3);
}

TEST(Mlp, StopsWhereTheJudgingRowsAreBest) {
  // Noise in a few training rows: the longer it trains, the more of that it learns.
  Examples train = examples(40, 6);
  const Examples judge = examples(200, 7);
  Random random(8);
  for (double& y : train.y) y += 0.3 * random.normal();
  const auto judged = [&](const Examples& stopped_by) {
    const Mlp net(train, stopped_by, 32, 1, 1, 400);
    return (net(judge.x) - judge.y).squaredNorm() / 200;
  };
  EXPECT_LT(judged(judge), 0.8 * judged(train));
}

}  // namespace
}  // namespace fxdyn
