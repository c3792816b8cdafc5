#include "host_tools/excite/motions.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include "host_tools/excite/pose_walk.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

/// One revolute joint, 2 rad/s and 4 rad/s^2.
LimitCheck one_joint() {
  Robot robot;
  robot.joints.emplace_back();
  robot.joints[0].type = JointType::revolute;
  MotionLimits limits;
  limits.lower = Eigen::VectorXd::Constant(1, -3);
  limits.upper = -limits.lower;
  limits.velocity = Eigen::VectorXd::Constant(1, 2);
  limits.acceleration = Eigen::VectorXd::Constant(1, 4);
  limits.torque = Eigen::VectorXd::Constant(1, 1e30);
  return {robot, limits, {}, 0.0};
}

TEST(Motions, AMoveRestsAtBothEndsAndPeaksInTheMiddle) {
  const Eigen::MatrixXd poses = (Eigen::MatrixXd(2, 1) << 0, 1).finished();
  const Motion motion = dwell_and_move(poses, {2}, 1, 0.01);
  ASSERT_EQ(motion.t.size(), 401);
  EXPECT_EQ(motion.q(100, 0), 0);
  EXPECT_NEAR(motion.q(200, 0), 0.5, 1e-12);
  EXPECT_NEAR(motion.dq(200, 0), 1.875 / 2, 1e-12);
  EXPECT_NEAR(motion.ddq.col(0).maxCoeff(), 5.7735 / 4, 1e-3);
  EXPECT_EQ(motion.q(400, 0), 1);
  EXPECT_EQ(motion.dq(400, 0), 0);
}

TEST(Motions, ASeriesIsPlayedToItsLastInstant) {
  const FourierJoint series{0.3, Eigen::VectorXd::Zero(2), Eigen::VectorXd::Zero(2)};
  const Motion motion = play({series}, 1, 2, 0.1);
  ASSERT_EQ(motion.t.size(), 21);
  EXPECT_NEAR(motion.t[20], 2, 1e-12);
  EXPECT_TRUE((motion.q.array() == 0.3).all());
}

TEST(Motions, AFreeMotionStaysWithinItsLimits) {
  Robot robot;
  robot.joints.resize(1);
  const LimitCheck check = one_joint();
  const Motion motion = free_motion(robot, check.limits());
  EXPECT_LE(motion.dq.cwiseAbs().maxCoeff(), 2);
  EXPECT_GT(motion.dq.cwiseAbs().maxCoeff(), 1.9);
  EXPECT_LE(motion.ddq.cwiseAbs().maxCoeff(), 4);
}

TEST(PoseWalk, AMoveKeepsHalfOfTheLimitsInWholeSteps) {
  const LimitCheck check = one_joint();
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(1), two = Eigen::VectorXd::Constant(1, 2);
  EXPECT_NEAR(move_duration(zero, two, check), 3.8, 1e-12);  // 1.875 * 2 / (0.5 * 2) = 3.75 s
  EXPECT_NEAR(move_duration(zero, zero, check), 0.1, 1e-12);
}

TEST(PoseWalk, NoPoseTwiceInARow) {
  const LimitCheck check = one_joint();
  PoseWalk walk;
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(1), one = Eigen::VectorXd::Ones(1);
  EXPECT_TRUE(walk.extend(zero, check, 0));
  EXPECT_FALSE(walk.extend(zero, check, 0));
  EXPECT_TRUE(walk.extend(one, check, 0));
  ASSERT_EQ(walk.moves_s.size(), 1);
  EXPECT_EQ(walk.matrix().rows(), 2);
  const Motion motion = walk.motion(0.1);
  EXPECT_NEAR(motion.t[motion.t.size() - 1], 2 + walk.moves_s[0], 1e-9);
}

}  // namespace
}  // namespace fxdyn
