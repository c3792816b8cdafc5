// Fourier series in coordinates in which whatever an optimiser proposes keeps the limits.

#include "host_tools/excite/series_coordinates.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Position, velocity and acceleration of one joint over a period, as shares of what the series may use.
struct Used {
  double lowest = 1e300, highest = -1e300, velocity = 0, acceleration = 0;
};

class Coordinates : public testing::Test {
 protected:
  static constexpr double margin = 0.05;

  Coordinates() : check_(robot_, limits(), {}, margin) { settings_.order = 4; }

  static MotionLimits limits() {
    MotionLimits out;
    out.lower = VectorXd{{-1, -3}};
    out.upper = VectorXd{{2, 3}};
    out.velocity = VectorXd{{2, 0.5}};
    out.acceleration = VectorXd{{4, 10}};
    out.torque = VectorXd::Constant(2, 1e30);
    return out;
  }
  /// 50 times as finely as the coordinates look.
  Used used(const SeriesCoordinates& of, const FourierJoint& series, Index joint) const {
    Used out;
    constexpr int samples = 50 * 16 * 4;
    for (int i = 0; i < samples; ++i) {
      const FourierState state = evaluate(series, of.period_s(), of.period_s() * i / samples);
      out.lowest = std::min(out.lowest, state.q);
      out.highest = std::max(out.highest, state.q);
      out.velocity = std::max(out.velocity, std::fabs(state.dq) / (of.kind().velocity * limits().velocity[joint]));
      out.acceleration =
          std::max(out.acceleration, std::fabs(state.ddq) / (of.kind().acceleration * limits().acceleration[joint]));
    }
    return out;
  }

  const Robot robot_ = test::pendulum(2);
  LimitCheck check_;
  ExciteSettings settings_;
};

TEST_F(Coordinates, HaveADirectionForEachCoefficientThatTheBoundariesLeave) {
  const SeriesCoordinates of(check_, {"fast", 1, 1, 2}, settings_);
  EXPECT_EQ(of.per_joint(), 3 + 2 + 1);  // sum a = 0; sum k b = sum b / k = 0; the centre
  EXPECT_EQ(of.size(), 12);
  EXPECT_EQ(of.period_s(), 5);  // two in ten seconds
}

TEST_F(Coordinates, KeepTheLimitsWhateverTheyAre) {
  const SeriesCoordinates of(check_, {"fast", 0.9, 0.8, 1}, settings_);
  Random random(3);
  double most = 0;
  for (int draw = 0; draw < 50; ++draw) {
    VectorXd x(of.size());
    for (double& value : x) value = 5 * random.normal();
    const SeriesCoordinates::Decoded decoded = of.decode(x);
    EXPECT_GT(decoded.overflow, 0);
    for (Index j = 0; j < 2; ++j) {
      const FourierJoint& series = decoded.series[static_cast<std::size_t>(j)];
      const Used share = used(of, series, j);
      EXPECT_GE(share.lowest, check_.lower()[j]);
      EXPECT_LE(share.highest, check_.upper()[j]);
      EXPECT_LE(share.velocity, 1 - margin);
      EXPECT_LE(share.acceleration, 1 - margin);
      most = std::max({most, share.velocity, share.acceleration});
      const FourierState start = evaluate(series, of.period_s(), 0);
      EXPECT_NEAR(start.dq, 0, 1e-12);
      EXPECT_NEAR(start.ddq, 0, 1e-12);
      EXPECT_NEAR(start.q, decoded.motion.q(0, j), 1e-12);
    }
  }
  EXPECT_GT(most, 0.97 * (1 - margin));  // and use them
}

TEST_F(Coordinates, ARandomSeriesReachesTheTightestLimit) {
  const SeriesCoordinates of(check_, {"fast", 0.9, 0.8, 1}, settings_);
  const SeriesCoordinates::Decoded decoded = of.decode(of.random(5, VectorXd::Zero(2)));
  EXPECT_NEAR(decoded.overflow, 0, 1e-20);
  // A peak of the 4th harmonic is higher than its highest of 16 samples by that much at most.
  const double sampled = 1 - 0.5 * std::pow(std::numbers::pi / 16, 2);
  for (Index j = 0; j < 2; ++j) {
    const auto largest = [&](const Eigen::MatrixXd& m, double limit) { return m.col(j).cwiseAbs().maxCoeff() / limit; };
    const VectorXd q = decoded.motion.q.col(j);
    const double tightest = std::max({(q.maxCoeff() - q.minCoeff()) / (check_.upper()[j] - check_.lower()[j]),
                                      largest(decoded.motion.dq, 0.9 * (1 - margin) * limits().velocity[j]),
                                      largest(decoded.motion.ddq, 0.8 * (1 - margin) * limits().acceleration[j])});
    EXPECT_NEAR(tightest, sampled, 1e-9) << j;
  }
}

TEST_F(Coordinates, OverflowSaysHowFarBeyondTheLimitsTheyAsk) {
  const SeriesCoordinates of(check_, {"fast", 0.9, 0.8, 1}, settings_);
  VectorXd x = of.random(5, VectorXd::Zero(2));
  const auto at_limit = of.decode(x).series;
  of.shrink(x, 3);
  const SeriesCoordinates::Decoded beyond = of.decode(x);
  EXPECT_NEAR(beyond.overflow, 2 * std::pow(std::log(3), 2), 1e-9);  // three times too much at both joints
  EXPECT_LT((beyond.series[0].a - at_limit[0].a).norm(), 1e-9);
  of.shrink(x, 0.1);
  const SeriesCoordinates::Decoded within = of.decode(x);
  EXPECT_EQ(within.overflow, 0);
  EXPECT_LT((within.series[1].b - 0.3 * at_limit[1].b).norm(), 1e-9);
}

TEST_F(Coordinates, TheCentreIsKeptWhereTheLimitsLetIt) {
  const SeriesCoordinates of(check_, {"slow", 0.1, 0.1, 1}, settings_);
  VectorXd centre{{0.25, -1.5}};
  auto series = of.decode(of.random(5, centre)).series;
  for (Index j = 0; j < 2; ++j) EXPECT_NEAR(series[static_cast<std::size_t>(j)].centre, centre[j], 1e-9);
  centre[0] = 2;  // at the limit, where nothing may move about it
  series = of.decode(of.random(5, centre)).series;
  EXPECT_LT(series[0].centre, 2);
  EXPECT_GT(series[0].centre, 1);
  EXPECT_LE(used(of, series[0], 0).highest, check_.upper()[0]);
}

}  // namespace
}  // namespace fxdyn
