// A torque that comes and goes by itself gets a curve over time, whose band holds the truth; noise gets none.

#include "host_tools/diagnose/time_curve.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double row_s = 0.05, noise = 0.1;

/// Two minutes of rows; the joint goes to and fro in 7 s, and noise of which each row remembers a share of the last.
struct Minutes {
  explicit Minutes(std::uint64_t seed, double memory = 0) {
    Random random(seed);
    const Index count = 2400;
    rows.t = VectorXd::LinSpaced(count, 1000, 1000 + row_s * static_cast<double>(count - 1));
    phase = 2 * std::numbers::pi / 7 * rows.t.array();
    rows.sign = (30 * phase.cos()).tanh();
    rows.e.resize(count);
    double last = 0;
    for (double& e : rows.e) e = last = memory * last + std::sqrt(1 - memory * memory) * noise * random.normal();
    rows.rivals.resize(count, 6);
    for (Index k = 0; k < 3; ++k) {
      rows.rivals.col(2 * k) = (static_cast<double>(k + 1) * phase).cos();
      rows.rivals.col(2 * k + 1) = (static_cast<double>(k + 1) * phase).sin();
    }
  }
  /// A wave of so many seconds, and another one.
  ArrayXd wave(double period_s) const {
    const ArrayXd turn = 2 * std::numbers::pi / period_s * rows.t.array();
    return turn.sin() + 0.4 * (0.37 * turn).cos();
  }
  std::optional<TimeFit> fit() const {
    return fit_over_time(rows, std::sqrt(rows.e.squaredNorm() / static_cast<double>(rows.e.size())), row_s, {});
  }

  TimedRows rows;
  ArrayXd phase;
};

/// Share of the points at which two deviations hold the truth. @param without_mean as curves are drawn
double covered(const TimeFit& fit, const VectorXd& t, const ArrayXd& truth, bool without_mean = false) {
  MatrixXd x = bumps_over_time(fit, t);
  if (without_mean) x.rowwise() -= x.colwise().mean().eval();
  const ArrayXd off = (x * fit.heights).array() - truth + (without_mean ? truth.mean() : 0);
  const ArrayXd std = (x * fit.covariance).cwiseProduct(x).rowwise().sum().array().sqrt();
  return (off.abs() < 2 * std).cast<double>().mean();
}

TEST(TimeCurve, FollowsAWaveThatNoMotionMakes) {
  for (const double period_s : {9.0, 25.0, 80.0}) {
    Minutes session(1);
    const ArrayXd truth = 0.2 * session.wave(period_s);
    session.rows.e += truth.matrix();
    const auto fit = session.fit();
    ASSERT_TRUE(fit);
    EXPECT_FALSE(fit->friction);
    EXPECT_GT(fit->odds_nothing, 20) << period_s;
    EXPECT_GT(fit->square_of_rivals, 1 - fit->closes);
    EXPECT_GT(fit->closes, 0.9 * truth.square().sum() / session.rows.e.squaredNorm());
    EXPECT_GT(covered(*fit, session.rows.t, truth), 0.85) << period_s;
  }
}

/// Columns that wander, as those of a slow motion do.
MatrixXd wandering_columns(Index rows, Index columns, std::uint64_t seed) {
  Random random(seed);
  MatrixXd out(rows, columns);
  for (Index c = 0; c < columns; ++c) {
    double last = 0;
    for (double& x : out.col(c)) x = last = 0.97 * last + random.normal();
  }
  return out;
}

// Columns that were fitted before have taken some of the wave.
TEST(TimeCurve, GetsBackWhatOtherColumnsTook) {
  double with = 0, without = 0;
  constexpr int seeds = 8;
  for (int seed = 0; seed < seeds; ++seed) {
    Minutes session(5 + static_cast<std::uint64_t>(seed));
    const ArrayXd truth = 0.2 * session.wave(40);
    session.rows.e += truth.matrix();
    const MatrixXd columns = wandering_columns(session.rows.t.size(), 15, 100 + static_cast<std::uint64_t>(seed));
    session.rows.covariance = (columns.transpose() * columns).inverse();
    session.rows.e -= columns * (session.rows.covariance * (columns.transpose() * session.rows.e));
    const auto lacking = session.fit();
    session.rows.nominal = columns;
    const auto whole = session.fit();
    ASSERT_TRUE(lacking && whole);
    without += covered(*lacking, session.rows.t, truth, true) / seeds;
    with += covered(*whole, session.rows.t, truth, true) / seeds;
  }
  EXPECT_LT(without, 0.8);
  EXPECT_GT(with, 0.9);
}

TEST(TimeCurve, TellsFrictionByTheDirection) {
  Minutes session(2);
  session.rows.e += (0.2 * session.wave(40) * session.rows.sign.array()).matrix();
  const auto fit = session.fit();
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->friction);
  EXPECT_GT(fit->odds_nothing, 20);
  EXPECT_GT(covered(*fit, session.rows.t, 0.2 * session.wave(40)), 0.85);
}

TEST(TimeCurve, NoiseOfAnyColourHasNone) {
  for (const double memory : {0.0, 0.7, 0.9}) {
    int sure = 0;
    for (std::uint64_t seed = 10; seed < 60; ++seed) {
      const auto fit = Minutes(seed, memory).fit();
      sure += fit && fit->odds_nothing > 3 && fit->closes > 0.2;
    }
    EXPECT_EQ(sure, 0) << memory;
  }
}

TEST(TimeCurve, AFunctionOfTheMotionIsNoneOfTime) {
  Minutes session(3);
  session.rows.e += (0.2 * (2 * session.phase).sin()).matrix();
  const auto fit = session.fit();
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->square_of_rivals, 1 - fit->closes);
}

TEST(TimeCurve, AFunctionOfTheMotionIsSeenAmongManyThatOnlyFitNoise) {
  Minutes session(4);
  const Index count = session.rows.t.size(), many = 120;
  Random random(5);
  session.rows.rivals.resize(count, 1 + many);
  session.rows.rivals.col(0) = session.wave(20);
  for (Index k = 1; k <= many; ++k) {
    double slow = 0;
    for (double& value : session.rows.rivals.col(k)) value = slow = 0.98 * slow + 0.2 * random.normal();
  }
  session.rows.e += 0.2 * session.rows.rivals.col(0);
  const auto together = session.fit();
  session.rows.families = {{0, 1}};
  const auto alone = session.fit();
  ASSERT_TRUE(together && alone);
  EXPECT_GT(together->square_of_rivals, 1 - together->closes);
  EXPECT_LT(alone->square_of_rivals, 1 - alone->closes);
}

TEST(TimeCurve, EndsAtItsLastKnot) {
  TimeFit fit;
  fit.knot_s = 2;
  fit.heights.setOnes(12);
  const MatrixXd x = bumps_over_time(fit, VectorXd::LinSpaced(41, -1, 19));
  EXPECT_TRUE((x * fit.heights).isApproxToConstant(1.5, 1e-9));  // of equal heights
}

/// 20 s of one joint that turns at 1 rad/s, then back.
SessionLog turning(const char* name) {
  SessionLog out;
  ProcessedLog& log = out.log;
  log.name = name;
  log.step_s = 0.01;
  log.t = VectorXd::LinSpaced(2001, 100, 120);
  log.q = (10 - (log.t.array() - 110).abs()).matrix();
  log.tau = MatrixXd::Zero(2001, 1);
  log.first = 20;
  log.last = 1980;
  return out;
}

TEST(TimeCurve, IsTakenOffTheLogsThatItIsOf) {
  CurveResult curve;
  curve.signal = "t";
  curve.log = "a";
  curve.points = {{100.2, 1, 0}, {110, 3, 0}, {119.8, 1, 0}};
  std::vector<SessionLog> logs{turning("a"), turning("b"), turning("a")};
  logs[2].healthy = true;
  take_off(curve, 0, 0.01, logs);
  EXPECT_NEAR(logs[0].log.tau(0, 0), -1, 1e-9);  // constant beyond its ends
  EXPECT_NEAR(logs[0].log.tau(510, 0), -2, 1e-9);
  EXPECT_NEAR(logs[0].log.tau(1490, 0), -2, 1e-9);
  EXPECT_TRUE(logs[1].log.tau.isZero());
  EXPECT_TRUE(logs[2].log.tau.isZero());
  curve.log.clear();
  curve.friction = true;
  take_off(curve, 0, 0.01, logs);
  EXPECT_NEAR(logs[1].log.tau(510, 0), -2, 1e-6);
  EXPECT_NEAR(logs[1].log.tau(1490, 0), 2, 1e-6);
}

TEST(TimeCurve, TooFewRowsHaveNone) {
  Minutes session(4);
  TimedRows few;
  few.t = session.rows.t.head(20);
  few.e = session.rows.e.head(20);
  few.sign = session.rows.sign.head(20);
  EXPECT_FALSE(fit_over_time(few, noise, row_s, {}));
  EXPECT_FALSE(fit_over_time({}, noise, row_s, {}));
}

}  // namespace
}  // namespace fxdyn::diagnosis
