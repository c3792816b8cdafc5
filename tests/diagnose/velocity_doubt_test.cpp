// Rows whose friction is in doubt, as the encoder does not show which way the joint moves.

#include "host_tools/diagnose/velocity_doubt.hpp"

#include <gtest/gtest.h>

#include "host_tools/regression/encoder_noise.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/random.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

TEST(EncoderNoise, IsAtLeastThatOfItsStep) {
  FilterFit filter = test::filter_of(10, 10, 0.3);
  filter.position_noise = {1e-5, 1e-5};
  filter.encoder_step = {0, 1e-3};
  EXPECT_EQ(position_noise(filter, 0), 1e-5);
  EXPECT_NEAR(position_noise(filter, 1), 1e-3 / std::sqrt(12), 1e-12);
}

TEST(EncoderNoise, InTheVelocityIsThatOfDifferentiatedWhiteNoise) {
  constexpr double step_s = 0.001, cutoff_hz = 20, sigma = 1e-4;
  FilterFit filter = test::filter_of(cutoff_hz, 10, 0.3);
  filter.position_noise = {sigma};
  filter.encoder_step = {0};
  // White noise as a sum of sines, each differentiated, up to the cut-off.
  constexpr double duration_s = 20;
  double square = 0;
  for (int k = 1; k <= static_cast<int>(cutoff_hz * duration_s); ++k) {
    const double w = 2 * 3.14159265358979 * k / duration_s, power = 2 * step_s * sigma * sigma / duration_s;
    square += w * w * power;
  }
  EXPECT_NEAR(velocity_noise(filter, 0, step_s), std::sqrt(square), 0.005 * std::sqrt(square));
}

TEST(EncoderNoise, InTheVelocityIsWhatTheFilterLeavesOfWhiteNoise) {
  constexpr double step_s = 0.001, sigma = 1e-4;
  constexpr Index rows = 400'000;
  Log log;
  log.step_s = step_s;
  log.t = VectorXd::LinSpaced(rows, 0, step_s * (rows - 1));
  log.q.resize(rows, 1);
  Random random(4);
  for (double& q : log.q.reshaped()) q = sigma * random.normal();
  FilterFit filter = test::filter_of(20, 10, 0.3);
  filter.encoder_step = {0};
  filter.position_noise = choose_filter({log}, {}).position_noise;
  EXPECT_NEAR(filter.position_noise[0], sigma, 0.03 * sigma);
  const ProcessedLog processed = process(log, filter);
  const VectorXd dq = processed.joint_velocity(0).segment(processed.first, processed.last - processed.first);
  // Forward and backward through a Butterworth filter of fourth order, the power falls by (1 + x^8)^-2, x = f / f_c:
  // int x^2 (1 + x^8)^-2 dx = 0.2657, where a wall at f_c has 1 / 3. 16 000 independent values: 0.6 % of it.
  EXPECT_NEAR(test::rms(dq) / velocity_noise(filter, 0, step_s), std::sqrt(3 * 0.2657), 0.03);
}

/// 20 s: a slow motion, and about its middle, where `shakes`, a fast one of 0.3 rad/s (RMS).
VectorXd shaken(bool shakes, double noise = 0) {
  constexpr double step_s = 0.002;
  VectorXd q(10'000);
  Random random(5);
  for (Index k = 0; k < q.size(); ++k) {
    const double t = step_s * static_cast<double>(k), near = std::exp(-std::pow((t - 10) / 0.5, 2));
    q[k] = std::sin(0.6 * t) + noise * random.normal();
    if (shakes) q[k] += near * 0.3 * std::sqrt(2.0) / (2 * 3.14159 * 25) * std::sin(2 * 3.14159 * 25 * t);
  }
  return q;
}

/// What a filter of 10 Hz takes away of it, where the motion sinks into the noise at 40 Hz.
VectorXd lost(const VectorXd& q, double noise, double ends_hz = 40) {
  FilterFit filter = test::filter_of(10, 10, 0.3);
  filter.crossing_hz = ends_hz;
  filter.position_noise = {noise};
  filter.encoder_step = {0};
  return lost_velocity(q, ZeroPhaseFilter(10, 0.002).apply(q).col(0), filter, 0, 0.002);
}

TEST(LostVelocity, IsThatOfTheMotionThatTheFilterTakesAway) {
  const VectorXd of = lost(shaken(true), 1e-6);
  ASSERT_EQ(of.size(), 10'000);
  EXPECT_NEAR(of[5'000], 0.3, 0.03);
  EXPECT_LT(of.segment(1'000, 2'000).maxCoeff(), 0.003);
}

TEST(LostVelocity, IsNoneInNoiseAndWhereNothingIsFaster) {
  EXPECT_EQ(lost(shaken(false, 1e-4), 1e-4).size(), 0);
  EXPECT_EQ(lost(shaken(true), 1e-6, 8).size(), 0) << "the filter passes all of the motion";
}

TEST(LostVelocity, IsNoneOfTheStepsOfACoarseEncoder) {
  FilterFit filter = test::filter_of(10, 10, 0.3);
  filter.crossing_hz = 40;
  filter.encoder_step = {1e-3};
  filter.position_noise = {1e-3 / std::sqrt(12.0)};
  // From rest to 0.3 rad/s and back: steps come more slowly than either filter passes, then faster.
  const VectorXd t = VectorXd::LinSpaced(10'000, 0, 20);
  const VectorXd exact = 0.5 * (0.6 * t.array()).sin();
  const VectorXd q = (exact.array() / 1e-3).round() * 1e-3;
  const VectorXd of = lost_velocity(q, ZeroPhaseFilter(10, 0.002).apply(q).col(0), filter, 0, 0.002);
  // Of what may be wrong where they come slowly, 40 Hz times a step.
  EXPECT_LT(of.size() == 0 ? 0 : of.maxCoeff(), 2 * 40 * 1e-3);
  EXPECT_LT(of.size() == 0 ? 0 : (of.array() > 0).cast<double>().mean(), 0.05);
}

TEST(LostVelocity, IsOfLogsThatHaveNoVelocityOfTheirOwn) {
  Log log;
  log.step_s = 0.002;
  log.q = shaken(true);
  log.t = VectorXd::LinSpaced(log.q.rows(), 0, 0.002 * static_cast<double>(log.q.rows() - 1));
  FilterFit filter = test::filter_of(10, 10, 0.3);
  filter.crossing_hz = 40;
  filter.position_noise = {1e-6};
  filter.encoder_step = {0};
  EXPECT_NEAR(process(log, filter).lost_velocity(5'000, 0), 0.3, 0.03);
  log.dq = log.q;
  EXPECT_EQ(process(log, filter).lost_velocity.size(), 0);
}

/// 10 s at 250 samples a second: at rest, then at 0.5 rad/s.
class Doubt : public testing::Test {
 protected:
  static constexpr Index samples = 2500;

  Doubt() {
    log_.step_s = 0.004;
    log_.q = Eigen::MatrixXd::Zero(samples, 1);
    log_.first = 100;
    log_.last = samples - 100;
    log_.decimation = 10;
    log_.filter = test::filter_of(20, 10, 0.3);
    log_.filter.position_noise = {1e-4};
    log_.filter.encoder_step = {0};
    joint_.sign_width = 0.01;
    joint_.effects = {test::effect("coulomb", {}, {2})};
    dq_.tail(samples / 2).setConstant(0.5);
  }
  VectorXd doubt(double sigma = 0.1) const { return velocity_doubt(log_, 0, joint_, dq_, load_, sigma); }

  ProcessedLog log_;
  JointFit joint_;
  VectorXd dq_ = VectorXd::Zero(samples), load_ = VectorXd::Constant(samples, 10);
};

TEST_F(Doubt, IsWhereTheJointStandsStill) {
  const VectorXd u = doubt();
  ASSERT_EQ(u.size(), log_.rows());
  // Whatever the sign: (4 / 2 F / sigma)^2 of a row, and all rows at rest have one error between them.
  EXPECT_GT(u.head(80).minCoeff(), 400);
  EXPECT_LT(u.tail(80).maxCoeff(), 1e-3);
}

TEST_F(Doubt, IsWhereTheFilterTookAsFastAMotionAway) {
  const double before = doubt().tail(80).maxCoeff();
  log_.lose(0, 1, VectorXd::Constant(samples, 0.3));
  log_.lose(0, 1, VectorXd::Constant(samples, 0.4));  // by a second filter: 0.5 rad/s together
  EXPECT_DOUBLE_EQ(log_.lost_velocity(0, 0), 0.5);
  EXPECT_LT(before, 1e-3);
  EXPECT_GT(doubt().tail(80).minCoeff(), 100);
  // It moves there: its rows do not share one error, as those of a joint at rest do.
  EXPECT_LT(doubt().tail(80).maxCoeff(), 4 * 2 * 2 / (0.1 * 0.1));
}

TEST_F(Doubt, GrowsWithTheSquareOfFrictionOverNoise) {
  EXPECT_NEAR(doubt(0.05)[50] / doubt(0.1)[50], 4, 1e-9);
  const double before = doubt()[50];
  joint_.effects.push_back(test::effect("load_friction", {}, {0.2}));  // 2 N*m more at this load
  EXPECT_NEAR(doubt()[50] / before, 4, 1e-9);
}

TEST_F(Doubt, IsNoneWithoutFrictionOrNoiseOrWithAMeasuredVelocity) {
  const VectorXd none = VectorXd::Zero(log_.rows());
  ProcessedLog measured = log_;
  measured.measured_dq = dq_;
  EXPECT_EQ(velocity_doubt(measured, 0, joint_, dq_, load_, 0.1), none);
  ProcessedLog exact = log_;
  exact.filter.position_noise = {0};
  EXPECT_EQ(velocity_doubt(exact, 0, joint_, dq_, load_, 0.1), none);
  joint_.effects.clear();
  EXPECT_EQ(doubt(), none);
}

TEST_F(Doubt, SwingsByAllFrictionAtRestAndByNoneInMotion) {
  log_.filter.position_noise = {1e-3};
  const VectorXd swing = friction_swing(log_, 0, joint_, dq_, load_, 3);
  ASSERT_EQ(swing.size(), samples);
  EXPECT_GT(swing.head(samples / 2).minCoeff(), 0.9 * 2 * 2);
  EXPECT_LE(swing.maxCoeff(), 2 * 2);
  EXPECT_LT(swing.tail(samples / 2).maxCoeff(), 1e-3);
  log_.filter.position_noise = {0};
  EXPECT_EQ(friction_swing(log_, 0, joint_, dq_, load_, 3), VectorXd::Zero(samples));
}

}  // namespace
}  // namespace fxdyn::diagnosis
