#include "host_tools/regression/split.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

using Blocks = std::vector<std::vector<std::size_t>>;

TEST(Split, ValidateLogsJudgeWhatTrainLogsFit) {
  const std::vector<LogRows> logs{{Role::train, 10}, {Role::validate, 4}, {Role::train, 6}};
  const auto blocks = make_blocks(logs);
  ASSERT_EQ(blocks.size(), 3);
  EXPECT_EQ(blocks[2].log, 2);
  EXPECT_EQ(blocks[2].from, 14);
  EXPECT_EQ(blocks[2].to, 20);
  EXPECT_FALSE(blocks[1].train);
  const Split split = make_split(logs);
  EXPECT_TRUE(split.has_validation);
  EXPECT_EQ(split.fit, (Blocks{{0, 2}}));
  EXPECT_EQ(split.judge, (Blocks{{1}}));
}

TEST(Split, TrainLogsJudgeEachOther) {
  const Split split = make_split({{Role::train, 10}, {Role::train, 6}});
  EXPECT_FALSE(split.has_validation);
  EXPECT_EQ(split.fit, (Blocks{{1}, {0}}));
  EXPECT_EQ(split.judge, (Blocks{{0}, {1}}));
  EXPECT_EQ(split.kind, "each train log judged by a fit of the others (no log has the role validate)");
}

TEST(Folds, AHealthySessionFitsAndNeverJudges) {
  const std::vector<LogUse> logs{{.rows = 50}, {.rows = 50}, {.rows = 50, .judges = false}};
  const auto parts = parts_of(logs);
  ASSERT_EQ(parts.size(), 3);
  EXPECT_EQ(parts[2].rows.first, 100);
  const auto folds = folds_of(logs, parts);
  ASSERT_EQ(folds.size(), 2);
  EXPECT_EQ(folds[1].fit, (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(folds[1].judge, (std::vector<std::size_t>{1}));
}

TEST(Folds, TheOnlyLogThatJudgesIsCutBesideAHealthySession) {
  const std::vector<LogUse> logs{{.rows = 10, .judges = false}, {.rows = 20}};
  const auto parts = parts_of(logs);
  ASSERT_EQ(parts.size(), 6);
  EXPECT_EQ(parts[1].rows.first, 10);
  const auto folds = folds_of(logs, parts);
  ASSERT_EQ(folds.size(), 5);
  EXPECT_EQ(folds[0].fit, (std::vector<std::size_t>{0, 2, 3, 4, 5}));
  EXPECT_EQ(folds[0].judge, (std::vector<std::size_t>{1}));
}

TEST(Split, ASingleLogIsCutIntoFiveBlocks) {
  const std::vector<LogRows> logs{{Role::train, 12}};
  const auto blocks = make_blocks(logs);
  ASSERT_EQ(blocks.size(), 5);
  EXPECT_EQ(blocks.front().from, 0);
  EXPECT_EQ(blocks.back().to, 12);
  for (std::size_t b = 1; b < blocks.size(); ++b) EXPECT_EQ(blocks[b].from, blocks[b - 1].to);
  const Split split = make_split(logs);
  EXPECT_EQ(split.fit[3], (std::vector<std::size_t>{0, 1, 2, 4}));
  EXPECT_EQ(split.judge[3], (std::vector<std::size_t>{3}));
}

}  // namespace
}  // namespace fxdyn
