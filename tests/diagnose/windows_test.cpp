#include "host_tools/diagnose/windows.hpp"

#include <gtest/gtest.h>

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Seconds of two joints at 100 Hz, a row every tenth sample. The position is the time, so that a sample tells where
/// it comes from.
SessionLog log_of(double seconds, double begins = 0) {
  const auto samples = static_cast<Index>(100 * seconds) + 1;
  SessionLog out;
  out.age_s = begins;
  ProcessedLog& log = out.log;
  log.step_s = 0.01;
  log.t = VectorXd::LinSpaced(samples, begins, begins + seconds);
  log.q = log.t.replicate(1, 2);
  log.tau = -log.q;
  log.first = 30;
  log.last = samples - 30;
  log.decimation = 10;
  log.saturated = {{{2000, 4000}}, {}};
  log.to_s = seconds;
  return out;
}

SessionOptions room_for(double rows) {
  SessionOptions out;
  out.most_rows = rows;
  out.window_s = 20;
  out.run_in_s = 1;
  return out;
}

TEST(Windows, LogsThatFitStayWhole) {
  const auto out = in_windows({log_of(100), log_of(50)}, room_for(10'000));
  ASSERT_EQ(out.size(), 2U);
  EXPECT_EQ(out[0].log.samples(), 10'001);
}

TEST(Windows, LongLogsKeepTheSameShareSpreadEvenly) {
  // 1000 s and 400 s at 10 rows a second of two joints: 28 000 rows, of which there is room for a fifth.
  const auto out = in_windows({log_of(1000), log_of(400, 1000)}, room_for(5600));
  ASSERT_EQ(out.size(), 10U + 3U);
  Index rows = 0;
  for (const SessionLog& entry : out) {
    const ProcessedLog& log = entry.log;
    rows += 2 * log.rows();
    EXPECT_EQ(log.last - log.first, 2000);
    EXPECT_GE(log.first, 100);
    EXPECT_GE(log.samples() - log.last, 100);
    EXPECT_DOUBLE_EQ(log.q(0, 1), log.t[0]);
    EXPECT_DOUBLE_EQ(log.tau(log.last, 0), -log.t[log.last]);
    EXPECT_DOUBLE_EQ(log.from_s, log.t[0]);
    EXPECT_DOUBLE_EQ(log.to_s, log.t[log.samples() - 1]);
    EXPECT_NEAR(entry.age_s, log.t[0], 1e-9);  // as old as the session is
  }
  EXPECT_LE(rows, 5600);
  for (std::size_t w = 0; w < 10; ++w)
    EXPECT_NEAR(out[w].log.t[out[w].log.first + 1000], 100 * (static_cast<double>(w) + 0.5), 0.5);
  EXPECT_NE(out[0].cache, out[1].cache);
}

TEST(Windows, WhatIsSaturatedMovesWithThem) {
  const ProcessedLog out = part_of(log_of(100).log, 3000, 6000, 100, 2900);
  EXPECT_EQ(out.samples(), 3000);
  ASSERT_EQ(out.saturated[0].size(), 1U);
  EXPECT_EQ(out.saturated[0][0], (std::array<Index, 2>{0, 1000}));
  EXPECT_TRUE(part_of(log_of(100).log, 5000, 6000, 100, 900).saturated[0].empty());
}

TEST(Windows, NoneIsLongerThanItsLog) {
  const auto out = in_windows({log_of(1000), log_of(19)}, room_for(4000));
  EXPECT_EQ(out.back().log.samples(), 1901);
}

}  // namespace
}  // namespace fxdyn::diagnosis
