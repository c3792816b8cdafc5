#include "host_tools/diagnose/windows.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "host_tools/diagnose/sessions.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Seconds of two joints at 100 Hz, a row every tenth sample. The position is the time, so that a sample tells where
/// it comes from, modulo 50 s, so that every part of it moves alike.
SessionLog log_of(double seconds, double begins = 0) {
  const auto samples = static_cast<Index>(100 * seconds) + 1;
  SessionLog out;
  out.age_s = begins;
  ProcessedLog& log = out.log;
  log.step_s = 0.01;
  log.t = VectorXd::LinSpaced(samples, begins, begins + seconds);
  log.q = log.t.unaryExpr([](double t) { return std::fmod(t, 50); }).replicate(1, 2);
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
  out.least_kept_s = 0;
  return out;
}

std::vector<SessionLog> cut_up(const std::vector<SessionLog>& logs, const SessionOptions& options) {
  const auto windows = plan_windows(logs, 2, options);
  std::vector<SessionLog> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    for (SessionLog& window : in_windows(logs[l], windows[l])) out.push_back(std::move(window));
  }
  return out;
}

TEST(Windows, LogsThatFitStayWhole) {
  const auto out = cut_up({log_of(100), log_of(50)}, room_for(10'000));
  ASSERT_EQ(out.size(), 2U);
  EXPECT_EQ(out[0].log.samples(), 10'001);
}

// 1000 s and 400 s at 10 rows a second of two joints are 28 000 rows, of which there is room for a quarter.
TEST(Windows, LongLogsKeepEquallyManySpreadEvenly) {
  const auto out = cut_up({log_of(1000), log_of(400, 1000)}, room_for(7200));
  ASSERT_EQ(out.size(), 9U + 9U);
  Index rows = 0;
  for (const SessionLog& entry : out) {
    const ProcessedLog& log = entry.log;
    rows += 2 * log.rows();
    EXPECT_EQ(log.last - log.first, 2000);
    EXPECT_GE(log.first, 100);
    EXPECT_GE(log.samples() - log.last, 100);
    EXPECT_DOUBLE_EQ(log.q(0, 1), std::fmod(log.t[0], 50));
    EXPECT_DOUBLE_EQ(log.tau(log.last, 0), -log.q(log.last, 0));
    EXPECT_DOUBLE_EQ(log.from_s, log.t[0]);
    EXPECT_DOUBLE_EQ(log.to_s, log.t[log.samples() - 1]);
    EXPECT_NEAR(entry.age_s, log.t[0], 1e-9);  // as old as the session is
  }
  EXPECT_LE(rows, 7200);
  for (std::size_t w = 0; w < 9; ++w)
    EXPECT_NEAR(out[w].log.t[out[w].log.first + 1000], 1000 * (static_cast<double>(w) + 0.5) / 9, 0.5);
  EXPECT_NEAR(out[9].log.ran_s, out[9].log.t[0] - 1000, 1e-9);
  EXPECT_NE(out[0].cache, out[1].cache);
}

TEST(Windows, BelongToTheirRecording) {
  const auto out = cut_up({log_of(1000), log_of(400), log_of(30)}, room_for(5000));
  const auto recordings = by_recording(out);
  ASSERT_EQ(recordings.size(), 3U);
  EXPECT_EQ(recordings[0].size(), recordings[1].size());
  EXPECT_EQ(recordings[2], (std::vector<std::size_t>{out.size() - 1}));
}

TEST(Windows, ShortLogsStayWhole) {
  const auto out = cut_up({log_of(1000), log_of(30)}, room_for(4000));
  EXPECT_EQ(out.back().log.samples(), 3001);
  EXPECT_FALSE(out.back().log.continues);
  Index rows = 0;
  for (const SessionLog& entry : out) rows += 2 * entry.log.rows();
  EXPECT_LE(rows, 4000);
  EXPECT_GE(rows, 3500);
}

TEST(Windows, ManyLogsKeepLittleEach) {
  std::vector<SessionLog> logs(60, log_of(60));
  const auto out = cut_up(logs, room_for(60 * 2 * 80));  // 8 s each
  EXPECT_EQ(out.size(), 60U);
  for (const SessionLog& entry : out) EXPECT_EQ(entry.log.rows(), 80);
}

TEST(Windows, SomeSecondsStayHoweverManyRowsTheyHave) {
  SessionOptions options = room_for(2000);
  options.least_kept_s = 300;
  Index rows = 0;
  for (const SessionLog& entry : cut_up({log_of(1000)}, options)) rows += entry.log.rows();
  EXPECT_EQ(rows, 3000);
}

// What moves for a short while only would not be seen.
TEST(Windows, RangesTellWhereAJointHardlyMoves) {
  SessionLog once = log_of(1000);
  once.log.q.col(1).setZero();
  once.log.q.col(1).segment(60'000, 100).setLinSpaced(0, 1);
  Ranges of_whole(2), of_windows(2);
  for (Index j = 0; j < 2; ++j) of_whole.add(once, j, once.log.q.col(j));
  for (const SessionLog& window : cut_up({once}, room_for(2000))) {
    for (Index j = 0; j < 2; ++j) of_windows.add(window, j, window.log.q.col(j));
  }
  EXPECT_TRUE(of_whole.reach(1, of_whole));
  EXPECT_FALSE(of_windows.reach(0.1, of_whole));
}

/// 1000 s as sessions() takes them: neither smoothed nor thinned.
ProcessedLog long_recording() {
  ProcessedLog log = log_of(1000).log;
  log.filter.torque_cutoff_hz = 5;
  log.filter.position_cutoff_hz = 50;
  log.filter.excited_hz = 10;
  return log;
}

// Their columns are taken joint by joint.
TEST(Windows, SessionsOfLongLogsHaveTheirColumns) {
  ProcessedLog log = long_recording();
  log.lost_velocity = Eigen::MatrixXd::Zero(log.samples(), 2);
  log.lost_velocity.col(1) = log.t;
  std::optional<Session> session;
  const auto out = sessions({log}, {}, session, room_for(7200));
  ASSERT_EQ(out.size(), 18U);
  for (const SessionLog& entry : out) {
    const auto from = static_cast<Index>(std::lround(entry.log.t[0] / log.step_s));
    const Index count = entry.log.samples();
    EXPECT_EQ(entry.log.q, log.q.middleRows(from, count));
    EXPECT_EQ(entry.log.tau, log.tau.middleRows(from, count));
    EXPECT_EQ(entry.log.lost_velocity, log.lost_velocity.middleRows(from, count));
    EXPECT_EQ(entry.log.measured_dq.size(), 0);
  }
}

// What is fitted around the search sees the same seconds, at the rate of the recording.
TEST(Windows, AreTheSameSecondsOfTheRecording) {
  ProcessedLog log = long_recording(), shorter = log_of(30, 1000).log;
  log.filter.excited_hz = 1;  // the search smooths the positions
  log.first = 80;
  shorter.filter = log.filter;
  shorter.role = Role::validate;
  const SessionOptions options = room_for(7200);
  std::optional<Session> session;
  const auto searched = sessions({log, shorter}, {}, session, options);
  const auto out = windows_as_recorded({log, shorter}, searched, options);
  ASSERT_EQ(out.size(), searched.size());
  ASSERT_GT(out.size(), 10U);
  for (std::size_t w = 0; w + 1 < out.size(); ++w) {
    const ProcessedLog &seen = searched[w].log, &part = out[w];
    EXPECT_NEAR(part.t[part.first], seen.t[seen.first], 1e-9);
    EXPECT_NEAR(part.t[part.last - 1], seen.t[seen.last - 1], 1e-9);
    EXPECT_GE(part.first, 100);  // the filter's end, and what effects with memory were before
    const auto from = static_cast<Index>(std::lround(part.t[0] / log.step_s));
    EXPECT_EQ(part.q, log.q.middleRows(from, part.samples()));
    EXPECT_EQ(part.tau, log.tau.middleRows(from, part.samples()));
  }
  EXPECT_EQ(out.back().q, shorter.q);
  EXPECT_EQ(out.back().role, Role::validate);
}

// The first window may begin where the recording does.
TEST(Windows, OfALogThatIsALittleTooLongAreTheSameSeconds) {
  const ProcessedLog log = long_recording();
  const SessionOptions options = room_for(1.94e4);  // of 2 x 9994 rows
  std::optional<Session> session;
  const auto searched = sessions({log}, {}, session, options);
  const auto out = windows_as_recorded({log}, searched, options);
  ASSERT_GT(out.size(), 40U);
  EXPECT_LT(out.front().samples(), 2300);
  for (std::size_t w = 0; w < out.size(); ++w) {
    EXPECT_TRUE(searched[w].window);
    EXPECT_EQ(out[w].continues, w > 0);
    EXPECT_NEAR(out[w].t[out[w].first], searched[w].log.t[searched[w].log.first], 1e-9);
  }
}

TEST(Windows, HaveTheRowsOfTheSearchWhereTheWholeLogHasFewer) {
  ProcessedLog log = long_recording();
  const SessionOptions options = room_for(7200);
  std::optional<Session> session;
  const auto searched = sessions({log}, {}, session, options);
  const Index interval = std::lround(searched.front().log.decimation * searched.front().log.step_s / log.step_s);
  log.decimation = 10 * interval;
  EXPECT_EQ(windows_as_recorded({log}, searched, options).front().decimation, interval);
  log.decimation = 1;
  EXPECT_EQ(windows_as_recorded({log}, searched, options).front().decimation, 1);
}

TEST(Windows, AreNoneOfLogsThatFit) {
  const ProcessedLog log = long_recording();
  std::optional<Session> session;
  const SessionOptions options = room_for(1e6);
  EXPECT_TRUE(windows_as_recorded({log}, sessions({log}, {}, session, options), options).empty());
}

TEST(Windows, SessionsStayWholeWhereAJointMovesInNone) {
  ProcessedLog log = long_recording();
  log.q.col(1).setZero();
  log.q.col(1).segment(60'000, 100).setLinSpaced(0, 1);
  std::optional<Session> session;
  const auto out = sessions({log}, {}, session, room_for(2000));
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out.front().log.q, log.q);
  EXPECT_EQ(out.front().log.t, log.t);
}

TEST(Windows, KnowWhatTheFilterTookAway) {
  ProcessedLog log = log_of(100).log;
  log.lost_velocity = Eigen::MatrixXd::Zero(log.samples(), log.q.cols());
  log.lost_velocity(3500, 0) = 0.2;
  EXPECT_EQ(part_of(log, 3000, 6000, 100, 2900).lost_velocity(500, 0), 0.2);
}

TEST(Windows, WhatIsSaturatedMovesWithThem) {
  const ProcessedLog out = part_of(log_of(100).log, 3000, 6000, 100, 2900);
  EXPECT_EQ(out.samples(), 3000);
  ASSERT_EQ(out.saturated[0].size(), 1U);
  EXPECT_EQ(out.saturated[0][0], (std::array<Index, 2>{0, 1000}));
  EXPECT_TRUE(part_of(log_of(100).log, 5000, 6000, 100, 900).saturated[0].empty());
}

}  // namespace
}  // namespace fxdyn::diagnosis
