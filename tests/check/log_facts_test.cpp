#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "host_tools/check/check.hpp"
#include "host_tools/support/time_text.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Ten seconds at 500 Hz: at rest, then a sine of both joints, then at rest.
Log log_of(double rest_s, double amplitude, double speed) {
  Log log;
  constexpr Index samples = 5000;
  log.file = "log.csv";
  log.step_s = 0.002;
  log.t = VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
  log.q.resize(samples, 2);
  log.tau.setRandom(samples, 2);
  for (Index k = 0; k < samples; ++k) {
    const double moving = std::clamp(log.t[k] - rest_s, 0.0, 10 - 2 * rest_s);
    log.q.row(k).setConstant(amplitude * std::sin(speed / amplitude * moving));
  }
  return log;
}

Robot two_joints(double limit, double velocity) {
  Robot robot;
  for (const char* name : {"one", "two"}) {
    Joint joint;
    joint.name = name;
    joint.limits = Limits{.lower = -limit, .upper = limit, .velocity = velocity, .effort = 10};
    robot.joints.push_back(joint);
  }
  return robot;
}

std::vector<std::string> kinds(const Log& log, const Robot& robot) {
  const LogFactOptions options;
  std::vector<std::string> out;
  for (const CheckFinding& finding : findings_of({facts_of(log, options)}, robot, options)) {
    EXPECT_FALSE(finding.error);
    out.push_back(finding.kind);
  }
  return out;
}
using Kinds = std::vector<std::string>;

TEST(LogFacts, OfAJointAreOverAllLogs) {
  const Robot robot = two_joints(2, 4);
  const LogFacts slow = facts_of(log_of(0, 1, 1), {}), fast = facts_of(log_of(0, 0.5, 2), {});
  ProcessedLog train;
  train.q.setZero(5000, 2);
  train.saturated = {{}, {{0, 100}, {200, 350}}};
  const std::vector<JointFacts> joints = joints_of({slow, fast}, robot, {train});
  ASSERT_EQ(joints.size(), 2U);
  EXPECT_NEAR(joints[0].lower, -1, 1e-3);
  EXPECT_NEAR(joints[0].upper, 1, 1e-3);
  EXPECT_NEAR(joints[0].speed, 2, 0.01);
  EXPECT_NEAR(joints[0].range_share.value(), 0.5, 1e-3);
  EXPECT_NEAR(joints[0].speed_share.value(), 0.5, 0.01);
  EXPECT_EQ(joints[0].saturated_share, 0);
  EXPECT_NEAR(joints[1].saturated_share, 0.05, 1e-12);
  Robot free = robot;
  free.joints[0].continuous = true;
  free.joints[0].limits->velocity = 0;
  const JointFacts unlimited = joints_of({slow}, free, {})[0];
  EXPECT_FALSE(unlimited.range_share || unlimited.speed_share);
}

TEST(LogFacts, OfAnOrdinaryLogAreNoFindings) {
  const Log log = log_of(0, 1, 2);
  const LogFacts facts = facts_of(log, {});
  EXPECT_NEAR(facts.rate_hz, 500, 1e-6);
  EXPECT_NEAR(facts.seconds, 10, 1e-6);
  EXPECT_NEAR(facts.speed[0], 2, 0.01);
  EXPECT_LT(facts.rest_share, 0.02);
  EXPECT_TRUE(kinds(log, two_joints(2, 3)).empty());
}

TEST(LogFacts, StandstillAtTheEndsIsToldWithItsWindow) {
  const LogFactOptions options;
  const LogFacts facts = facts_of(log_of(2, 1, 2), options);
  EXPECT_NEAR(facts.rest_until_s, 2, 0.03);
  EXPECT_NEAR(facts.rest_from_s, 8, 0.03);
  EXPECT_NEAR(facts.rest_share, 0.4, 0.03);
  const auto findings = findings_of({facts}, two_joints(2, 3), options);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "rest");
  EXPECT_EQ(findings[0].fix.find("from_s = "), 0U);
  EXPECT_NE(findings[0].fix.find("to_s = "), std::string::npos);
}

TEST(LogFacts, TimesHaveMillisecondsWhereverTheyBegin) {
  EXPECT_EQ(time_text(1762000003.2857), "1762000003.286");
  EXPECT_EQ(time_text(2), "2.0");
  EXPECT_EQ(time_text(-1e-5), "0.0");
  EXPECT_EQ(time_text(-12.5), "-12.5");
}

TEST(LogFacts, AJointThatNeverMovesIsTold) {
  Log log = log_of(0, 1, 2);
  log.q.col(1).setConstant(0.3);
  EXPECT_EQ(kinds(log, two_joints(2, 3)), Kinds{"never_moves"});
}

TEST(LogFacts, PositionsAndSpeedsAreComparedWithTheUrdf) {
  const Log log = log_of(0, 1, 2);
  EXPECT_EQ(kinds(log, two_joints(0.7, 3)), (Kinds{"beyond_limits", "beyond_limits"}));
  EXPECT_EQ(kinds(log, two_joints(2, 0.5)), (Kinds{"too_fast", "too_fast"}));
  EXPECT_EQ(kinds(log, two_joints(22, 3)), (Kinds{"little_range", "little_range"}));
}

TEST(LogFacts, ASlideThatGoesFurtherThanItsRailIsInAnotherUnit) {
  Robot robot = two_joints(2, 3);
  robot.joints[0].type = JointType::prismatic;
  const LogFactOptions options;
  const auto first = [&](double scale) {
    Log log = log_of(0, 1, 2);
    log.q.col(0) *= scale;
    const auto findings = findings_of({facts_of(log, options)}, robot, options);
    return findings.empty() ? CheckFinding{} : findings.front();
  };
  EXPECT_EQ(first(1).kind, "");
  EXPECT_EQ(first(5).kind, "beyond_limits");  // the URDF may have it wrong
  EXPECT_FALSE(first(5).error);
  for (const auto& [scale, gain] : {std::pair{1000.0, "0.001"}, std::pair{30.0, "0.01"}}) {
    const CheckFinding finding = first(scale);
    EXPECT_TRUE(finding.error);
    EXPECT_EQ(finding.kind, "too_long");
    EXPECT_NE(finding.fix.find(std::string("position_gain = [") + gain + ", 1]"), std::string::npos) << finding.fix;
  }
}

}  // namespace
}  // namespace fxdyn
