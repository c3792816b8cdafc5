#include "host_tools/diagnose/thinning.hpp"
#include "host_tools/diagnose/sessions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double fast_step = 2.5e-4;
constexpr Index recorded = 20001, every = 8;

VectorXd sine_of(double hz) {
  return VectorXd::NullaryExpr(
      recorded, [&](Index i) { return std::sin(2 * std::numbers::pi * hz * fast_step * static_cast<double>(i)); });
}

/// A log of one joint at 4 kHz.
ProcessedLog log_at_4_khz() {
  ProcessedLog log;
  log.step_s = fast_step;
  log.t = VectorXd::LinSpaced(recorded, 0, fast_step * (recorded - 1));
  log.q = sine_of(2);
  log.lost_velocity = sine_of(1);
  log.first = 401;
  log.last = 19601;
  log.decimation = 25;
  log.filter.torque_cutoff_hz = 30;
  log.saturated = {{{803, 809}}};
  return log;
}

TEST(Thinning, MotionKeepsItsTimesAndDerivatives) {
  const ProcessedLog log = log_at_4_khz(), out = thinned(log, every);
  ASSERT_EQ(out.samples(), 2501);
  EXPECT_DOUBLE_EQ(out.step_s, 2e-3);
  EXPECT_DOUBLE_EQ(out.t[100], log.t[800]);
  ASSERT_EQ(out.lost_velocity.rows(), 2501);
  EXPECT_DOUBLE_EQ(out.lost_velocity(100, 0), log.lost_velocity(800, 0));
  EXPECT_EQ(out.kept_each, every);
  EXPECT_GE(out.first * every, log.first);
  EXPECT_LE((out.last - 1) * every, log.last - 1);
  EXPECT_EQ(out.saturated[0][0], (std::array<Index, 2>{100, 102}));
  const MotionRows motion = out.motion();
  for (Index i = out.first; i < out.last; ++i)
    EXPECT_NEAR(motion.ddq(i, 0), -std::pow(4 * std::numbers::pi, 2) * log.q(i * every, 0), 1e-4);
}

TEST(Thinning, TorqueInItsBandStaysAndNothingFoldsIntoIt) {
  ProcessedLog log = log_at_4_khz();
  log.tau = sine_of(20) + sine_of(480);  // 480 Hz would be 20 Hz at 500 samples a second
  const ProcessedLog out = thinned(log, every);
  const VectorXd wanted = sine_of(20);
  for (Index i = out.first; i < out.last; ++i) EXPECT_NEAR(out.tau(i, 0), wanted[i * every], 2e-3);
}

TEST(Thinning, WhiteNoiseKeepsItsDensity) {
  ProcessedLog log = log_at_4_khz();
  Random random(1);
  log.tau = VectorXd::NullaryExpr(recorded, [&](Index) { return random.normal(); });
  const ProcessedLog out = thinned(log, every);
  const auto rms = [](const ProcessedLog& of) {
    return of.decimate(of.filter_columns(of.tau)).norm() / std::sqrt(static_cast<double>(of.rows()));
  };
  EXPECT_NEAR(rms(out), rms(log), 0.02 * rms(log));
}

TEST(Thinning, OfOneLeavesALogAsItIs) {
  ProcessedLog log = log_at_4_khz();
  log.tau = sine_of(480);
  const ProcessedLog out = thinned(log, 1);
  EXPECT_EQ(out.tau, log.tau);
  EXPECT_EQ(out.kept_each, 1);
}

TEST(Thinning, SessionsHoldWhatTheBandNeeds) {
  ProcessedLog log = log_at_4_khz();
  log.tau = sine_of(20);
  log.filter.position_cutoff_hz = 1600;
  log.filter.excited_hz = 2;
  std::optional<Session> session;
  const auto rate = [&] { return 1 / sessions({log}, {}, session, {}).front().log.step_s; };
  EXPECT_NEAR(rate(), 500, 1e-6);
  log.filter.torque_cutoff_hz = 40;
  EXPECT_NEAR(rate(), 4000.0 / 6, 1e-6);
  log.filter.excited_hz = 1000;  // the positions stay as they are
  EXPECT_NEAR(rate(), 4000, 1e-6);
}

TEST(Thinning, SessionsOfOtherRatesHaveRowsAtOneInterval) {
  ProcessedLog log = log_at_4_khz();
  log.tau = sine_of(20);
  log.filter.torque_cutoff_hz = 40;
  log.filter.position_cutoff_hz = 200;
  std::optional<Session> session;
  const auto interval = [](const SessionLog& entry) {
    return entry.log.step_s * static_cast<double>(entry.log.decimation);
  };
  // 200 Hz would keep every second row, 500 Hz every sixth
  for (const SessionLog& entry : sessions({thinned(log, 8)}, {thinned(log, 20)}, session, {}))
    EXPECT_NEAR(interval(entry), 0.01, 1e-9) << entry.log.step_s;
}

}  // namespace
}  // namespace fxdyn::diagnosis
