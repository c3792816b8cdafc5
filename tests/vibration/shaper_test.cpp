#include "host_tools/vibration/shaper.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/vibration/nonnegative.hpp"
#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double tick = 0.001, pi = std::numbers::pi;

/// Exact frequency, no margin: what the textbook's shapers are of.
Band at(double frequency_hz, double damping = 0) { return {frequency_hz, frequency_hz, damping}; }
Band around(double frequency_hz, double margin, double damping = 0) {
  return {(1 - margin) * frequency_hz, (1 + margin) * frequency_hz, damping};
}

void expect_valid(const Shaper& shaper) {
  EXPECT_NEAR(shaper.impulses.sum(), 1, 1e-12);
  EXPECT_GE(shaper.impulses.minCoeff(), 0);
}

/// A mass on a spring and damper whose other end follows the reference, linear between its ticks (Runge-Kutta, a
/// twentieth of a tick). Largest |x - end| from sample `from` on.
double swing_of_mass(const Reference& path, double frequency_hz, double damping, Index from) {
  const double w = 2 * pi * frequency_hz;
  const int parts = 20;
  const double h = path.step_s / parts;
  double x = path.q(0, 0), v = 0, largest = 0;
  const double end = path.q(path.q.rows() - 1, 0);
  for (Index k = 0; k + 1 < path.q.rows(); ++k) {
    if (k >= from) largest = std::max(largest, std::fabs(x - end));
    for (int i = 0; i < parts; ++i) {
      const auto base = [&](double share) {
        const double s = (i + share) / parts;
        return std::pair((1 - s) * path.q(k, 0) + s * path.q(k + 1, 0),
                         (1 - s) * path.dq(k, 0) + s * path.dq(k + 1, 0));
      };
      const auto rate = [&](double share, double at_x, double at_v) {
        const auto [u, du] = base(share);
        return std::pair(at_v, w * w * (u - at_x) + 2 * damping * w * (du - at_v));
      };
      const auto [x1, v1] = rate(0, x, v);
      const auto [x2, v2] = rate(0.5, x + 0.5 * h * x1, v + 0.5 * h * v1);
      const auto [x3, v3] = rate(0.5, x + 0.5 * h * x2, v + 0.5 * h * v2);
      const auto [x4, v4] = rate(1, x + h * x3, v + h * v3);
      x += h / 6 * (x1 + 2 * x2 + 2 * x3 + x4);
      v += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    }
  }
  return largest;
}

/// A quintic from 0 to 1 in `seconds`, then a second of rest.
Reference quintic(double seconds) {
  const auto ticks = static_cast<Index>(std::lround(seconds / tick)), rest = static_cast<Index>(std::lround(1 / tick));
  Reference r{
      tick, MatrixXd::Ones(ticks + rest, 1), MatrixXd::Zero(ticks + rest, 1), MatrixXd::Zero(ticks + rest, 1), {}};
  for (Index k = 0; k < ticks; ++k) {
    const double s = static_cast<double>(k) / static_cast<double>(ticks);
    r.q(k, 0) = s * s * s * (10 + s * (-15 + 6 * s));
    r.dq(k, 0) = 30 * s * s * (1 - s) * (1 - s) / seconds;
    r.ddq(k, 0) = 60 * s * (1 - s) * (1 - 2 * s) / (seconds * seconds);
  }
  return r;
}

TEST(LeastOnSimplex, IsTheLeastOfAll) {
  MatrixXd gram(3, 3);
  gram << 2, 0, 0, 0, 1, 0, 0, 0, 4;
  // inverse diagonal, normalised
  EXPECT_LT((least_on_simplex(gram) - VectorXd{{2.0 / 7, 4.0 / 7, 1.0 / 7}}).norm(), 1e-6);
  // the first would have to be negative: 1 - x, x with (3, 2, 1): x = (3 - 2) / (3 - 4 + 1) has no end within 0 .. 1
  MatrixXd edge(2, 2);
  edge << 3, 2, 2, 1.5;
  EXPECT_LT((least_on_simplex(edge) - VectorXd{{0, 1}}).norm(), 1e-6);
}

TEST(LeastOnSimplex, MeetsTheConditionsOfAnOptimum) {
  const Index n = 40;
  MatrixXd rows(12, n);
  for (Index i = 0; i < rows.rows(); ++i) {
    for (Index k = 0; k < n; ++k) rows(i, k) = std::cos(0.13 * static_cast<double>((i + 2) * k));
  }
  const MatrixXd gram = rows.transpose() * rows;
  const VectorXd x = least_on_simplex(gram), slope = gram * x;
  EXPECT_NEAR(x.sum(), 1, 1e-12);
  EXPECT_GE(x.minCoeff(), 0);
  const double level = x.dot(slope), size = gram.trace() / static_cast<double>(n);
  EXPECT_GT(slope.minCoeff(), level - 1e-6 * size);
}

TEST(Shaper, OfOneFrequencyIsZeroVibration) {
  // half a period is 50 ticks; nothing may be left, so that two impulses are all that there is
  const Shaper undamped = design_shaper({at(10)}, tick, 1e-4);
  expect_valid(undamped);
  EXPECT_NEAR(static_cast<double>(undamped.delay()), 50, 1);
  EXPECT_NEAR(undamped.impulses.head(3).sum(), 0.5, 1e-3);
  EXPECT_NEAR(undamped.impulses.tail(3).sum(), 0.5, 1e-3);

  // K = exp(-z pi / sqrt(1 - z^2)): 1 / (1 + K) and K / (1 + K), half a damped period apart
  const double z = 0.1, k = std::exp(-z * pi / std::sqrt(1 - z * z));
  const Shaper damped = design_shaper({at(10, z)}, tick, 2e-3);
  expect_valid(damped);
  EXPECT_NEAR(static_cast<double>(damped.delay()), 50 / std::sqrt(1 - z * z), 1);
  EXPECT_NEAR(damped.impulses.head(3).sum(), 1 / (1 + k), 5e-3);
  EXPECT_NEAR(damped.impulses.tail(3).sum(), k / (1 + k), 5e-3);
}

TEST(Shaper, ResidualUnderAFrequencyErrorIsTheTextbooks) {
  // ZV: |cos(pi/2 r)|, ZVD: its square, r the true frequency over the planned one
  VectorXd zv = VectorXd::Zero(51), zvd = VectorXd::Zero(101);
  zv[0] = zv[50] = 0.5;
  zvd[0] = zvd[100] = 0.25;
  zvd[50] = 0.5;
  for (const double r : {0.5, 0.8, 0.9, 1.0, 1.1, 1.2, 1.5}) {
    const double left = std::fabs(std::cos(pi / 2 * r));
    EXPECT_NEAR(residual_vibration({tick, zv}, 10 * r, 0), left, 1e-12) << r;
    EXPECT_NEAR(residual_vibration({tick, zvd}, 10 * r, 0), left * left, 1e-12) << r;
  }
  // damped: nothing is left of what it is planned for
  const double z = 0.1, f = 10 / std::sqrt(1 - z * z), k = std::exp(-z * pi / std::sqrt(1 - z * z));
  VectorXd damped = VectorXd::Zero(51);
  damped[0] = 1 / (1 + k);
  damped[50] = k / (1 + k);
  EXPECT_LT(residual_vibration({tick, damped}, f, z), 1e-12);
  EXPECT_EQ(residual_vibration({tick, VectorXd::Ones(1)}, 7, 0.1), 1);
}

TEST(Shaper, HoldsItsToleranceInEveryBandAndIsAsShortAsTheTextbooks) {
  for (const double z : {0.0, 0.04}) {
    const Shaper shaper = design_shaper({around(10, 0.2, z)}, tick, 0.05);
    expect_valid(shaper);
    for (double r = 0.8; r <= 1.2001; r += 0.01) EXPECT_LE(residual_vibration(shaper, 10 * r, z), 0.0505) << r;
    // An extra-insensitive shaper of one period holds 5 % for errors of 20 %
    EXPECT_NEAR(shaper.delay_s(), 0.1, 0.01) << z;
    EXPECT_GT(residual_vibration(shaper, 5, z), 0.3);
  }
}

TEST(Shaper, SeveralModesAtOnceAreShorterThanOneShaperForEach) {
  const std::vector<Band> bands{around(10, 0.2, 0.02), around(17, 0.2, 0.02), around(31, 0.2, 0.02)};
  const Shaper shaper = design_shaper(bands, tick, 0.05);
  expect_valid(shaper);
  double one_by_one = 0;
  for (const Band& band : bands) {
    one_by_one += design_shaper({band}, tick, 0.05).delay_s();
    for (double f = band.low_hz; f <= band.high_hz; f *= 1.01)
      EXPECT_LE(residual_vibration(shaper, f, 0.02), 0.0505) << f;
  }
  EXPECT_LT(shaper.delay_s(), 0.7 * one_by_one);
}

TEST(Shaper, OfNothingIsOneImpulseAndOfShortTicksNoFinerThanItNeeds) {
  const Shaper none = design_shaper({}, tick, 0.05);
  EXPECT_EQ(none.delay(), 0);
  EXPECT_EQ(none.impulses[0], 1);
  const Shaper coarse = design_shaper({around(10, 0.2)}, tick, 0.05);
  const Shaper fine = design_shaper({around(10, 0.2)}, tick / 10, 0.05);
  expect_valid(fine);
  EXPECT_NEAR(fine.delay_s(), coarse.delay_s(), 0.003);
}

TEST(Shaper, AMassOnASpringStandsStillAfterTheStop) {
  const double f = 10, z = 0.01;
  const Reference path = quintic(0.23);
  const double alone = swing_of_mass(path, f, z, 230);
  EXPECT_GT(alone, 0.01);  // of the way
  const Shaper exact = design_shaper({at(f, z)}, tick, 1e-3);
  const Reference still = shaped(path, exact);
  EXPECT_LT(swing_of_mass(still, f, z, 230 + exact.delay()), 0.005 * alone);
  const Shaper robust = design_shaper({around(f, 0.2, z)}, tick, 0.05);
  const Reference path_r = shaped(path, robust);
  for (const double r : {0.8, 0.9, 1.1, 1.2}) {
    const double before = swing_of_mass(path, f * r, z, 230);
    EXPECT_LT(swing_of_mass(path_r, f * r, z, 230 + robust.delay()), 0.06 * before) << r;
  }
  // without the margin a frequency that is 20 % off leaves more than it would hold
  EXPECT_GT(swing_of_mass(still, 0.8 * f, z, 230 + exact.delay()), 0.15 * swing_of_mass(path, 0.8 * f, z, 230));
}

TEST(Shaper, KeepsStartEndAndDerivatives) {
  const Reference path = quintic(0.4);
  const Shaper shaper = design_shaper({around(12, 0.2, 0.03)}, tick, 0.05);
  const Reference out = shaped(path, shaper);
  ASSERT_EQ(out.q.rows(), path.q.rows() + shaper.delay());
  EXPECT_EQ(out.q(0, 0), 0);
  EXPECT_NEAR(out.q(400 + shaper.delay(), 0), 1, 1e-12);
  EXPECT_NEAR(out.q(out.q.rows() - 1, 0), 1, 1e-12);
  EXPECT_LE(out.dq.cwiseAbs().maxCoeff(), path.dq.cwiseAbs().maxCoeff());
  EXPECT_LE(out.ddq.cwiseAbs().maxCoeff(), path.ddq.cwiseAbs().maxCoeff());
  const Index inside = out.q.rows() - 2;
  const MatrixXd dq = (out.q.bottomRows(inside) - out.q.topRows(inside)) / (2 * tick);
  EXPECT_LT((dq - out.dq.middleRows(1, inside)).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_EQ(cut_short(path, out), 0);
}

TEST(Shaper, CutsShortWhereAPathTurns) {
  Reference there_and_back = quintic(0.3);
  const Reference back = quintic(0.3);
  there_and_back.q.middleRows(300, 300).array() -= back.q.topRows(300).array();
  there_and_back.q.bottomRows(there_and_back.q.rows() - 600).setZero();
  const Shaper shaper = design_shaper({around(10, 0.2)}, tick, 0.05);
  const double cut = cut_short(there_and_back, shaped(there_and_back, shaper));
  EXPECT_GT(cut, 0.001);
  EXPECT_LT(cut, 0.2);
}

TEST(Shaper, OfAMoveEndsLaterByItsDelay) {
  IdentifiedModel robot = test::puma_with_friction();
  for (JointFit& joint : robot.joints) {
    joint.q_lower = -1.5;
    joint.q_upper = 1.5;
    joint.dq_limit = 1.2;
    joint.ddq_limit = 4;
  }
  const Shaper shaper = design_shaper({around(13, 0.2)}, 0.002, 0.05);
  for (const Move& move : make_moves(robot, 0.002, 3, 1)) {
    const Move after = shaped(move, shaper);
    EXPECT_EQ(after.start, move.start);
    EXPECT_EQ(after.stop, move.stop + shaper.delay());
    EXPECT_EQ(after.asked_stop, move.stop);
    const Index rest = after.reference.q.rows() - after.stop;
    EXPECT_LT(after.reference.dq.bottomRows(rest).cwiseAbs().maxCoeff(), 1e-12) << move.kind;
    EXPECT_GT(after.reference.dq.row(after.stop - 2).cwiseAbs().maxCoeff(), 0) << move.kind;
  }
}

}  // namespace
}  // namespace fxdyn
