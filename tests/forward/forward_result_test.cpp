// forward.json, written and read by one codec, and the table for the terminal.

#include "host_tools/forward/forward_result.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace fxdyn {
namespace {

using nlohmann::json;

ForwardResult example() {
  return {"run.csv", 12, 3.5, {{"joint_1", "rad", 1.5, {}, 0.25}, {"joint_2", "m", 0.5, {}, 0.125}}, "it ran away", ""};
}

TEST(ForwardResult, ComesBackFromItsFile) {
  const json file = to_json(example());
  EXPECT_EQ(to_json(forward_of(json::parse(file.dump()))), file);
  EXPECT_TRUE(file.at("joints").at(0).at("open_rmse").is_null());
  EXPECT_EQ(file.at("failed"), json({{"open", "it ran away"}}));
  const ForwardResult read = forward_of(file);
  EXPECT_EQ(read.given, 12);
  EXPECT_FALSE(read.joints[1].open_rmse);
  EXPECT_EQ(read.joints[1].closed_rmse, 0.125);
  EXPECT_EQ(read.why_open_failed, "it ran away");
  EXPECT_EQ(read.why_closed_failed, "");
}

TEST(ForwardResult, TheTableSaysWhatFailed) {
  const std::string table = forward_table(example());
  EXPECT_NE(table.find("run.csv: 3.5 s simulated, the first 12 samples given"), std::string::npos);
  EXPECT_NE(table.find("failed         0.25          1.5 rad"), std::string::npos) << table;
  EXPECT_NE(table.find("open loop: it ran away"), std::string::npos);
  EXPECT_EQ(table.find("closed loop: "), std::string::npos);
}

}  // namespace
}  // namespace fxdyn
