// replay.json, written and read by one codec, and what the report makes of it.

#include "host_tools/report/replay_result.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/report/results.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

ReplayResult example() {
  ReplayResult out;
  out.image = "drive_an386.elf";
  out.tables_crc = 0xdeadbeef;
  out.output_joints = {1, 2};
  out.tables_in = "image";
  out.logs = {{"a.csv", 5000, 0, 3, 900, 910, 905.25, {{"shoulder", "N*m", 1, 0.01, 0.0001}}},
              {"a.csv, perturbed", 4000, 0, 4, 890, 905, 900, {}}};
  return out;
}

TEST(ReplayResult, ComesBackFromItsFile) {
  ReplayResult result = example();
  result.size = {12345, 678, 90};
  const json file = to_json(result);
  EXPECT_EQ(to_json(replay_of(json::parse(file.dump()))), file);
  EXPECT_EQ(replay_of(file).logs[0].joints[0].unit, "N*m");
  EXPECT_EQ(file.at("logs").at(0).at("instructions_per_tick").at("mean"), 905.25);
  EXPECT_EQ(file.at("size"), (json{{"flash_bytes", 12345}, {"ram_bytes", 678}, {"stack_bytes", 90}}));
  EXPECT_FALSE(to_json(example()).contains("size"));
}

TEST(ReplayResult, OneDifferentTickIsEnough) {
  ReplayResult result = example();
  EXPECT_EQ(to_json(result).at("bit_exact"), true);
  result.logs[1].different_ticks = 1;
  EXPECT_EQ(to_json(result).at("bit_exact"), false);
}

TEST(ReplayResult, ItsSummaryIsOverAllLogs) {
  const ReplaySummary sum = summarise_replay(example());
  EXPECT_EQ(sum.ticks, 9000);
  EXPECT_EQ(sum.different_ticks, 0);
  EXPECT_EQ(sum.saturations, 7);
  EXPECT_EQ(sum.fewest, 890U);
  EXPECT_EQ(sum.most, 910U);
  EXPECT_EQ(sum.processor, "Cortex-M4");
}

}  // namespace
}  // namespace fxdyn
