#include "host_tools/regression/own_columns.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/error.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two ramp nodes on the paper's inputs, whose arguments are 4 u_1 + 2 and -8 u_2.
BroadLearningFit two_nodes() {
  BroadLearningFit bls;
  bls.inputs = "state";
  bls.activation = "relu";
  bls.middle = 0.5;
  bls.half_range = 2;
  bls.velocity = 4;
  bls.acceleration = 10;
  bls.reference_velocity = 1;
  bls.span = 1;
  bls.weights = MatrixXd::Zero(2, 5);
  bls.weights(0, 0) = 4;
  bls.weights(0, 4) = 2;
  bls.weights(1, 1) = -8;
  return bls;
}

TEST(OwnColumns, AreCountedEffectByEffectThenTheBls) {
  JointFit joint;
  EXPECT_EQ(own_count(joint), 0);
  joint.effects = {test::effect_fit("viscous", {}, {}), test::effect_fit("motor_coupling", {2, 1, 0.1}, {})};
  EXPECT_EQ(own_count(joint), 1 + 3);
  joint.bls = two_nodes();
  EXPECT_EQ(own_count(joint), 1 + 3 + 4 + 2);
}

TEST(OwnColumns, OfABlsAreItsInputsAndItsNodes) {
  JointSeries series;
  series.q = VectorXd{{0.5, 1.5, -3.5}};
  series.dq = VectorXd{{0, 2, -1}};
  series.ddq = VectorXd{{5, 0, -20}};
  series.step_s = 0.004;
  const MatrixXd columns = bls_columns(two_nodes(), 0.01, series);
  // (q - 0.5) / 2, dq / 4, ddq / 10, asinh(dq), each within -1 .. 1; then the ramps / 8.
  MatrixXd expected(3, 6);
  expected << 0, 0, 0.5, 0, 2.0 / 8, 0,  //
      0.5, 0.5, 0, 1, 4.0 / 8, 0,        //
      -1, -0.25, -1, -std::asinh(1), 0, 2.0 / 8;
  EXPECT_LT((columns - expected).cwiseAbs().maxCoeff(), 1e-12) << columns;
}

TEST(OwnColumns, ABlsThatNeedsTheLoadIsRefusedWithoutIt) {
  BroadLearningFit bls = two_nodes();
  bls.inputs = "extended";
  bls.weights = MatrixXd::Zero(2, 9);
  JointSeries series;
  series.q = series.dq = series.ddq = VectorXd::Zero(3);
  series.step_s = 0.004;
  EXPECT_THROW(bls_columns(bls, 0.01, series), InputError);
  series.structural = VectorXd{{0, 0.5, -3}};
  EXPECT_EQ(VectorXd(bls_columns(bls, 0.01, series).col(4)), (VectorXd{{0, 0.5, -1}}));  // over 1 N*m
}

class WithPeers : public testing::Test {
 protected:
  const IdentifiedModel plant_ = test::model_of(test::pendulum(2));
  const ProcessedLog log_ = process(test::exact_log(plant_, Role::train, 1), test::small_filter(2));
  VectorXd kept(const VectorXd& column) const { return log_.decimate(log_.filter_columns(column)); }
};

TEST_F(WithPeers, AJointCouplingIsTheOtherJointsFriction) {
  std::vector<JointFit> designs = plant_.joints;
  designs[1].sign_width = 0.2;
  const MatrixXd rows = rows_with_peers(log_, 0, test::effect_fit("joint_coupling", {2}, {}), designs);
  const VectorXd dq = log_.measured_dq.col(1);
  ASSERT_EQ(rows.cols(), 2);
  EXPECT_LT((rows.col(0) - kept((dq / 0.2).array().tanh())).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((rows.col(1) - kept(dq)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(WithPeers, AMotorCouplingTurnsWithBothJoints) {
  const EffectFit fit = test::effect_fit("motor_coupling", {1, -1, 0.1}, {});
  const MatrixXd rows = rows_with_peers(log_, 1, fit, plant_.joints);
  const VectorXd v = log_.measured_dq.col(1) - log_.measured_dq.col(0);
  ASSERT_EQ(rows.cols(), 3);
  EXPECT_LT((rows.col(0) - kept((v / 0.1).array().tanh())).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((rows.col(1) + kept(log_.measured_dq.col(0))).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((rows.col(2) + kept(log_.measured_ddq.col(0))).cwiseAbs().maxCoeff(), 1e-9);
}

}  // namespace
}  // namespace fxdyn
