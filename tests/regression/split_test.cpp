#include "host_tools/regression/split.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

using Blocks = std::vector<std::vector<std::size_t>>;

Split split_of(const std::vector<LogRows>& logs) { return make_split(logs, make_blocks(logs)); }

TEST(Split, ValidateLogsJudgeWhatTrainLogsFit) {
  const std::vector<LogRows> logs{{Role::train, 10}, {Role::validate, 4}, {Role::train, 6}};
  const auto blocks = make_blocks(logs);
  ASSERT_EQ(blocks.size(), 3);
  EXPECT_EQ(blocks[2].log, 2);
  EXPECT_EQ(blocks[2].from, 14);
  EXPECT_EQ(blocks[2].to, 20);
  EXPECT_FALSE(blocks[1].train);
  const Split split = make_split(logs, blocks);
  EXPECT_TRUE(split.has_validation);
  EXPECT_EQ(split.fit, (Blocks{{0, 2}}));
  EXPECT_EQ(split.judge, (Blocks{{1}}));
}

TEST(Split, TrainLogsJudgeEachOther) {
  const Split split = split_of({{Role::train, 10}, {Role::train, 6}});
  EXPECT_FALSE(split.has_validation);
  EXPECT_EQ(split.fit, (Blocks{{1}, {0}}));
  EXPECT_EQ(split.judge, (Blocks{{0}, {1}}));
  EXPECT_EQ(split.kind, "each train log judged by a fit of the others (no log has the role validate)");
}

TEST(Split, ASingleLogIsCutIntoFiveBlocks) {
  const std::vector<LogRows> logs{{Role::train, 12}};
  const auto blocks = make_blocks(logs);
  ASSERT_EQ(blocks.size(), 5);
  EXPECT_EQ(blocks.front().from, 0);
  EXPECT_EQ(blocks.back().to, 12);
  for (std::size_t b = 1; b < blocks.size(); ++b) EXPECT_EQ(blocks[b].from, blocks[b - 1].to);
  const Split split = make_split(logs, blocks);
  EXPECT_EQ(split.fit[3], (std::vector<std::size_t>{0, 1, 2, 4}));
  EXPECT_EQ(split.judge[3], (std::vector<std::size_t>{3}));
}

}  // namespace
}  // namespace fxdyn
