// What each row's noise is taken for: its colour, and how much more of it there is where friction is in doubt.

#include "host_tools/diagnose/noise_model.hpp"

#include <gtest/gtest.h>

#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two logs of 20 rows; the second judges only.
Blocks two_logs() {
  std::vector<SessionLog> logs(2);
  for (SessionLog& log : logs) {
    log.log.first = 0;
    log.log.last = 20;
  }
  logs[1].fits = false;
  return make_blocks(logs);
}

VectorXd nothing_but(Index row, double value) {
  VectorXd doubt = VectorXd::Zero(40);
  doubt[row] = value;
  return doubt;
}

const VectorXd white;

TEST(RowNoise, ADoubtfulRowCountsLess) {
  const NoiseModel noise(two_logs(), {white}, {nothing_but(25, 3)}, 1);
  VectorXd expected = VectorXd::Ones(20);
  EXPECT_EQ(noise.apply(0, 0, VectorXd::Ones(20)), expected);
  expected[5] = 0.5;  // 1 / sqrt(1 + 3)
  EXPECT_LT((noise.apply(1, 0, VectorXd::Ones(20)) - expected).norm(), 1e-14);
}

TEST(RowNoise, WhiteningHandsTheDoubtOnWithinALog) {
  const VectorXd half = VectorXd::Constant(1, 0.5);
  const NoiseModel noise(two_logs(), {half}, {nothing_but(19, 12) + nothing_but(7, 12)}, 1);
  const VectorXd first = noise.apply(0, 0, VectorXd::Ones(20)), second = noise.apply(1, 0, VectorXd::Ones(20));
  EXPECT_EQ(first[0], 0);  // it has no past
  EXPECT_NEAR(first[7], 0.5 / std::sqrt(13), 1e-14);
  EXPECT_NEAR(first[8], 0.5 / 2, 1e-14);  // 0.5^2 * 12 = 3 of it are left
  EXPECT_NEAR(first[9], 0.5, 1e-14);
  EXPECT_NEAR(second[1], 0.5, 1e-14);  // row 19 is the last of another log
}

TEST(RowNoise, RowsBeyondTheLimitAreDoubtful) {
  const NoiseModel noise(two_logs(), {white}, {nothing_but(3, 2.1) + nothing_but(30, 1.9)}, 2);
  EXPECT_TRUE(noise.is_doubtful(0, 3));
  EXPECT_FALSE(noise.is_doubtful(0, 30));
  EXPECT_DOUBLE_EQ(noise.doubtful_share(0), 1.0 / 40);
}

TEST(RowNoise, OnlyRowsThatFitAreInTheLikelihood) {
  const NoiseModel noise(two_logs(), {white, white}, {nothing_but(3, 3), nothing_but(30, 3)}, 1);
  EXPECT_NEAR(noise.log_scale(0), -std::log(2), 1e-14);
  EXPECT_EQ(noise.log_scale(1), 0);
}

/// A PUMA 560's log at full rate whose noise on the second joint is e(k) = 0.8 e(k - 1) + w(k).
class EstimatedNoise : public testing::Test {
 protected:
  EstimatedNoise() {
    log_ = test::small_session_log(model_, Role::train, 3);
    log_.log.decimation = 1;
    log_.log.filter.torque_cutoff_hz = 1000;
    log_.log.tau = predict(model_, log_.log);
    Random random(8);
    for (Index j = 0; j < 6; ++j) {
      double e = 0;
      for (Index k = 0; k < log_.log.samples(); ++k) {
        e = (j == 1 ? 0.8 * e : 0) + 0.1 * random.normal();
        log_.log.tau(k, j) += e;
      }
    }
  }
  const IdentifiedModel model_ = test::fitted_puma();
  SessionLog log_;
};

TEST_F(EstimatedNoise, HasTheColourOfTheResidual) {
  const Linearised problem(test::around(model_), std::vector<SessionLog>{log_});
  // Standard error: 1 / sqrt(4850 rows) = 0.014.
  EXPECT_NEAR(problem.noise().whitening()[1][0], 0.8, 0.06);
  EXPECT_NEAR(problem.noise().whitening()[2][0], 0, 0.06);
  EXPECT_EQ(problem.noise().doubtful_share(1), 0);  // the encoder is exact
  // What is left of the residual is white noise of 0.1 N*m.
  EXPECT_NEAR(1 / std::sqrt(problem.solver().weights()[1]), 0.1, 0.005);
}

TEST_F(EstimatedNoise, IsInDoubtWhereTheEncoderDoesNotShowTheDirection) {
  // 0.5 mrad of white noise through 20 Hz: 2 pi 5e-4 sqrt(2 0.004 20^3 / 3) = 0.0145 rad/s; the sign's width is 0.02.
  log_.log.filter.position_noise[0] = 5e-4;
  const Linearised problem(test::around(model_), std::vector<SessionLog>{log_});
  const double share = problem.noise().doubtful_share(0);
  EXPECT_GT(share, 0.02);
  EXPECT_LT(share, 0.3);
  EXPECT_EQ(problem.noise().doubtful_share(2), 0);
  EXPECT_LT(problem.noise().log_scale(0), 0);
  // The rows near standstill, of which there are some at every reversal.
  const VectorXd dq = log_.log.decimate(problem.motion(0).dq.col(0));
  for (Index row = 0; row < dq.size(); ++row) {
    if (std::fabs(dq[row]) < 0.5) continue;
    EXPECT_FALSE(problem.noise().is_doubtful(0, row)) << dq[row];
  }
}

// A fit of both sessions bends the base parameters that they share, and that would show in the healthy one's residual.
TEST_F(EstimatedNoise, IsTheHealthySessionsWhateverTodayHolds) {
  SessionLog today = log_;
  today.log.tau.col(1) += 20 * (3 * today.log.q.col(1)).array().sin().matrix();
  log_.healthy = true;
  Models models = test::around(model_);
  models.healthy = model_;
  models.has_baseline = true;
  const Linearised problem(models, std::vector<SessionLog>{today, log_});
  EXPECT_NEAR(problem.noise().whitening()[1][0], 0.8, 0.06);
  EXPECT_NEAR(problem.noise().whitening()[2][0], 0, 0.06);
}

TEST_F(EstimatedNoise, KeepsAColourThatIsGiven) {
  const std::vector<VectorXd> given(6, VectorXd::Constant(1, 0.3));
  const Linearised problem(test::around(model_), std::vector<SessionLog>{log_}, given);
  EXPECT_EQ(problem.noise().whitening()[1], given[1]);
}

}  // namespace
}  // namespace fxdyn::diagnosis
