// metrics.json, written and read by one codec.

#include "host_tools/regression/metrics_result.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

LogErrors errors(Role role) {
  return {"run.csv", role, 0, 12.5, {{"joint_1", "N*m", {0.5, 0.02, 0.7, 0.4, -0.01}}, {"joint_2", "N", {}}}};
}

MetricsResult example() {
  LinkResult link{
      "link_1", {4.2, 0.999}, {{{0.1, 1}, {0.2, 0.5}, {0.3, 0}}}, {{{0.4, 1}, {0.8, 0.9}, {1.2, 0.1}}}, 1e-3, {}};
  LinkResult given = link;
  given.urdf = {4, {0.1, 0.1, 0.2}, {0.4, 0.4, 0.8}};
  FitResult fit;
  fit.method = "rls";
  fit.condition_number = 31.5;
  fit.weak = {{"m3 + m4", 0.12, "joint_2"}};
  fit.saturated_rows = {0, 17};
  fit.physical = {true, "the URDF's", {9, 0.98}, 8.5, {link, given}};
  fit.recursion = {0.9, {1, 2}, {{1, 2, 3}, {1.5, 2.5, 3.5}}};
  TrainedJoint::Choice choice{"pso", 20, 2, "tanh", "bristles", 1e-4, 0.7, 0.02, 0.011, {}, {}, {}, {}};
  choice.distances = {{1e-3, 3e-3, 9e-3}};
  choice.stribeck_velocity = 0.03;
  choice.share = 0.7;
  choice.generations = 12;
  MetricsResult out{.logs = {errors(Role::train), errors(Role::test)},
                    .gate = "the validate logs",
                    .base_parameters = 36,
                    .notes = {"one", "two"},
                    .stages = {{"friction", {errors(Role::train)}}, {"bls", {errors(Role::test)}}},
                    .fit = fit};
  out.training = {{"joint_1", "N*m", 0.5, 0.4, true, 360, choice}, {"joint_2", "N", 0.5, 0.5, false, 10, {}}};
  out.gate_errors = {{"joint_1", "N*m", 0.9, 0.5, 0.4, "bls"}, {"joint_2", "N", {}, 0.5, 0.5, "diagnosed"}};
  return out;
}

TEST(MetricsResult, ComesBackFromItsFile) {
  const json file = to_json(example());
  EXPECT_EQ(to_json(metrics_of(json::parse(file.dump()))), file);
  const MetricsResult read = metrics_of(file);
  EXPECT_EQ(read.logs[1].role, Role::test);
  EXPECT_EQ(read.stages[1].logs[0].joints[0].metrics.rmse, 0.5);
  EXPECT_EQ(read.base_parameters, 36U);
  EXPECT_EQ(read.fit->saturated_rows[1], 17);
  EXPECT_EQ(read.fit->weak[0].joint_to_move, "joint_2");
  EXPECT_EQ(read.fit->physical->links[1].urdf->centre[2], 0.2);
  EXPECT_FALSE(read.fit->physical->links[0].urdf);
  EXPECT_EQ(read.fit->physical->links[0].first_moment[1].data_share, 0.9);
  EXPECT_EQ(read.fit->recursion->estimates[1][2], 3.5);
  EXPECT_EQ(read.training->at(0).choice->generations, 12);
  EXPECT_FALSE(read.training->at(1).choice);
  EXPECT_EQ(read.gate_errors[0].friction, 0.9);
  EXPECT_EQ(read.gate_errors[1].exported, "diagnosed");
  EXPECT_TRUE(file.at("gate_errors").at(1).at("friction").is_null());
}

TEST(MetricsResult, SaysWhichParametersTheDataDetermines) {
  const json link = to_json(example()).at("physical").at("links").at(0);
  EXPECT_EQ(link.at("mass").at("determined"), true);
  EXPECT_EQ(link.at("first_moment").at(1).at("determined"), false);
  EXPECT_EQ(link.at("first_moment").at(1).at("unit"), "kg m");
}

TEST(MetricsResult, ADiagnosisHasNoFitAndAPredictionHasLogsAlone) {
  MetricsResult diagnosed = example();
  diagnosed.fit.reset();
  diagnosed.training.reset();
  diagnosed.gate_errors.clear();
  const json file = to_json(diagnosed);
  EXPECT_FALSE(file.contains("method") || file.contains("training") || file.contains("gate_errors"));
  EXPECT_EQ(to_json(metrics_of(file)), file);
  const json predicted = to_json(MetricsResult{.logs = {errors(Role::test)}, .numbers = "fixed"});
  EXPECT_EQ(predicted.size(), 3U);
  EXPECT_EQ(to_json(metrics_of(predicted)), predicted);
}

TEST(MetricsResult, WhatIsNotKnownIsNull) {
  MetricsResult result = example();
  result.fit->condition_number = std::nan("");
  const json file = json::parse(to_json(result).dump());
  EXPECT_TRUE(file.at("condition_number").is_null());
  EXPECT_EQ(to_json(metrics_of(file)), file);
}

}  // namespace
}  // namespace fxdyn
