#include "host_tools/logs/units.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

constexpr double degrees = 180 / std::numbers::pi;

/// Sines at 250 samples a second for 20 s, with their velocities.
Log sines(Index joints, double amplitude, double frequency_hz) {
  constexpr Index samples = 5000;
  Log log;
  log.step_s = 0.004;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, 0.004 * (samples - 1));
  log.q.resize(samples, joints);
  log.dq.resize(samples, joints);
  for (Index j = 0; j < joints; ++j) {
    const double w = 2 * std::numbers::pi * frequency_hz * (1 + 0.1 * static_cast<double>(j));
    log.q.col(j) = amplitude * (w * log.t.array()).sin();
    log.dq.col(j) = amplitude * w * (w * log.t.array()).cos();
  }
  return log;
}

/// What check_units() says; empty: nothing.
std::string said(const Log& log, const std::vector<bool>& revolute) {
  try {
    check_units(log, revolute, "arm.csv");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}
std::string said(const Log& log) { return said(log, std::vector<bool>(static_cast<std::size_t>(log.joints()), true)); }

void expect_said(const Log& log, const std::string& part) {
  const std::string text = said(log);
  EXPECT_EQ(text.rfind("arm.csv: ", 0), 0U) << text;
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

TEST(Units, RadiansAndSecondsAreFine) {
  EXPECT_EQ(said(sines(3, 1.2, 0.3)), "");
  Log log = sines(3, 1.2, 0.3);
  log.dq.resize(0, 0);
  EXPECT_EQ(said(log), "");
}

TEST(Units, DegreesInThePositionOrTheVelocityAreNamed) {
  Log log = sines(2, 1.2, 0.3);
  log.q.col(1) *= degrees;
  expect_said(log, "q2 looks like degrees (the position changes 57.3 times as fast as dq says)");
  expect_said(log, "position_gain = [1, 0.0174532925]");
  log.q.col(0) *= degrees;
  expect_said(log, "q1 and q2 look like degrees");
  expect_said(log, "position_gain = [0.0174532925, 0.0174532925]");
  log = sines(2, 1.2, 0.3);
  log.dq.col(0) *= degrees;
  expect_said(log, "dq1 looks like degrees (q1 changes only 0.017");
  expect_said(log, "columns = { dq = false }");
  log.ddq = log.dq;
  expect_said(log, "columns = { dq = false, ddq = false }");
}

TEST(Units, MillisecondsAreNamed) {
  Log log = sines(2, 1.2, 0.3);
  log.t *= 1000;
  log.step_s *= 1000;
  expect_said(log, "t looks like milliseconds");
}

TEST(Units, ASlidingJointHasNoDegrees) {
  Log log = sines(1, 1.2, 0.3);
  log.q *= degrees;
  EXPECT_EQ(said(log, {false}), "");
  EXPECT_NE(said(log, {true}), "");
}

TEST(Units, AnotherFactorOrAVelocityOfAnotherMotionTellsNothing) {
  Log log = sines(1, 1.2, 0.3);
  log.q *= 10;  // no unit is a factor of ten away
  EXPECT_EQ(said(log), "");
  log = sines(1, 1.2, 0.3);
  log.t *= 1000;
  log.step_s *= 1000;
  ASSERT_NE(said(log), "");
  log.dq = sines(1, 1.2, 0.5).dq;
  EXPECT_NO_THROW(check_units(log, {true}, "arm.csv", true));
}

TEST(Units, RowsFarApartInWhichNothingMovesAreMilliseconds) {
  Log log = sines(2, 0.5, 0.0075);  // 0.3 Hz at 10 kHz
  log.dq.resize(0, 0);
  log.step_s = 0.1;
  log.t = Eigen::VectorXd::LinSpaced(log.samples(), 0, 0.1 * static_cast<double>(log.samples() - 1));
  expect_said(log, "t looks like milliseconds (as seconds no joint turns faster than 0.0");
  // Where the project says seconds, it is that slow; and a slow log of moving joints is one.
  EXPECT_NO_THROW(check_units(log, {true, true}, "arm.csv", true));
  log.q.col(0) *= 30;
  EXPECT_EQ(said(log), "");
}

TEST(Units, WithoutVelocityARangeAtSpeedIsDegrees) {
  Log log = sines(1, 100, 0.3);  // 200 degrees, up to 188 a second
  log.dq.resize(0, 0);
  expect_said(log, "q1 looks like degrees (range 200");
  expect_said(log, "position_gain = [0.0174532925]");
  // A wheel: so many radians, at a robot's speed.
  log.q = 60 * (0.05 * log.t.array()).sin().matrix();
  EXPECT_EQ(said(log), "");
  // More than degrees of an arm: a spindle.
  log = sines(1, 500, 0.3);
  log.dq.resize(0, 0);
  EXPECT_EQ(said(log), "");
}

TEST(Units, ASlowArmWhoseJointsNearlyAllTurnMoreThanTwiceIsInDegrees) {
  Log log = sines(4, 10, 0.06);  // 20 rad each
  log.dq.resize(0, 0);
  log.q.col(3) *= 0.1;
  expect_said(log, "q looks like degrees (3 of 4 joints turn more than twice)");
  log.q.col(2) *= 0.1;
  EXPECT_EQ(said(log), "");
  // Two joints are no arm.
  Log two = sines(2, 10, 0.06);
  two.dq.resize(0, 0);
  EXPECT_EQ(said(two), "");
}

}  // namespace
}  // namespace fxdyn
