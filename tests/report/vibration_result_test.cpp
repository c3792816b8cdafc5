// vibration.json, written and read by one codec, and the table for the terminal.

#include "host_tools/report/vibration_result.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

using nlohmann::json;

VibrationResult example() {
  VibrationMethod alone{"none", "-", "none", false, {10, 12, 3, 0.4, 0.02, 0.7, 0.45}, {}, {}};
  alone.kinds["slow"] = {1, 2, 0.5, 0.1, 0.01};
  VibrationMethod model{"model_elastic", "fixed", "-20 %", true, {5, 3, 1, 0.2, 0.03}, {}, {}};
  model.ratios["none"] = {{"tracking_motor", 0.5}, {"residual", 1.0 / 3}};
  VibrationMethod shaped{"model_elastic_shaped", "fixed", "none", true, {5, 3, 1, 0.2, 0.03, 0.6, 0.3}, {}, {}};
  shaped.path = VibrationPath{"shaped", {0.104, 0.082}, 1.75};
  VibrationResult out;
  out.project_hash = "0f";
  out.made_from = {{"logs", json::object()}};
  out.control = {24, 0.7, 0.002, 1.5e-6, 3e-4, 0.13, {4, 8}, {0.3, 0.5}};
  out.methods = {alone, model, shaped};
  out.fixed_against_double = {
      {"model", {0.001, 0.002}}, {"model_elastic", {0.003, 0.004}}, {"model_elastic_shaped", {0.005, 0.006}}};
  return out;
}

TEST(VibrationResult, ComesBackFromItsFile) {
  const json file = to_json(example());
  EXPECT_EQ(to_json(vibration_of(json::parse(file.dump()))), file);
  const VibrationResult read = vibration_of(file);
  EXPECT_EQ(read.control.damping, 0.7);
  EXPECT_EQ(read.methods[1].all.tracking_link, 3);
  EXPECT_TRUE(read.methods[1].motor_side);
  EXPECT_FALSE(read.methods[1].is_exact());
  EXPECT_EQ(read.fixed_against_double.at("model").error_change, 0.001);
  EXPECT_EQ(read.fixed_against_double.at("model_elastic").path_difference, 0.004);
  EXPECT_EQ(read.fixed_against_double.at("model_elastic_shaped").error_change, 0.005);
  EXPECT_EQ(read.control.late_s, 0.13);
  EXPECT_EQ(read.methods[0].all.residual_late, 0.7);
  EXPECT_FALSE(read.methods[0].path);
  EXPECT_EQ(read.methods[2].path->kind, "shaped");
  EXPECT_EQ(read.methods[2].path->delay_s, (std::vector{0.104, 0.082}));
  EXPECT_EQ(read.methods[2].path->cut_short, 1.75);
}

TEST(VibrationResult, AFileFromBeforeShapedPathsOrWithAControllerByHandIsRead) {
  json file = to_json(example());
  file["control"].erase("late_s");
  file["control"].erase("grid");
  for (json& method : file["methods"]) {
    method.erase("path");
    for (json& figures : method["moves"]) {
      figures.erase("residual_late");
      figures.erase("still_s");
    }
  }
  const VibrationResult read = vibration_of(file);
  EXPECT_EQ(read.control.late_s, 0);
  EXPECT_TRUE(read.control.grid_dampings.empty());
  EXPECT_FALSE(read.methods[0].all.residual_late);
  EXPECT_FALSE(read.methods[2].path);
  EXPECT_EQ(to_json(read)["methods"], file["methods"]);
}

TEST(VibrationResult, ADrivesHasControllerAndMethodsAlone) {
  VibrationResult drive;
  drive.control = example().control;
  drive.methods = example().methods;
  const json file = to_json(drive);
  EXPECT_EQ(file.size(), 3U);  // schema, control, methods
  EXPECT_EQ(file.at("schema"), "fxdyn.vibration/1");
  EXPECT_TRUE(vibration_of(file).fixed_against_double.empty());
}

TEST(VibrationResult, TheFileHasOneMethodAnEntry) {
  const json file = to_json(example());
  const json &alone = file.at("methods").at(0), &model = file.at("methods").at(1);
  EXPECT_EQ(alone.at("reference"), "link");
  EXPECT_FALSE(alone.contains("ratios"));
  EXPECT_EQ(alone.at("moves").at("slow").at("settling_s"), 0.1);
  EXPECT_EQ(alone.at("moves").at("all").at("roughness"), 0.02);
  EXPECT_EQ(model.at("reference"), "motor");
  EXPECT_EQ(model.at("ratios").at("none").at("tracking_motor"), 0.5);
  EXPECT_EQ(file.at("control").at("grid").at("bandwidth_hz"), (json{4.0, 8.0}));
  EXPECT_EQ(file.at("fixed_against_double").at("error_change"), 0.001);
  EXPECT_EQ(file.at("fixed_against_double").at("model_elastic").at("error_change"), 0.003);
  EXPECT_EQ(file.at("methods").at(2).at("path").at("kind"), "shaped");
}

TEST(VibrationResult, TheTableHasARatioWhereThereIsOne) {
  const std::string table = vibration_table(example());
  EXPECT_NE(table.find("PD of 24 Hz, damping 0.7 (best alone), tick 2 ms"), std::string::npos) << table;
  EXPECT_NE(table.find("|  0.500      -  0.333      -       -      -"), std::string::npos) << table;
  EXPECT_NE(table.find("0.001 more or less, paths 0.002 apart"), std::string::npos) << table;
  EXPECT_NE(table.find("(model_elastic_shaped), of the remaining error: 0.005"), std::string::npos) << table;
  EXPECT_NE(table.find("model_elastic_shaped: path shaped, 82 to 104 ms longer, cut short by 1.75 mrad"),
            std::string::npos)
      << table;
}

}  // namespace
}  // namespace fxdyn
