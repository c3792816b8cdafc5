// The rows of logs as blocks and folds.

#include "host_tools/diagnose/blocks.hpp"

#include <gtest/gtest.h>

#include "host_tools/regression/row_ranges.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Places = std::vector<std::size_t>;

SessionLog log(bool healthy, bool fits, Eigen::Index rows = 50) {
  SessionLog out;
  out.log.first = 10;
  out.log.last = 10 + rows;
  out.healthy = healthy;
  out.fits = fits;
  return out;
}

TEST(RowRanges, AreCutWithoutAGap) {
  const std::vector<RowRange> parts = cut({100, 52}, 5);
  ASSERT_EQ(parts.size(), 5U);
  Eigen::Index next = 100;
  for (const RowRange& part : parts) {
    EXPECT_EQ(part.first, next);
    EXPECT_NEAR(static_cast<double>(part.count), 10.4, 1);
    next += part.count;
  }
  EXPECT_EQ(next, 152);
}

TEST(BlocksOfLogs, ValidateLogsJudgeAll) {
  const Blocks blocks = make_blocks({log(false, true), log(false, false), log(true, true)});
  ASSERT_EQ(blocks.all.size(), 3U);
  EXPECT_EQ(blocks.rows(), 150);
  EXPECT_EQ(blocks.fit, (Places{0, 2}));
  ASSERT_EQ(blocks.folds.size(), 1U);
  EXPECT_EQ(blocks.folds[0].fit, (Places{0, 2}));
  EXPECT_EQ(blocks.folds[0].judge, (Places{1}));
  EXPECT_EQ(blocks.fit_of(true), (Places{2}));
  EXPECT_EQ(blocks.fit_of(false), (Places{0}));
}

TEST(BlocksOfLogs, WithoutValidateLogsAFoldIsAPartOfEveryTrainLog) {
  const Blocks blocks = make_blocks({log(false, true), log(false, true), log(true, true)});
  ASSERT_EQ(blocks.all.size(), 11U);
  ASSERT_EQ(blocks.folds.size(), 5U);  // the healthy session never judges
  EXPECT_EQ(blocks.folds[1].judge, (Places{1, 6}));
  EXPECT_EQ(blocks.folds[1].fit, (Places{0, 2, 3, 4, 5, 7, 8, 9, 10}));
  ASSERT_EQ(blocks.whole_logs.size(), 2U);
  EXPECT_EQ(blocks.whole_logs[1].judge, (Places{5, 6, 7, 8, 9}));
  EXPECT_EQ(blocks.whole_logs[1].fit, (Places{0, 1, 2, 3, 4, 10}));
}

TEST(BlocksOfLogs, WindowsOfARecordingAreOne) {
  std::vector<SessionLog> logs{log(false, true), log(false, true), log(false, true, 30), log(true, true)};
  logs[1].log.continues = true;
  const Blocks blocks = make_blocks(logs);
  EXPECT_EQ(blocks.of_log.size(), 4U);
  ASSERT_EQ(blocks.all.size(), 11U);
  EXPECT_EQ(blocks.all[2].first, 40);  // a fifth of 100 rows each
  EXPECT_EQ(blocks.all[2].count, 20);
  EXPECT_EQ(blocks.all[5].log, 2U);
  EXPECT_EQ(blocks.rows(), 180);
  ASSERT_EQ(blocks.whole_logs.size(), 2U);
  EXPECT_EQ(blocks.whole_logs[0].judge, (Places{0, 1, 2, 3, 4}));
  logs[2].fits = false;
  EXPECT_EQ(make_blocks(logs).all.size(), 3U);
}

TEST(BlocksOfLogs, ASingleTrainLogIsCut) {
  const Blocks blocks = make_blocks({log(false, true)});
  EXPECT_EQ(blocks.all.size(), 5U);
  EXPECT_EQ(blocks.of_log.size(), 1U);
  ASSERT_EQ(blocks.folds.size(), 5U);
  EXPECT_EQ(blocks.folds[2].fit, (Places{0, 1, 3, 4}));
  EXPECT_EQ(blocks.folds[2].judge, (Places{2}));
}

/// Folds around a model with effects at PUMA's second joint, which moves in the second of two train logs by a share
/// of its motion in the first.
std::size_t folds(const std::vector<EffectFit>& effects, double share) {
  Models models = test::around(test::fitted_puma());
  for (const EffectFit& effect : effects) models.current->joints[1].effects.push_back(effect);
  std::vector<SessionLog> logs;
  for (const std::uint64_t seed : {1, 2}) logs.push_back(test::small_session_log(models.current, Role::train, seed));
  logs[1].log.q.col(1) *= share;
  return Linearised(models, logs, test::no_whitening()).blocks().folds.size();
}

TEST(BlocksOfLogs, AnEffectThatOneLogAloneExcitesIsJudgedByPartsOfIt) {
  const EffectFit cubic = test::named_effect("viscous_cubic", {}, {0.5});
  EXPECT_EQ(folds({cubic}, 1), 2U);
  EXPECT_EQ(folds({cubic}, 0.4), 5U);
  EXPECT_EQ(folds({}, 0.4), 2U);
}

}  // namespace
}  // namespace fxdyn::diagnosis
