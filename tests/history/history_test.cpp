#include "host_tools/history/history.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "host_tools/history/student.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn::history {
namespace {

TEST(Student, AgreesWithPrintedTables) {
  // Abramowitz and Stegun 1964, Table 26.10: percentage points of the t distribution, rounded to 0.001
  const auto expect_point = [](double p, int degrees, double t) {
    EXPECT_GT(two_sided_p(t - 5e-4, degrees), p) << degrees;
    EXPECT_LT(two_sided_p(t + 5e-4, degrees), p) << degrees;
  };
  expect_point(0.05, 1, 12.706);
  expect_point(0.05, 2, 4.303);
  expect_point(0.01, 3, 5.841);
  expect_point(0.05, 5, 2.571);
  expect_point(0.01, 10, 3.169);
  expect_point(0.05, 30, 2.042);
  EXPECT_EQ(two_sided_p(0, 7), 1);
  EXPECT_NEAR(two_sided_quantile(0.05, 5), 2.571, 6e-4);
  EXPECT_NEAR(two_sided_quantile(0.01, 10), 3.169, 6e-4);
}

std::vector<Measured> series(int n, std::mt19937& random, double slope, double step) {
  std::normal_distribution<double> scatter;
  std::vector<Measured> out;
  for (int i = 0; i < n; ++i) out.push_back({10.0 * i, 5 + slope * i + (2 * i >= n ? step : 0) + scatter(random), 0.1});
  return out;
}

TEST(Changes, ATrendIsATrendAndAStepAStep) {
  std::mt19937 random(1);
  const Course trend = *course_of(series(20, random, 0.5, 0));
  EXPECT_EQ(trend.change, Change::trend);
  EXPECT_LT(trend.log10_p, -6);
  EXPECT_NEAR(trend.line.slope, 0.05, 4 * trend.line.slope_std);
  const Course step = *course_of(series(20, random, 0, 8));
  EXPECT_EQ(step.change, Change::step);
  EXPECT_EQ(step.step.index, 10u);
  EXPECT_NEAR(step.step.after - step.step.before, 8, 4 * step.step.std);
}

TEST(Changes, TooFewSessionsSayNothing) {
  std::mt19937 random(1);
  EXPECT_FALSE(course_of(series(5, random, 10, 0)));
  EXPECT_TRUE(course_of(series(6, random, 10, 0)));
}

TEST(Changes, WhatStandsStillChangesAsOftenAsPSays) {
  for (const int n : {6, 12, 30}) {
    int found = 0;
    constexpr int draws = 4000;
    std::mt19937 random(static_cast<unsigned>(n));
    for (int i = 0; i < draws; ++i) found += course_of(series(n, random, 0, 0))->log10_p <= std::log10(0.05);
    // 5 % of 4000 are 200 +- 14; Bonferroni makes it fewer, and not none
    EXPECT_LE(found, 242) << n;
    EXPECT_GE(found, 40) << n;
  }
}

TEST(Changes, AScatterBelowWhatTheFitsStateIsNotBelieved) {
  std::vector<Measured> still;
  for (int i = 0; i < 8; ++i) still.push_back({1.0 * i, 3 + 1e-9 * i, 0.2});
  EXPECT_GT(course_of(still)->log10_p, -1);
}

TEST(Changes, TheIntervalOfALimitHoldsItsMoment) {
  // True line: 5 + 0.2 a session, limit 12: reached 35 sessions after the first.
  std::mt19937 random(5);
  int holds = 0, stated = 0;
  constexpr int draws = 2000;
  for (int i = 0; i < draws; ++i) {
    const auto values = series(20, random, 0.2, 0);
    const auto reached = when_reached(course_of(values)->line, 12, values.back().at);
    if (!reached || !reached->earliest) continue;
    ++stated;
    holds += *reached->earliest <= 350 && (!reached->latest || *reached->latest >= 350);
  }
  EXPECT_GT(stated, 0.95 * draws);
  // 95 % of 2000 are 1900 +- 10
  EXPECT_NEAR(static_cast<double>(holds) / stated, 0.95, 0.02);
}

TEST(Changes, ALimitBehindIsNotReached) {
  const Line line{.centre = 0, .level = 5, .slope = 1, .level_std = 0.1, .slope_std = 0.1, .degrees = 10};
  EXPECT_FALSE(when_reached(line, 6, 10));
  EXPECT_NEAR(when_reached(line, 20, 10)->at, 15, 1e-12);
  EXPECT_FALSE(when_reached(line, -20, 10));
}

TEST(Sessions, ADateIsFoundInAName) {
  EXPECT_EQ(date_of(*day_in("session_2026-05-01")), "2026-05-01");
  EXPECT_EQ(date_of(*day_in("20260301_robot.csv")), "2026-03-01");
  EXPECT_FALSE(day_in("robot_20261301"));
  EXPECT_FALSE(day_in("2026-02-30"));
  EXPECT_FALSE(day_in("120260301"));
  EXPECT_FALSE(day_in("run7"));
}

Session session(const std::string& name, std::optional<double> day, double coulomb, double error) {
  Session out;
  out.name = name;
  out.day = day;
  out.robot = "arm";
  out.joints = {"elbow"};
  out.good_error["elbow"] = 0.5;
  out.values[{"elbow", "coulomb amplitude", "N*m"}] = {0, coulomb, 0.01};
  out.values[{"elbow", error_name, "N*m"}] = {0, error, 0};
  return out;
}

std::vector<Session> sessions(int n, bool dated) {
  std::vector<Session> out;
  for (int i = 0; i < n; ++i) {
    const double wobble = 0.01 * ((7 * i) % 5 - 2);
    out.push_back(session("s" + std::to_string(i), dated ? std::optional(20000.0 + 30 * i) : std::nullopt,
                          2 + 0.1 * i + wobble, 0.2 + 0.001 * ((3 * i) % 4)));
  }
  return out;
}

TEST(History, WhatDriftsComesFirstWithItsLimit) {
  auto all = sessions(10, true);
  std::swap(all[1], all[7]);  // they are sorted by day
  Options options;
  options.limits = {{"elbow coulomb amplitude", 4}};
  const History history = history_of(all, options);
  EXPECT_EQ(history.sessions[1].name, "s1");
  ASSERT_EQ(history.series.size(), 2u);
  const Series& first = history.series[0];
  EXPECT_EQ(first.quantity.name, "coulomb amplitude");
  EXPECT_TRUE(first.changes);
  EXPECT_FALSE(history.series[1].changes);
  ASSERT_TRUE(first.reached);
  EXPECT_NEAR(first.reached->at, 20600, 15);  // 0.1 in 30 days, 2 more to go from day 20000
  const std::string words = sentence_of(history, first);
  EXPECT_NE(words.find("elbow coulomb amplitude grows by 0.9"), std::string::npos) << words;
  EXPECT_NE(words.find("in 270 days; it reaches 4 N*m about 2026-05-"), std::string::npos) << words;
}

TEST(History, EffectsComeAndGo) {
  auto all = sessions(3, false);
  all[1].effects = {"elbow: ripple"};
  const History history = history_of(all);
  ASSERT_EQ(history.events.size(), 2u);
  EXPECT_TRUE(history.events[0].appears);
  EXPECT_EQ(history.events[0].session, 1u);
  EXPECT_FALSE(history.events[1].appears);
  EXPECT_FALSE(history.series[0].course);
}

void expect_refused(std::vector<Session> all, const Options& options, const std::string& part) {
  try {
    history_of(std::move(all), options);
    ADD_FAILURE() << "no complaint of " << part;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(History, BadInput) {
  expect_refused(sessions(1, true), {}, "two result folders");
  auto others = sessions(3, true);
  others[2].robot = "another";
  expect_refused(others, {}, "of robot 'another'");
  auto undated = sessions(3, true);
  undated[1].day.reset();
  expect_refused(undated, {}, "s1: nothing tells its day");
  Options options;
  options.limits = {{"elbow coulomb amplitud", 4}};
  expect_refused(sessions(3, true), options, "nearest is 'elbow coulomb amplitude'");
}

}  // namespace
}  // namespace fxdyn::history
