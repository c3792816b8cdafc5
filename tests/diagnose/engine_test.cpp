#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "tests/diagnose/arm_sessions.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using test::diagnosed;
using test::effect;
using test::json;
using test::only;
using test::parameter;

TEST(Diagnosis, NothingIsMissingWhereOnlyFrictionChangedALittle) {
  const json report = diagnosed("clean", {.friction = 1.05});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  EXPECT_TRUE(report.at("robot_effects").empty());
}

TEST(Diagnosis, NamesWhatIsMissingWithItsParameters) {
  const json report = diagnosed("ripple", {.missing = effect("ripple", 2, "wavenumber = 31.0, cos = 0.15, sin = 0.1")});
  EXPECT_EQ(report.at("verdict"), "explained");
  const json& ripple = only(report, 1, "ripple");
  EXPECT_NEAR(parameter(ripple, "wavenumber"), 31, 0.3);
  EXPECT_NEAR(std::hypot(parameter(ripple, "cos"), parameter(ripple, "sin")), std::hypot(0.15, 0.1), 0.02);
  EXPECT_GT(ripple.at("held_out_closure"), 0.8);
  const json& joint = report.at("joints").at(1);
  EXPECT_LT(joint.at("gap_after"), joint.at("gap_before"));
  EXPECT_TRUE(report.at("joints").at(0).at("effects").empty());
}

TEST(Diagnosis, ALoadIsTheRobotsAndNotTheJoints) {
  const json report =
      diagnosed("payload", {.missing = effect("payload", 0, "mass = 0.4, com_x = 0.25, com_y = 0.0, com_z = 0.0")});
  ASSERT_EQ(report.at("robot_effects").size(), 1U) << report.dump(1);
  const json& payload = report.at("robot_effects").at(0);
  EXPECT_EQ(payload.at("effect"), "payload");
  EXPECT_NEAR(parameter(payload, "mass"), 0.4, 0.08);
  for (const json& joint : report.at("joints")) EXPECT_TRUE(joint.at("effects").empty());
}

TEST(Diagnosis, WithoutABaselineALoadIsNoFinding) {
  // Base parameters contain it: nothing can tell.
  const json report = diagnosed(
      "unidentifiable",
      {.missing = effect("payload", 0, "mass = 0.4, com_x = 0.25, com_y = 0.0, com_z = 0.0"), .baseline = false});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  const json& blind = report.at("not_identifiable");
  EXPECT_NE(std::find(blind.begin(), blind.end(), "payload"), blind.end());
}

TEST(Diagnosis, WhatTheHealthyRobotHasAlreadyIsNoFinding) {
  const json report =
      diagnosed("background", {.already = effect("ripple", 1, "wavenumber = 12.0, cos = 0.6, sin = 0.2")});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  EXPECT_FALSE(report.at("notes").empty());
}

TEST(Diagnosis, WhatGrewSinceTheHealthySessionIsAFinding) {
  // Wear: the ripple of the healthy gear is half of today's.
  const std::string ripple = effect("ripple", 1, "wavenumber = 12.0, cos = 0.6, sin = 0.2");
  const json report = diagnosed("grown", {.missing = ripple, .already = ripple});
  EXPECT_EQ(report.at("verdict"), "explained");
  const json& found = only(report, 0, "ripple");
  EXPECT_NEAR(parameter(found, "wavenumber"), 12, 0.3);
  EXPECT_NEAR(parameter(found, "cos"), 0.6, 0.1);
  EXPECT_NEAR(parameter(found, "sin"), 0.2, 0.1);
}

TEST(Diagnosis, NoiseIsNotWhatTheTestLogsHaveOnTop) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  // Another tool in the test logs only
  const json report = diagnosed("other_tool", {.tamper = [](Log& log) {
                                  if (log.file.filename().string()[0] == 'c') log.tau.col(1).array() += 5;
                                }});
  const json& elbow = report.at("joints").at(1);
  EXPECT_GT(elbow.at("gap_after"), 4.5);
  EXPECT_LT(elbow.at("noise_floor"), 0.5);
  EXPECT_NE(report.at("notes").dump().find("on the logs that judged"), std::string::npos) << report.at("notes");
}

TEST(Diagnosis, ALinkEncoderShowsWhatBends) {
  const json report = diagnosed("gear", {.missing = effect("elasticity", 2, "compliance = 1e-4, relaxation = 0.002"),
                                         .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19"});
  const json& gear = only(report, 1, "elasticity");
  EXPECT_NEAR(parameter(gear, "compliance"), 1e-4, 1e-5);
}

TEST(Diagnosis, ALinkEncoderTellsAGapFromAnElasticity) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::string sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19";
  const json gap =
      diagnosed("gap", {.missing = effect("backlash", 2, "torque_scale = 0.3, half_gap = 3e-4"), .sensors = sensors});
  EXPECT_NEAR(parameter(only(gap, 1, "backlash"), "half_gap"), 3e-4, 3e-5);
  // Flanks that no load reaches: in proportion to it.
  const json slope = diagnosed(
      "slope", {.missing = effect("backlash", 2, "torque_scale = 300.0, half_gap = 0.03"), .sensors = sensors});
  EXPECT_NEAR(parameter(only(slope, 1, "elasticity"), "compliance"), 1e-4, 1e-5);
}

TEST(Diagnosis, ALinkEncoderShowsARunOut) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const json report = diagnosed("run_out", {.missing = effect("eccentricity", 2, "cos = 3e-4, sin = -2e-4"),
                                            .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19"});
  const json& wheel = only(report, 1, "eccentricity");
  EXPECT_NEAR(parameter(wheel, "cos"), 3e-4, 2e-5);
  EXPECT_NEAR(parameter(wheel, "sin"), -2e-4, 2e-5);
}

TEST(Diagnosis, ALinkEncoderShowsWhatBendsUnderALoadTooSmallForTheTorque) {
  // 40 mN*m of gravity under 0.2 N*m of noise
  const json report = diagnosed("wrist", {.missing = effect("elasticity", 2, "compliance = 5e-3, relaxation = 0.001"),
                                          .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19",
                                          .fore_mass = 0.03});
  const json& gear = only(report, 1, "elasticity");
  EXPECT_NEAR(parameter(gear, "compliance"), 5e-3, 2e-3);
  EXPECT_TRUE(report.at("joints").at(0).at("effects").empty());
}

TEST(Diagnosis, AGearThatBentBeforeIsNoFinding) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const json report = diagnosed("bent", {.already = effect("elasticity", 2, "compliance = 5e-3, relaxation = 0.001"),
                                         .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19",
                                         .fore_mass = 0.03});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
}

TEST(Diagnosis, LoadFrictionLeavesOutTheRotor) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  // The shoulder's rotor can't be told from the link but by this.
  const auto out =
      test::diagnose_sessions("load_friction", {.missing = effect("load_friction", 1, "coefficient = 0.15")});
  const json report = json::parse(read_file(out / "diagnosis.json"));
  const IdentifiedModel model = read_model(out / "model.json");
  const EffectFit* rotor = model.joints[0].find("rotor_inertia");
  ASSERT_NE(rotor, nullptr);
  EXPECT_NEAR(rotor->linear[0], 0.2, 0.1);
  const json& friction = only(report, 0, "load_friction");
  EXPECT_NEAR(parameter(friction, "coefficient"), 0.15, 0.02);
  EXPECT_GT(report.at("joints").at(0).at("closure"), 0.9);
}

TEST(Diagnosis, ALinkEncoderTellsTheRotorFromTheLink) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  // The gear carries the link alone; the base parameters of the shoulder have its rotor too.
  const auto out = test::diagnose_sessions("shoulder_gear",
                                           {.missing = effect("elasticity", 1, "compliance = 1e-4, relaxation = 0.002"),
                                            .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19"});
  const json report = json::parse(read_file(out / "diagnosis.json"));
  EXPECT_NEAR(parameter(only(report, 0, "elasticity"), "compliance"), 1e-4, 3e-6);
  const IdentifiedModel model = read_model(out / "model.json");
  const EffectFit* rotor = model.joints[0].find("rotor_inertia");
  ASSERT_NE(rotor, nullptr);
  EXPECT_NEAR(rotor->linear[0], 0.2, 0.03);
}

TEST(Diagnosis, LoadFrictionOfTheHealthyRobotIsNoFinding) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const json report = diagnosed("load_before", {.already = effect("load_friction", 1, "coefficient = 0.15")});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
}

TEST(Diagnosis, DriftRunsOnThroughTheSession) {
  const json report = diagnosed(
      "drift", {.missing = effect("friction_drift", 1, "time_constant = 30.0, coulomb = -0.9, viscous = -0.5")});
  const json& drift = only(report, 0, "friction_drift");
  EXPECT_NEAR(parameter(drift, "coulomb"), -0.9, 0.3);
}

/// A worn stretch: no effect of the catalogue has its form.
void tight_spot(Log& log) {
  constexpr Eigen::Index across = 5;  // samples either side of a velocity
  for (Eigen::Index k = across; k + across < log.q.rows(); ++k) {
    const double step = log.q(k + across, 1) - log.q(k - across, 1), place = (log.q(k, 1) - 0.2) / 0.15;
    log.tau(k, 1) += 1.2 * std::exp(-place * place) * std::tanh(step / 2e-4);
  }
}

TEST(Diagnosis, ACurveIsInTheModelWhereLogsThatDidNotFitItConfirmIt) {
  const std::filesystem::path out = test::diagnose_sessions("spot", {.baseline = false, .tamper = tight_spot});
  const json joint = json::parse(read_file(out / "diagnosis.json")).at("joints").at(1);
  ASSERT_TRUE(joint.at("curve").is_object()) << joint.dump(1);
  EXPECT_EQ(joint.at("curve").at("effect"), "friction_over_position");
  EXPECT_TRUE(joint.at("curve").at("in_model"));
  const IdentifiedModel model = read_model(out / "model.json");
  const EffectFit* curve = model.joints[1].find("friction_over_position");
  ASSERT_NE(curve, nullptr);
  EXPECT_FALSE(curve->named);
  // What is fitted with it has the offset and the dry friction: the heights stay about zero.
  for (const double height : curve->linear) EXPECT_LT(std::fabs(height), 3);
}

/// A hose that stiffens and softens by itself, over all logs of the session.
double hose(double t) { return 0.25 * std::sin(2 * std::numbers::pi * t / 11) + 0.1 * std::sin(0.31 * t); }

void expect_curve_of_hose(const std::string& name, bool baseline, double least_held) {
  const auto stiffen = [](Log& log) { log.tau.col(1) += log.t.unaryExpr(&hose); };
  const std::filesystem::path out = test::diagnose_sessions(name, {.baseline = baseline, .tamper = stiffen});
  const json joint = json::parse(read_file(out / "diagnosis.json")).at("joints").at(1);
  EXPECT_EQ(joint.at("verdict"), "unexplained") << joint.dump(1);
  EXPECT_TRUE(joint.at("effects").empty()) << joint.dump(1);
  EXPECT_GT(joint.at("left").at("share"), 0.9);
  EXPECT_LT(joint.at("noise_floor"), 0.6 * joint.at("gate_after").get<double>());
  const json& curve = joint.at("curve");
  ASSERT_TRUE(curve.is_object()) << joint.dump(1);
  EXPECT_EQ(curve.at("effect"), "time_curve");
  EXPECT_EQ(curve.at("signal"), "t");
  EXPECT_EQ(curve.at("unit"), "s");
  EXPECT_TRUE(curve.at("log").is_null());
  EXPECT_FALSE(curve.at("friction"));
  EXPECT_FALSE(curve.at("in_model"));  // no drive knows the time
  EXPECT_GT(curve.at("closes"), 0.7);
  std::size_t held = 0;
  for (std::size_t i = 0; i < curve.at("x").size(); ++i)
    held += std::fabs(curve.at("y").at(i).get<double>() - hose(curve.at("x").at(i))) <
            2 * curve.at("std").at(i).get<double>();
  EXPECT_GT(static_cast<double>(held), least_held * static_cast<double>(curve.at("x").size()));
  EXPECT_EQ(read_model(out / "model.json").joints[1].find("time_curve"), nullptr);
}

TEST(Diagnosis, WhatComesAndGoesByItselfGetsACurveOverTime) { expect_curve_of_hose("hose", true, 0.9); }

// It passes for noise that remembers, where nothing says what noise is.
TEST(Diagnosis, WithoutABaselineToo) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  expect_curve_of_hose("hose_alone", false, 0.9);
}

TEST(Diagnosis, WithoutSuchLogsTrainLogsConfirmItForOneAnother) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::filesystem::path out =
      test::diagnose_sessions("spot_alone", {.baseline = false, .validate = false, .tamper = tight_spot});
  const json joint = json::parse(read_file(out / "diagnosis.json")).at("joints").at(1);
  ASSERT_TRUE(joint.at("curve").is_object()) << joint.dump(1);
  EXPECT_TRUE(joint.at("curve").at("in_model"));
  EXPECT_NE(read_model(out / "model.json").joints[1].find("friction_over_position"), nullptr);
}

TEST(Diagnosis, WhereNothingIsToBeNamedACurveIsAnAnswerOnly) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::filesystem::path out =
      test::diagnose_sessions("spot_left", {.baseline = false, .max_effects = 0, .tamper = tight_spot});
  const json joint = json::parse(read_file(out / "diagnosis.json")).at("joints").at(1);
  ASSERT_TRUE(joint.at("curve").is_object()) << joint.dump(1);
  EXPECT_FALSE(joint.at("curve").at("in_model"));
  EXPECT_EQ(read_model(out / "model.json").joints[1].find("friction_over_position"), nullptr);
}

}  // namespace
}  // namespace fxdyn
