// The weight of a joint's rows in weighted least squares.

#include "host_tools/regression/joint_weight.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fxdyn {
namespace {

TEST(JointWeight, IsOneOverTheMeanSquareOfWhatIsLeft) {
  EXPECT_DOUBLE_EQ(joint_weight(100, 100 * 0.25, 1e4), 4);   // 0.5 N*m RMS are left
  EXPECT_DOUBLE_EQ(joint_weight(400, 400 * 0.25, 4e4), 4);   // as many rows as you like
  EXPECT_DOUBLE_EQ(joint_weight(100, 100 * 0.25, 1e12), 4);  // whatever the torque is
}

TEST(JointWeight, OfNoiseFreeDataIsThatOfAnErrorOf1e9thOfTheTorque) {
  const double mean_square = 30 * 30;  // (N*m)^2
  EXPECT_NEAR(joint_weight(100, 0, 100 * mean_square) * 1e-18 * mean_square, 1, 1e-12);
  // Less than that is rounding: the weight is the same.
  EXPECT_DOUBLE_EQ(joint_weight(100, 1e-20 * 100 * mean_square, 100 * mean_square),
                   joint_weight(100, 0, 100 * mean_square));
}

TEST(JointWeight, IsFiniteWhereAJointCarriesNothing) {
  EXPECT_TRUE(std::isfinite(joint_weight(100, 0, 0)));
  EXPECT_EQ(joint_weight(0, 0, 0), 0);
}

}  // namespace
}  // namespace fxdyn
