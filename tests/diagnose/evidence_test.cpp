#include "host_tools/diagnose/evidence.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "host_tools/effects/identified_model.hpp"
#include "tests/diagnose/arm.hpp"

namespace fxdyn {
namespace {

TEST(Evidence, TheGapShrinksInDoubleInFixedPointAndForward) {
  const test::Arm arm("shrinks");
  const std::vector<ProcessedLog> logs{arm.log(0), arm.log(1)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  const HeldOutEvidence evidence = held_out_evidence(test::without(truth, "stribeck"), truth, logs);

  ASSERT_EQ(evidence.held_out.size(), 2U);
  EXPECT_EQ(evidence.held_out[0].file, "a.csv");
  EXPECT_TRUE(evidence.fixed_point.computed) << evidence.fixed_point.why_not;
  ASSERT_EQ(evidence.joints.size(), 2U);
  const HeldOutEvidence::Joint& shoulder = evidence.joints[0];
  EXPECT_EQ(shoulder.joint, "shoulder");
  EXPECT_EQ(shoulder.unit, "N*m");
  const double before = shoulder.before.value(), after = shoulder.after.value();
  EXPECT_GT(before, 5 * after);
  EXPECT_NEAR(after, shoulder.noise_floor.value(), 0.5 * after);
  EXPECT_NEAR(shoulder.after_fixed.value(), after, 0.02 * after);
  // The elbow lacks nothing: the same before and after.
  EXPECT_EQ(evidence.joints[1].before.value(), evidence.joints[1].after.value());
}

TEST(Evidence, ThePlantThatLacksNothingFollowsTheRecordedMotionByItself) {
  const test::Arm arm("forward");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  const PlayedForward forward = held_out_evidence(test::without(truth, "stribeck"), truth, logs).forward.value();
  EXPECT_EQ(forward.log, "a.csv");
  EXPECT_NEAR(forward.seconds, 8 - 2 * 0.3, 0.02);
  EXPECT_EQ(forward.failed_before + forward.failed_after, "");
  const PlayedJoint& shoulder = forward.joints.at(0);
  EXPECT_EQ(shoulder.position_unit, "rad");
  EXPECT_LT(shoulder.tracking_after.value(), 0.5 * shoulder.tracking_before.value());
  EXPECT_LT(shoulder.torque_after.value(), 0.5 * shoulder.torque_before.value());
}

TEST(Evidence, WhatChangesTheMeasuredTorqueIsTakenOutOfItBeforeItDrivesThePlant) {
  const test::Arm arm("gain");
  std::vector<ProcessedLog> logs{arm.log(0)};
  logs[0].tau *= 1.2;
  const IdentifiedModel nominal = arm.truth(logs[0]);
  IdentifiedModel truth = nominal;
  for (JointFit& joint : truth.joints) joint.effects.push_back({"torque_gain", {}, {0.2}, {}, {}, true});
  const PlayedJoint shoulder = held_out_evidence(nominal, truth, logs).forward.value().joints.at(0);
  EXPECT_LT(shoulder.tracking_after.value(), 0.5 * shoulder.tracking_before.value());
  EXPECT_LT(shoulder.torque_after.value(), 0.5 * shoulder.torque_before.value());
}

TEST(Evidence, APlantThatNoBodyOfMatterHasIsSaidAndNotFatal) {
  const test::Arm arm("no_plant");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  IdentifiedModel impossible = truth;
  impossible.inertia[1].zz = impossible.inertia[1].yy = impossible.inertia[1].xx = -5;
  const PlayedForward forward = held_out_evidence(impossible, truth, logs).forward.value();
  EXPECT_NE(forward.failed_before, "");
  EXPECT_EQ(forward.failed_after, "");
  EXPECT_FALSE(forward.joints.at(0).tracking_before);
  EXPECT_TRUE(forward.joints.at(0).tracking_after);
}

TEST(Evidence, AModelThatFixedPointCannotHoldIsSaidAndNotFatal) {
  const test::Arm arm("no_fixed");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  const IdentifiedModel truth = arm.truth(logs[0]);
  IdentifiedModel wild = truth;
  wild.joints[1].effects.push_back({"elasticity", {0.01}, {1e9}, {}, {}, true});  // soft as nothing is
  const HeldOutEvidence evidence = held_out_evidence(truth, wild, logs);
  EXPECT_FALSE(evidence.fixed_point.computed);
  EXPECT_NE(evidence.fixed_point.why_not, "");
  EXPECT_FALSE(evidence.joints.at(0).after_fixed);
  EXPECT_TRUE(evidence.joints.at(0).after);
}

TEST(Evidence, ATorqueThatTheFirmwareCutsOffIsSaid) {
  const test::Arm arm("cut_off");
  const std::vector<ProcessedLog> logs{arm.log(0)};
  IdentifiedModel truth = arm.truth(logs[0]);
  truth.joints[0].tau_limit = 1.1 * logs[0].tau.col(0).cwiseAbs().maxCoeff();
  truth.joints[1].tau_limit = 0.5 * logs[0].tau.col(1).cwiseAbs().maxCoeff();
  const std::vector<std::string> notes = held_out_evidence(truth, truth, logs).fixed_point.notes;
  const auto said = [&](const std::string& joint) {
    return std::any_of(notes.begin(), notes.end(), [&](const std::string& note) {
      return note.starts_with(joint) && note.find("model's torque is beyond its limit") != std::string::npos;
    });
  };
  EXPECT_FALSE(said("shoulder"));
  EXPECT_TRUE(said("elbow"));
}

TEST(Evidence, WithoutAHeldOutLogItSaysSo) {
  const test::Arm arm("none");
  const IdentifiedModel truth = arm.truth(arm.log(0));
  const HeldOutEvidence evidence = held_out_evidence(truth, truth, {});
  EXPECT_TRUE(evidence.joints.empty());
  EXPECT_NE(evidence.note, "");
  EXPECT_FALSE(evidence.forward);
}

}  // namespace
}  // namespace fxdyn
