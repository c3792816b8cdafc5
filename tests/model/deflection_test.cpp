// What is differentiated from tick to tick, where a tick had no setpoints.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "model/effects/elasticity.hpp"
#include "model/joint_model.hpp"

namespace fxdyn {
namespace {

constexpr double tick = 0.002, frequency = 8.0, amplitude = 1e-3;  // [s], [rad/s], [rad]
double deflection(int k) { return amplitude * std::sin(frequency * tick * k); }

JointLimits<Real> wide() { return {-10, 10, -1e3, 1e3, -1e6, 1e6, -1e6, 1e6}; }

/// Largest error of the link's acceleration against the true one, where ticks are missing now and then.
double largest_error(bool skips, int missing_in_a_row) {
  Deflection<Real> deflection_state;
  Saturations saturations;
  double largest = 0;
  for (int k = 0, until_gap = 20; k < 2000; ++k) {
    if (--until_gap == 0) {
      if (skips) deflection_state.skip(static_cast<std::uint32_t>(missing_in_a_row), 1 / tick, saturations);
      k += missing_in_a_row;
      until_gap = 20;
    }
    const auto link = deflection_state.step({}, deflection(k), 1 / tick, wide(), saturations);
    if (k < 3) continue;
    // the second difference is that of the tick before
    const double truth = frequency * frequency * deflection(k - 1);
    largest = std::max(largest, std::abs(link.ddq - truth));
  }
  return largest;
}

// A third difference, times how often it counts, is what extrapolation by constant acceleration leaves.
TEST(Deflection, ATickWithoutSetpointsMakesNoSpike) {
  const double jerk_a_tick = amplitude * std::pow(frequency, 3) * tick;
  EXPECT_LT(largest_error(true, 1), 3 * jerk_a_tick);
  EXPECT_LT(largest_error(true, 2), 9 * jerk_a_tick);
  EXPECT_LT(largest_error(true, 3), 18 * jerk_a_tick);
  // What it was: one tick's change too many, differentiated.
  EXPECT_GT(largest_error(false, 1), amplitude * frequency / tick / 2);
}

TEST(Deflection, ALongGapBeginsAnew) {
  Deflection<Real> state;
  Saturations saturations;
  for (int k = 0; k < 20; ++k) state.step({}, deflection(k), 1 / tick, wide(), saturations);
  state.skip(Deflection<Real>::most_skipped + 1, 1 / tick, saturations);
  EXPECT_EQ(state.ticks, 0U);
  const auto link = state.step({}, deflection(100), 1 / tick, wide(), saturations);
  EXPECT_EQ(link.dq, 0);
  EXPECT_EQ(link.ddq, 0);
  EXPECT_EQ(link.q, -deflection(100));
}

TEST(Deflection, AtTheStartThereIsNothingToGoOnWith) {
  Deflection<Real> state;
  Saturations saturations;
  state.skip(1, 1 / tick, saturations);
  state.step({}, 1e-3, 1 / tick, wide(), saturations);
  state.skip(1, 1 / tick, saturations);
  EXPECT_EQ(state.step({}, 2e-3, 1 / tick, wide(), saturations).dq, 0);
}

// Decision 6: over ticks that had no setpoints an elastic load goes on as it went.
TEST(Deflection, AnElasticLoadGoesOnAsItWent) {
  for (const std::uint32_t times : {0U, 1U, 2U, 3U}) {
    Elasticity::State<Real> state{.load = 2, .change = -0.75, .ticks = 1};
    Saturations saturations;
    Elasticity::skip<Real>(state, times, saturations);
    EXPECT_EQ(state.load, 2 - 0.75 * times) << times;
  }
}

}  // namespace
}  // namespace fxdyn
