#include "host_tools/signals/planned_series.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

class PlannedSeriesFile : public ::testing::Test {
 protected:
  void write(const std::string& text) { std::ofstream(file_) << text; }
  std::string complaint() {
    try {
      read_planned_series(file_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }
  std::filesystem::path file_ = test::folder() / "excite.json";
};

TEST_F(PlannedSeriesFile, WhatIsWrittenIsRead) {
  FourierJoint joint;
  joint.centre = 0.5;
  joint.a = Eigen::Vector2d(1, -1);
  joint.b = Eigen::Vector2d(0.25, 0);
  write(json{
      {"trajectories", {{{"name", "fast"}, {"period_s", 5}, {"series", {series_json(joint)}}}, {{"name", "walk"}}}}}
            .dump());
  const auto plan = read_planned_series(file_);
  ASSERT_EQ(plan.size(), 2u);
  EXPECT_EQ(plan[0].name, "fast");
  EXPECT_EQ(plan[0].period_s, 5);
  ASSERT_EQ(plan[0].joints.size(), 1u);
  EXPECT_EQ(plan[0].joints[0].centre, 0.5);
  EXPECT_EQ(plan[0].joints[0].a, joint.a);
  EXPECT_EQ(plan[0].joints[0].b, joint.b);
  EXPECT_TRUE(plan[1].joints.empty());
}

TEST_F(PlannedSeriesFile, AnotherFileIsNamedAsSuch) {
  for (const char* text : {"{", "{}", R"({"trajectories": [{"period_s": 5}]})", R"({"trajectories": 3})",
                           R"({"trajectories": [{"name": "x", "series": [{"centre": 0, "a": [1], "b": [1]}]}]})"}) {
    write(text);
    EXPECT_NE(complaint().find("is no excite.json: make one by fxdyn excite"), std::string::npos) << text;
  }
}

TEST_F(PlannedSeriesFile, CoefficientsComeInPairs) {
  write(R"({"trajectories": [{"name": "x", "period_s": 5, "series": [{"centre": 0, "a": [1, 2], "b": [1]}]}]})");
  EXPECT_NE(complaint().find("differ in length"), std::string::npos);
}

}  // namespace
}  // namespace fxdyn
