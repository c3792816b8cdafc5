// Pictures of findings on logs whose truth is known: the curve is the formula's, the band the deviation's, the signal
// the one of which the effect is a function.

#include "host_tools/report/finding_pictures.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/diagnose/example.hpp"
#include "tests/diagnose/small_log.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

EffectFit found(EffectFit fit) {
  fit.named = true;
  return fit;
}

IdentifiedModel puma() {
  IdentifiedModel model = test::plant_of(read_urdf(test::puma560));
  for (JointFit& joint : model.joints) joint.effects = {test::effect("viscous", {}, {2})};
  return model;
}

/// Pictures of a model on logs that follow another.
struct Drawn {
  Drawn(const IdentifiedModel& model, const IdentifiedModel& truth, const DiagnosisResult* diagnosis = nullptr)
      : logs{test::small_log(truth, Role::test, 1, 0.2), test::small_log(truth, Role::test, 2, 0.2)},
        shown(shown_logs(model, logs)),
        pictures(finding_pictures(model, shown, diagnosis)) {}
  std::vector<ProcessedLog> logs;
  std::vector<ShownLog> shown;
  std::vector<FindingPicture> pictures;
};

TEST(FindingPictures, StribeckOverTheVelocityWithItsBandAndTheDataBehindIt) {
  constexpr double velocity = 0.6, amplitude = 3, deviation = 0.3;
  IdentifiedModel model = puma();
  EffectFit stribeck = found(test::effect("stribeck", {velocity}, {amplitude}));
  stribeck.linear_std = {deviation};
  model.joints[1].effects.push_back(stribeck);
  const Drawn drawn(model, model);
  ASSERT_EQ(drawn.pictures.size(), 1U);
  const FindingPicture& picture = drawn.pictures[0];
  EXPECT_EQ(picture.joint, 1U);
  EXPECT_EQ(picture.effect, "stribeck");
  EXPECT_EQ(picture.over.label, "velocity [rad/s]");
  EXPECT_NE(picture.parameters.find("amplitude 3 ± 0.3 N*m"), std::string::npos) << picture.parameters;
  EXPECT_GT(picture.explained, 0.95);
  const ClassMeans data = class_means(picture.over.x, picture.without);
  Index compared = 0;
  for (Index k = 0; k < picture.torque.x.size(); ++k) {
    const double dq = picture.torque.x[k];
    if (std::fabs(dq) < 0.3) continue;  // the filter rounds the turn at standstill
    const double expected = std::copysign(amplitude, dq) * std::exp(-std::pow(dq / velocity, 2));
    EXPECT_NEAR(picture.torque.y[k], expected, 0.03 * amplitude) << dq;
    EXPECT_NEAR(picture.band[k], 1.96 * deviation / amplitude * std::fabs(expected), 0.03 * amplitude) << dq;
    EXPECT_NEAR(data.y[k], picture.torque.y[k], 0.05) << dq;
    ++compared;
  }
  EXPECT_GT(compared, 40);
  EXPECT_LT(class_means(picture.over.x, picture.with).y.cwiseAbs().maxCoeff(), 0.05);
}

TEST(FindingPictures, ARippleIsDrawnWithinItsPeriod) {
  IdentifiedModel model = puma();
  model.joints[2].effects.push_back(found(test::effect("ripple", {10}, {0.6, 0.4})));
  const Drawn drawn(model, model);
  ASSERT_EQ(drawn.pictures.size(), 1U);
  const FindingPicture& picture = drawn.pictures[0];
  EXPECT_EQ(picture.over.name, "position within one period of 0.6283 rad");
  EXPECT_EQ(picture.band.size(), 0);  // no deviation is known
  for (Index k = 0; k < picture.torque.x.size(); ++k) {
    const double x = picture.torque.x[k];
    EXPECT_GE(x, 0);
    EXPECT_LE(x, 2 * std::numbers::pi / 10);
    EXPECT_NEAR(picture.torque.y[k], 0.6 * std::cos(10 * x) + 0.4 * std::sin(10 * x), 0.05) << x;
  }
}

TEST(FindingPictures, SeveralAtOneJointAndAtOthersAreToldApart) {
  IdentifiedModel model = puma();
  const auto add = [&](std::size_t joint, const EffectFit& effect) {
    model.joints[joint].effects.push_back(found(effect));
  };
  add(0, test::effect("viscous_cubic", {}, {0.5}));
  add(0, test::effect("spring", {}, {4, 0}));
  add(3, test::effect("spring", {}, {7, 0}));
  const Drawn drawn(model, model);
  ASSERT_EQ(drawn.pictures.size(), 3U);
  const auto slope = [](const FindingPicture& of) {  // of a straight line, by its ends
    const Index last = of.torque.x.size() - 1;
    return (of.torque.y[last] - of.torque.y[0]) / (of.torque.x[last] - of.torque.x[0]);
  };
  EXPECT_EQ(drawn.pictures[0].over.name, "velocity");
  EXPECT_EQ(drawn.pictures[1].over.name, "position");
  EXPECT_NEAR(slope(drawn.pictures[1]), 4, 0.05);
  EXPECT_EQ(drawn.pictures[2].joint, 3U);
  EXPECT_NEAR(slope(drawn.pictures[2]), 7, 0.05);
}

TEST(FindingPictures, APayloadIsDrawnAtTheJointThatFeelsMostOfIt) {
  IdentifiedModel model = puma();
  model.body = {found(test::effect("payload", {}, {4, 0, 0, 0.1}))};
  const Drawn drawn(model, model);
  ASSERT_EQ(drawn.pictures.size(), 1U);
  EXPECT_EQ(drawn.pictures[0].effect, "payload");
  EXPECT_EQ(drawn.pictures[0].joint, 1U);  // the shoulder
  EXPECT_GT(drawn.pictures[0].torque.y.cwiseAbs().maxCoeff(), 5);
}

TEST(FindingPictures, WhatIsUndecidedHasItsNamesAndWhatIsUnknownHasNone) {
  IdentifiedModel model = puma(), truth = model;
  model.joints[0].effects.push_back(test::effect("coulomb", {}, {1.5}));
  truth.joints[0].effects = model.joints[0].effects;
  truth.joints[4].effects.push_back(test::effect("spring", {}, {3, 0}));
  DiagnosisResult diagnosis;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    JointDiagnosis joint;
    joint.index = j + 1;
    diagnosis.joints.push_back(joint);
  }
  diagnosis.joints[0].undecided = {{"coulomb", "presliding"}};
  diagnosis.joints[0].verdict = Verdict::explained;
  diagnosis.joints[4].verdict = Verdict::unexplained;
  const Drawn drawn(model, truth, &diagnosis);
  ASSERT_EQ(drawn.pictures.size(), 2U);
  EXPECT_EQ(drawn.pictures[0].effect, "coulomb or presliding");
  EXPECT_EQ(drawn.pictures[1].effect, "");
  EXPECT_EQ(drawn.pictures[1].joint, 4U);
  EXPECT_EQ(drawn.pictures[1].over.name, "position");  // what a spring leaves
  EXPECT_TRUE(Drawn(model, truth).pictures.empty());
}

}  // namespace
}  // namespace fxdyn
