#include "host_tools/signals/encoder_edges.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double step = 1e-3;

VectorXd counted(const VectorXd& q) { return (q.array() / step).round() * step; }

TEST(EncoderEdges, SlowMotionAtConstantSpeedIsExactBetweenItsEdges) {
  const VectorXd q = VectorXd::LinSpaced(200, 0, 10 * step);
  const VectorXd found = between_edges(counted(q), step);
  const auto inside = Eigen::seq(15, 180);  // from the first edge to the last
  // An edge is known to half a sample, in which the joint moves a fortieth of a count.
  EXPECT_LT((found - q)(inside).cwiseAbs().maxCoeff(), 0.03 * step);
  EXPECT_GT((counted(q) - q)(inside).cwiseAbs().maxCoeff(), 0.45 * step);
}

TEST(EncoderEdges, FastMotionStaysAsItIs) {
  const VectorXd q = counted(VectorXd::LinSpaced(100, 0, 350 * step));
  EXPECT_EQ(between_edges(q, step), q);
}

TEST(EncoderEdges, AJointThatRestsRests) {
  EXPECT_EQ(between_edges(VectorXd::Constant(50, 3 * step), step), VectorXd::Constant(50, 3 * step));
  // It comes to rest at the last edge that it crossed.
  VectorXd q(8);
  q << 0, 0, 0, 0, 1, 1, 1, 1;
  EXPECT_EQ(between_edges(q * step, step), VectorXd::Constant(8, 0.5 * step));
}

TEST(EncoderEdges, AfterAJumpOverSeveralCountsOnlySamplesAreKnown) {
  VectorXd q(8);
  q << 0, 0, 0, 0, 7, 7, 7, 7;
  EXPECT_EQ(between_edges(q * step, step), q * step);
}

TEST(EncoderEdges, NoValueLeavesItsCount) {
  Random random(5);
  VectorXd q(2000);
  double speed = 0, position = 0;
  for (Index k = 0; k < q.size(); ++k) {
    speed = 0.99 * speed + 0.05 * step * random.normal();
    q[k] = position += speed;
  }
  const VectorXd seen = counted(q), found = between_edges(seen, step);
  EXPECT_LE((found - seen).cwiseAbs().maxCoeff(), 0.5 * step * (1 + 1e-9));
  EXPECT_LT((found - q).norm(), 0.8 * (seen - q).norm());
}

TEST(EncoderEdges, WithoutAStepOrSamplesNothingHappens) {
  const VectorXd q = VectorXd::LinSpaced(20, 0, 1);
  EXPECT_EQ(between_edges(q, 0), q);
  EXPECT_EQ(between_edges(VectorXd(), step).size(), 0);
  EXPECT_EQ(between_edges(VectorXd::Constant(1, 2), step), VectorXd::Constant(1, 2));
}

}  // namespace
}  // namespace fxdyn
