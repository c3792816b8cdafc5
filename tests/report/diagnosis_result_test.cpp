// diagnosis.json, written and read by one codec.

#include "host_tools/report/diagnosis_result.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

/// A joint whose plant fails before, and one that fixed point can't hold.
HeldOutEvidence evidence() {
  HeldOutEvidence out;
  out.held_out = {{"b.csv", Role::validate, 1, 9.5}};
  out.joints = {{"shoulder", "N*m", 1.9, 0.4, 0.41, 0.35}, {"elbow", "N", 3.0, 2.9}};
  out.fixed_point = {false, "no format holds it", {"elbow: beyond its limit"}};
  out.forward = PlayedForward{"b.csv", 1.3, 8, {{"shoulder", "rad", "N*m", {}, 0.002, {}, 1.5}}, "grows", ""};
  out.note = "no test log";
  return out;
}

/// One joint of each kind, and a load.
DiagnosisResult example() {
  NamedEffect stribeck;
  stribeck.effect = "stribeck";
  stribeck.parameters = {{"velocity", "rad/s", 0.04, 0.01}, {"amplitude", "N*m", 2.1, {}}};
  stribeck.score = 412;
  stribeck.established = true;
  stribeck.odds_nothing = 40.2;
  stribeck.odds_rival = 3.7;
  stribeck.rival = "presliding";
  stribeck.held_out_closure = 0.83;
  stribeck.alternatives = {"presliding"};
  stribeck.model_share = 0.4;
  NamedEffect bends = stribeck;
  bends.effect = "elasticity";
  bends.held_out_closure.reset();
  bends.signal = "q - qlink";
  bends.established = false;
  bends.odds_rival.reset();
  bends.rival.clear();
  NamedEffect load = stribeck;
  load.effect = "payload";
  load.joints = {2, 3};

  JointDiagnosis moving{"shoulder", "N*m", 1, Verdict::partly_explained};
  moving.gap_before = 1.9;
  moving.gap_after = 0.4;
  moving.noise_floor = 0.35;
  moving.gate_before = 1.8;
  moving.gate_after = 0.38;
  moving.carries_over = false;
  moving.closure = 0.83;
  moving.left = GapLeft{0.2, 0.1, 0.3};
  moving.where = {"61 % of the gap is slow",
                  {{"q", 2, -0.05, 0.05, 0.61, 0.08, ""}, {"t", 0, 3, 3.1, {}, {}, "b.csv"}}};
  moving.effects = {stribeck, bends};
  moving.undecided = {{"presliding", "lugre"}};
  moving.curve.emplace();
  moving.curve->effect = "friction_over_position";
  moving.curve->signal = "q";
  moving.curve->unit = "rad";
  moving.curve->friction = true;
  moving.curve->sentence = "friction rises by 0.8 N*m between 0.85 and 1.05 rad";
  moving.curve->odds_nothing = 12;
  moving.curve->odds_rival = 2.1;
  moving.curve->rival = "position_curve";
  moving.curve->closes = 0.6;
  moving.curve->points = {{0.8, -0.1, 0.02}, {0.95, 0.7, 0.03}};
  moving.not_identifiable = {"spring"};
  moving.state_p = 1e-12;
  moving.time_p = 0.3;

  DiagnosisResult out;
  out.verdict = Verdict::partly_explained;
  out.joints = {moving, {"elbow", "N", 2, Verdict::not_excited}};
  out.robot_effects = {load};
  out.undecided = {{"payload", "gravity_tilt"}};
  out.not_identifiable = {"payload"};
  out.next_experiment = "record a log in which joint 2 moves";
  out.gate = "validate logs";
  out.figures_on = "test logs";
  out.baseline = true;
  out.notes = {"a note"};
  out.evidence = evidence();
  return out;
}

TEST(DiagnosisResult, ComesBackFromItsFile) {
  const json file = to_json(example());
  EXPECT_EQ(to_json(diagnosis_of(json::parse(file.dump()))), file);
  const DiagnosisResult read = diagnosis_of(file);
  EXPECT_EQ(read.joints[1].verdict, Verdict::not_excited);
  EXPECT_EQ(read.joints[0].effects[0].parameters[0].std, 0.01);
  EXPECT_EQ(read.robot_effects[0].joints, (std::vector<std::size_t>{2, 3}));
}

TEST(DiagnosisResult, WhatIsNotKnownIsNullOrNotThere) {
  const json file = to_json(example());
  EXPECT_EQ(file.at("schema"), "fxdyn.diagnosis/2");
  const json &moving = file.at("joints").at(0), &still = file.at("joints").at(1);
  EXPECT_EQ(moving.at("verdict"), "partly_explained");
  EXPECT_EQ(moving.at("left"), (json{{"share", 0.2}, {"low", 0.1}, {"high", 0.3}}));
  EXPECT_EQ(moving.at("gate_after"), 0.38);
  EXPECT_EQ(moving.at("carries_over"), false);
  EXPECT_TRUE(still.at("carries_over").is_null());
  EXPECT_EQ(moving.at("undecided"), json::parse(R"([["presliding", "lugre"]])"));
  EXPECT_EQ(moving.at("effects").at(0).at("certainty"), "established");
  EXPECT_EQ(moving.at("effects").at(0).at("log10_odds_rival"), 3.7);
  EXPECT_EQ(moving.at("effects").at(1).at("certainty"), "likely");
  EXPECT_TRUE(moving.at("effects").at(1).at("rival").is_null());
  EXPECT_TRUE(moving.at("effects").at(0).at("parameters").at(1).at("std").is_null());
  EXPECT_FALSE(moving.at("effects").at(0).contains("signal"));
  EXPECT_TRUE(moving.at("effects").at(1).at("held_out_closure").is_null());
  EXPECT_EQ(moving.at("effects").at(1).at("signal"), "q - qlink");
  EXPECT_FALSE(moving.at("effects").at(0).contains("joints"));
  const json& regions = moving.at("where").at("regions");
  EXPECT_EQ(regions.at(0).at("share_of_time"), 0.08);
  EXPECT_FALSE(regions.at(0).contains("log"));
  EXPECT_TRUE(regions.at(1).at("share_of_gap").is_null());
  for (const char* key : {"gap_before", "gap_after", "gate_before", "gate_after", "noise_floor", "closure", "left"})
    EXPECT_TRUE(still.at(key).is_null());
  EXPECT_TRUE(still.at("lack_of_fit").at("state_p").is_null());
  EXPECT_EQ(still.at("effects"), json::array());
  DiagnosisResult alone = example();
  alone.evidence.reset();
  EXPECT_FALSE(to_json(alone).contains("evidence"));
}

TEST(DiagnosisResult, ItsEvidenceComesBackFromItsFile) {
  const json file = to_json(example()).at("evidence");
  EXPECT_EQ(file.at("held_out").at(0), (json{{"file", "b.csv"}, {"role", "validate"}, {"from_s", 1.0}, {"to_s", 9.5}}));
  EXPECT_EQ(file.at("joints").at(1), json::parse(R"({"joint": "elbow", "index": 2, "unit": "N", "rms_before": 3.0,
      "rms_after": 2.9, "rms_after_fixed": null, "noise_floor": null})"));
  EXPECT_EQ(file.at("fixed_point"), json::parse(R"({"computed": false, "why_not": "no format holds it",
      "notes": ["elbow: beyond its limit"]})"));
  EXPECT_EQ(file.at("forward").at("failed"), (json{{"before", "grows"}}));
  EXPECT_EQ(file.at("forward").at("joints").at(0), json::parse(R"({"joint": "shoulder", "index": 1,
      "tracking_before": null, "tracking_after": 0.002, "tracking_unit": "rad", "torque_before": null,
      "torque_after": 1.5, "torque_unit": "N*m"})"));
  EXPECT_EQ(file.at("note"), "no test log");
  EXPECT_EQ(to_json(evidence_of(json::parse(file.dump()))), file);
}

TEST(DiagnosisResult, EvidenceWithoutAHeldOutLogHasNoNotesOfFixedPoint) {
  HeldOutEvidence none;
  none.fixed_point.why_not = "no log was held out";
  const json file = to_json(none);
  EXPECT_EQ(file.at("fixed_point"), (json{{"computed", false}, {"why_not", "no log was held out"}}));
  EXPECT_TRUE(file.at("forward").is_null());
  EXPECT_FALSE(file.contains("note"));
  EXPECT_FALSE(evidence_of(file).forward);
}

TEST(DiagnosisResult, AFigureThatIsNoNumberIsReadAsNone) {
  DiagnosisResult result = example();
  result.joints[0].gap_after = result.joints[0].effects[0].score = std::numeric_limits<double>::quiet_NaN();
  const DiagnosisResult read = diagnosis_of(json::parse(to_json(result).dump()));
  EXPECT_FALSE(read.joints[0].gap_after);
  EXPECT_TRUE(std::isnan(read.joints[0].effects[0].score));
}

TEST(DiagnosisResult, AFileWithoutTheGatesErrorsIsRead) {
  json file = to_json(example());
  for (const char* key : {"gate_before", "gate_after", "carries_over"}) file["joints"][0].erase(key);
  const DiagnosisResult read = diagnosis_of(file);
  EXPECT_FALSE(read.joints[0].gate_after || read.joints[0].carries_over);
  EXPECT_EQ(read.joints[0].gap_after, 0.4);
}

TEST(DiagnosisResult, AnUnknownVerdictIsRefused) {
  json file = to_json(example());
  file["joints"][0]["verdict"] = "puzzling";
  EXPECT_THROW(diagnosis_of(file), InputError);
}

TEST(DiagnosisResult, AFileOfAnotherSchemaIsRefused) {
  json file = to_json(example());
  file["schema"] = "fxdyn.diagnosis/1";
  EXPECT_THROW(diagnosis_of(file), InputError);
}

}  // namespace
}  // namespace fxdyn
