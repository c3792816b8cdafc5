#include "host_tools/diagnose/evidence.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "tests/diagnose/arm.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

TEST(Evidence, TheGapShrinksInDoubleInFixedPointAndForward) {
  const test::Arm arm("shrinks");
  const std::vector<ProcessedLog> logs{arm.log(0), arm.log(1)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  const json evidence = evidence_json(test::without(truth, "stribeck"), truth, logs);

  ASSERT_EQ(evidence.at("held_out").size(), 2U);
  EXPECT_EQ(evidence.at("held_out")[0].at("file"), "a.csv");
  EXPECT_TRUE(evidence.at("fixed_point").at("computed").get<bool>()) << evidence.dump(1);
  ASSERT_EQ(evidence.at("joints").size(), 2U);
  const json& shoulder = evidence.at("joints")[0];
  EXPECT_EQ(shoulder.at("joint"), "shoulder");
  EXPECT_EQ(shoulder.at("index"), 1);
  EXPECT_EQ(shoulder.at("unit"), "N*m");
  const double before = shoulder.at("rms_before"), after = shoulder.at("rms_after");
  EXPECT_GT(before, 5 * after);
  EXPECT_NEAR(after, shoulder.at("noise_floor").get<double>(), 0.5 * after);
  EXPECT_NEAR(shoulder.at("rms_after_fixed").get<double>(), after, 0.02 * after);
  // The elbow lacks nothing: the same before and after.
  EXPECT_EQ(evidence.at("joints")[1].at("rms_before"), evidence.at("joints")[1].at("rms_after"));
}

TEST(Evidence, ThePlantThatLacksNothingFollowsTheRecordedMotionByItself) {
  const test::Arm arm("forward");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  const json forward = evidence_json(test::without(truth, "stribeck"), truth, logs).at("forward");
  EXPECT_EQ(forward.at("log"), "a.csv");
  EXPECT_NEAR(forward.at("seconds").get<double>(), 8 - 2 * 0.3, 0.02);
  EXPECT_FALSE(forward.contains("failed")) << forward.dump(1);
  const json& shoulder = forward.at("joints")[0];
  EXPECT_EQ(shoulder.at("tracking_unit"), "rad");
  EXPECT_LT(shoulder.at("tracking_after").get<double>(), 0.5 * shoulder.at("tracking_before").get<double>());
  EXPECT_LT(shoulder.at("torque_after").get<double>(), 0.5 * shoulder.at("torque_before").get<double>());
}

TEST(Evidence, WhatChangesTheMeasuredTorqueIsTakenOutOfItBeforeItDrivesThePlant) {
  const test::Arm arm("gain");
  std::vector<ProcessedLog> logs{arm.log(0)};
  logs[0].tau *= 1.2;
  const IdentifiedModel nominal = arm.truth(logs[0]);
  IdentifiedModel truth = nominal;
  for (JointFit& joint : truth.joints) joint.effects.push_back({"torque_gain", {}, {0.2}, {}, {}, true});
  const json shoulder = evidence_json(nominal, truth, logs).at("forward").at("joints").at(0);
  EXPECT_LT(shoulder.at("tracking_after").get<double>(), 0.5 * shoulder.at("tracking_before").get<double>());
  EXPECT_LT(shoulder.at("torque_after").get<double>(), 0.5 * shoulder.at("torque_before").get<double>());
}

TEST(Evidence, APlantThatNoBodyOfMatterHasIsSaidAndNotFatal) {
  const test::Arm arm("no_plant");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  IdentifiedModel impossible = truth;
  impossible.inertia[1].zz = impossible.inertia[1].yy = impossible.inertia[1].xx = -5;
  const json forward = evidence_json(impossible, truth, logs).at("forward");
  EXPECT_FALSE(forward.at("failed").at("before").get<std::string>().empty());
  EXPECT_FALSE(forward.at("failed").contains("after"));
  EXPECT_TRUE(forward.at("joints")[0].at("tracking_before").is_null());
  EXPECT_TRUE(forward.at("joints")[0].at("tracking_after").is_number());
}

TEST(Evidence, AModelThatFixedPointCannotHoldIsSaidAndNotFatal) {
  const test::Arm arm("no_fixed");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  IdentifiedModel wild = truth;
  wild.joints[1].effects.push_back({"elasticity", {0.01}, {1e9}, {}, {}, true});  // soft as nothing is
  const json evidence = evidence_json(truth, wild, logs);
  EXPECT_FALSE(evidence.at("fixed_point").at("computed").get<bool>());
  EXPECT_FALSE(evidence.at("fixed_point").at("why_not").get<std::string>().empty());
  EXPECT_TRUE(evidence.at("joints")[0].at("rms_after_fixed").is_null());
  EXPECT_TRUE(evidence.at("joints")[0].at("rms_after").is_number());
}

TEST(Evidence, WithoutAHeldOutLogItSaysSo) {
  const test::Arm arm("none");
  const IdentifiedModel truth = arm.truth(arm.log(0));
  const json evidence = evidence_json(truth, truth, {});
  EXPECT_TRUE(evidence.at("joints").empty());
  EXPECT_TRUE(evidence.contains("note"));
  EXPECT_TRUE(evidence.at("forward").is_null());
}

}  // namespace
}  // namespace fxdyn
