#include "host_tools/vibration/moves.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

IdentifiedModel limited_puma() {
  IdentifiedModel robot = test::puma_with_friction();
  for (JointFit& joint : robot.joints) {
    joint.q_lower = -1.5;
    joint.q_upper = 2;
    joint.dq_limit = 1.2;
    joint.ddq_limit = 4;
  }
  return robot;
}

TEST(Moves, RestMoveAndRestWithinTheLimits) {
  const IdentifiedModel robot = limited_puma();
  const std::vector<Move> moves = make_moves(robot, 0.002, 3);
  ASSERT_EQ(moves.size(), 6U);
  for (const Move& move : moves) {
    const Reference& r = move.reference;
    EXPECT_LE(r.q.maxCoeff(), 2) << move.kind;
    EXPECT_GE(r.q.minCoeff(), -1.5) << move.kind;
    EXPECT_LE(r.dq.cwiseAbs().maxCoeff(), 0.8 * 1.2 * (1 + 1e-9)) << move.kind;
    EXPECT_LE(r.ddq.cwiseAbs().maxCoeff(), 0.8 * 4 * (1 + 1e-9)) << move.kind;
    EXPECT_EQ(r.dq.topRows(move.start).cwiseAbs().maxCoeff(), 0) << move.kind;
    EXPECT_EQ(r.dq.bottomRows(r.q.rows() - move.stop).cwiseAbs().maxCoeff(), 0) << move.kind;
    EXPECT_GT(r.dq.middleRows(move.start, move.stop - move.start).colwise().norm().minCoeff(), 0) << move.kind;
    EXPECT_GE(static_cast<double>(r.q.rows() - move.stop) * r.step_s, rest_s - 1e-9);
  }
}

TEST(Moves, VelocityAndAccelerationAreDerivatives) {
  for (const Move& move : make_moves(limited_puma(), 0.0005, 3)) {
    const Reference& r = move.reference;
    const Index inside = r.q.rows() - 2;
    const MatrixXd dq = (r.q.bottomRows(inside) - r.q.topRows(inside)) / (2 * r.step_s);
    const MatrixXd ddq = (r.dq.bottomRows(inside) - r.dq.topRows(inside)) / (2 * r.step_s);
    EXPECT_LT((dq - r.dq.middleRows(1, inside)).cwiseAbs().maxCoeff(), 2e-5) << move.kind;
    // the jerk jumps where segments begin and end
    EXPECT_LT((ddq - r.ddq.middleRows(1, inside)).cwiseAbs().maxCoeff(), 0.02) << move.kind;
  }
}

TEST(Moves, SlowerIsTheSamePathInMoreTime) {
  for (const Move& move : make_moves(limited_puma(), 0.002, 3)) {
    EXPECT_EQ(slower(move, 0).reference.q, move.reference.q) << move.kind;
    const Index more = 60;
    const Move after = slower(move, more);
    const Reference &r = move.reference, &late = after.reference;
    ASSERT_EQ(late.q.rows(), r.q.rows() + more);
    EXPECT_EQ(after.stop, move.stop + more);
    EXPECT_EQ(after.asked_stop, move.stop);
    EXPECT_EQ(late.dq.bottomRows(late.q.rows() - after.stop).cwiseAbs().maxCoeff(), 0) << move.kind;
    EXPECT_EQ(Eigen::RowVectorXd(late.q.row(late.q.rows() - 1)), Eigen::RowVectorXd(r.q.row(r.q.rows() - 1)));
    const Index moving = move.stop - move.start;
    const double pace = static_cast<double>(moving) / static_cast<double>(moving + more);
    EXPECT_NEAR(late.dq.cwiseAbs().maxCoeff(), pace * r.dq.cwiseAbs().maxCoeff(), 1e-3) << move.kind;
    EXPECT_NEAR(late.ddq.cwiseAbs().maxCoeff(), pace * pace * r.ddq.cwiseAbs().maxCoeff(), 0.02) << move.kind;
    const Index inside = late.q.rows() - 2;
    const MatrixXd dq = (late.q.bottomRows(inside) - late.q.topRows(inside)) / (2 * late.step_s);
    EXPECT_LT((dq - late.dq.middleRows(1, inside)).cwiseAbs().maxCoeff(), 4e-4) << move.kind;
  }
}

TEST(Moves, ASeedIsAMotion) {
  const IdentifiedModel robot = limited_puma();
  EXPECT_EQ(make_moves(robot, 0.002, 3)[0].reference.q, make_moves(robot, 0.002, 3)[0].reference.q);
  const MatrixXd a = make_moves(robot, 0.002, 3)[0].reference.q, b = make_moves(robot, 0.002, 4)[0].reference.q;
  EXPECT_NE(Eigen::RowVectorXd(a.row(0)), Eigen::RowVectorXd(b.row(0)));
}

TEST(SeenMotion, RoundsToTheEncoder) {
  ClosedLoopSettings settings;
  settings.encoder_step = 0.01;
  settings.hold = 2;
  SeenMotion seen(settings, 0.001);
  seen.look(Eigen::VectorXd::Constant(1, 0.1234), Eigen::VectorXd::Constant(1, 7.0));
  EXPECT_NEAR(seen.q()[0], 0.12, 1e-12);
  EXPECT_EQ(seen.dq()[0], 7.0);  // nothing to take a difference to
  seen.look(Eigen::VectorXd::Constant(1, 0.1361), Eigen::VectorXd::Constant(1, 7.0));
  EXPECT_NEAR(seen.q()[0], 0.14, 1e-12);
  EXPECT_NEAR(seen.dq()[0], 0.02 / 0.002, 1e-9);
}

}  // namespace
}  // namespace fxdyn
