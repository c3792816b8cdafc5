#include <cmath>

#include "host_tools/diagnose/joint_state.hpp"
#include "tests/diagnose/arm_sessions.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using test::diagnosed;
using test::effect;
using test::json;

/// Something that the catalogue does not have: a pump, on and off, in a joint's torque [N*m].
auto pump(Eigen::Index joint, double amplitude) {
  return [=](Log& log) {
    for (Eigen::Index k = 0; k < log.t.size(); ++k)
      log.tau(k, joint) += std::sin(2 * 3.14159 * 2.7 * log.t[k]) > 0 ? amplitude : -amplitude;
  };
}

const char* const ripple = "wavenumber = 31.0, cos = 0.3, sin = 0.2";

TEST(JointVerdict, ACurveAloneIsUnexplainedAndBesideANameNothingMore) {
  EXPECT_EQ(diagnosis::verdict_of({.curved = true}), Verdict::unexplained);
  EXPECT_EQ(diagnosis::verdict_of({.established = true, .curved = true}), Verdict::explained);
  EXPECT_EQ(diagnosis::verdict_of({}), Verdict::nothing_missing);
}

TEST(DiagnosisVerdict, ANameStaysWhereAnotherJointIsUnexplained) {
  const json report = diagnosed("neighbours", {.missing = effect("ripple", 2, ripple), .tamper = pump(0, 0.8)});
  EXPECT_EQ(report.at("verdict"), "unexplained");
  EXPECT_EQ(report.at("joints").at(0).at("verdict"), "unexplained");
  EXPECT_TRUE(report.at("joints").at(0).at("effects").empty());
  EXPECT_EQ(report.at("joints").at(1).at("verdict"), "explained") << report.dump(1);
  test::only(report, 1, "ripple");
}

TEST(DiagnosisVerdict, WhatRepeatsInTimeIsUnexplainedWhateverElseHasAName) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const json report = diagnosed("pump", {.missing = effect("ripple", 2, ripple), .tamper = pump(1, 0.4)});
  EXPECT_EQ(report.at("joints").at(1).at("verdict"), "partly_explained") << report.dump(1);
  EXPECT_LT(report.at("joints").at(1).at("noise_floor"), 0.8 * report.at("joints").at(1).at("gap_after").get<double>());
}

TEST(DiagnosisVerdict, ASlowStructureOfAnotherJointIsUnexplained) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  // A cable that the shoulder pulls along at the elbow: 0.4 of the noise, and like itself at other times.
  const json report = diagnosed(
      "cable", {.tamper = [](Log& log) { log.tau.col(1).array() += 0.08 * (5 * log.q.col(0).array() + 0.7).sin(); }});
  EXPECT_EQ(report.at("joints").at(0).at("verdict"), "nothing_missing");
  EXPECT_EQ(report.at("joints").at(1).at("verdict"), "unexplained") << report.dump(1);
}

/// Every half second up and down within three samples: nothing of it is within the torque's band.
void strike(Log& log) {
  for (Eigen::Index k = 100; k + 2 < log.samples(); k += 250) {
    log.tau(k, 1) += 4;
    log.tau(k + 1, 1) -= 8;
    log.tau(k + 2, 1) += 4;
  }
}

TEST(DiagnosisVerdict, ImpactsAboveTheTorquesBandAreSeen) {
  const json report = diagnosed("impacts", {.tamper = strike});
  EXPECT_EQ(report.at("joints").at(0).at("verdict"), "nothing_missing") << report.dump(1);
  const json& elbow = report.at("joints").at(1);
  EXPECT_EQ(elbow.at("verdict"), "unexplained");
  EXPECT_EQ(elbow.at("where").at("regions").at(0).at("signal"), "t");
  EXPECT_NE(report.at("notes").dump().find("1.9 impacts a second"), std::string::npos) << report.at("notes");
}

TEST(DiagnosisVerdict, TestLogsDecideNothing) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::string drift = effect("friction_drift", 1, "time_constant = 30.0, coulomb = -0.9, viscous = -0.5");
  json models[2];
  // .. not even by their clock: the second one's overlaps train's.
  const test::Sessions one{.missing = drift, .test = false}, other{.missing = drift, .test_starts_s = 0};
  for (const auto& [sessions, model] : {std::pair{&one, &models[0]}, std::pair{&other, &models[1]}}) {
    *model = json::parse(read_file(test::diagnose_sessions("test_logs", *sessions) / "model.json"));
    EXPECT_NE(model->dump().find("friction_drift"), std::string::npos);
    for (const char* figures : {"logs", "notes", "project_hash"}) model->erase(figures);
  }
  EXPECT_EQ(models[0], models[1]);
}

TEST(DiagnosisVerdict, SaysWhatJudgedAndWhatTheFiguresAreOn) {
  const json report = diagnosed("no_validate", {.missing = effect("ripple", 2, ripple), .validate = false});
  EXPECT_EQ(report.at("gate"), "train logs, whole or in parts, each judged by coefficients fitted to the others");
  EXPECT_EQ(report.at("figures_on"), "test logs");
  test::only(report, 1, "ripple");
  const json alone =
      diagnosed("train_only", {.missing = effect("ripple", 2, ripple), .validate = false, .test = false});
  EXPECT_EQ(alone.at("figures_on"), "train logs, whole or in parts, each judged by coefficients fitted to the others");
  const json &here = alone.at("joints").at(1), &there = report.at("joints").at(1);
  // A fast and a slow log that judge one another do it less well than others like both.
  EXPECT_NEAR(here.at("gap_before"), there.at("gap_before"), 0.4 * there.at("gap_before").get<double>());
}

TEST(DiagnosisVerdict, FrictionThatDoubledIsSaid) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const json report = diagnosed("doubled", {.friction = 2.2});
  std::string notes;
  for (const json& note : report.at("notes")) notes += note.get<std::string>() + "\n";
  EXPECT_NE(notes.find("shoulder: coulomb"), std::string::npos) << notes;
}

}  // namespace
}  // namespace fxdyn
