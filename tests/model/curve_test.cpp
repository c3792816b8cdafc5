// The cubic spline of free curves: its sum against all of its bumps, bit for bit; what every such spline does; bounds.

#include "model/effects/curve.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "host_tools/numbers/bounded.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "host_tools/support/random.hpp"
#include "model/effects/friction_over_position.hpp"
#include "model/effects/position_curve.hpp"

namespace fxdyn {
namespace {

struct TestFormats {
  static constexpr int position = 28;
  static constexpr int velocity = 26;
  static constexpr int acceleration = 22;
  static constexpr int linear_acceleration = 24;
  static constexpr int length = 28;
  static constexpr int force = 20;
  static constexpr int torque = 22;
  static constexpr int inverse_velocity = 18;
  static constexpr int inverse_path = 22;
  static constexpr int weight = 12;
  static constexpr int velocity_squared = 22;
  static constexpr int velocity_cubed = 19;
  static constexpr int inverse_position = 22;
  static constexpr int inverse_torque = 20;
  static constexpr int force_sum = 44;
  static constexpr int torque_sum = 52;
  static constexpr int deflection_sum = 52;
};
using Fixed32 = FixedNumbers<TestFormats>;
constexpr int height_bits = TestFormats::torque_sum - unit_bits;

Formats formats() {
  Formats out;
  for (std::size_t i = 0; i < quantity_count; ++i) out.quantity[i] = Fixed32::bits(static_cast<Quantity>(i));
  out.force_sum = TestFormats::force_sum;
  out.torque_sum = TestFormats::torque_sum;
  out.deflection_sum = TestFormats::deflection_sum;
  return out;
}

/// A curve's parameters, such that the formats hold them exactly.
struct Parameters {
  std::array<double, 2 + curve_heights> real{};
  std::array<std::int32_t, 2 + curve_heights> fixed{};
  std::array<Bound, 2 + curve_heights> bound{};

  Parameters(double from, double span, const std::array<double, curve_heights>& heights) {
    const auto set = [&](std::size_t i, double value, int bits) {
      fixed[i] = to_raw(value, bits);
      real[i] = from_raw(fixed[i], bits);
      bound[i] = {real[i], real[i], 0};
    };
    set(0, from, TestFormats::position);
    set(1, stored_curve_shape(1, span), TestFormats::inverse_position);
    for (std::size_t i = 0; i < curve_heights; ++i) set(2 + i, heights[i], height_bits);
  }
};

std::array<double, curve_heights> random_heights(Random& random, double largest) {
  std::array<double, curve_heights> out{};
  for (double& height : out) height = random.uniform(-largest, largest);
  return out;
}

template <class E>
double real(const Parameters& p, double q, double sign = 1) {
  JointInput<Real> u;
  u.q = q;
  u.sign = sign;
  NoState state;
  Saturations none;
  return contribution<E, Real>(u, Words<Real>{p.real.data()}, state, none);
}

template <class E>
double fixed(const Parameters& p, std::int32_t q, std::int32_t sign = 1 << unit_bits) {
  JointInput<Fixed32> u;
  u.q = {q};
  u.sign = {sign};
  NoState state;
  Saturations none;
  const auto sum = contribution<E, Fixed32>(u, Words<Fixed32>{p.fixed.data()}, state, none);
  auto all = Fixed32::no_torque();
  const Words<Fixed32> heights{p.fixed.data() + 2};
  E::template basis<Fixed32>(u, Words<Fixed32>{p.fixed.data()}, state, none, [&](auto, std::size_t i, auto phi) {
    all = all + heights.template coefficient<Quantity::unit>(i) * phi;
  });
  EXPECT_EQ(sum.raw, all.raw) << E::name << " at " << q;
  return std::ldexp(static_cast<double>(sum.raw), -TestFormats::torque_sum);
}

/// contribution() within an interval of q.
template <class E>
Bound bounded(const Parameters& p, Bound q, Bound sign = {1, 1, 0}) {
  JointInput<BoundedNumbers> u;
  u.q = {q};
  u.sign = {sign};
  NoState state;
  Saturations none;
  return contribution<E, BoundedNumbers>(u, Words<BoundedNumbers>{p.bound.data()}, state, none).value;
}

TEST(Curve, ReproducesALineAndIsConstantBeyondItsKnots) {
  std::array<double, curve_heights> line{}, same{};
  for (std::size_t i = 0; i < curve_heights; ++i) line[i] = static_cast<double>(i) - 1;
  same.fill(2);
  const Parameters p(-0.5, 2.25, line), flat(-0.5, 2.25, same);  // knots every 0.25
  for (int k = -200; k <= 300; ++k) {
    const double q = 0.01 * k;
    const double knots = std::min(std::max((q + 0.5) / 0.25, 0.0), 9.0);
    EXPECT_NEAR(real<PositionCurve>(p, q), 1.5 * knots, 1e-12) << q;
    EXPECT_NEAR(real<PositionCurve>(flat, q), 3, 1e-14) << q;
  }
}

TEST(Curve, IsTwiceContinuouslyDifferentiable) {
  Random random(3);
  const Parameters p(0, 9, random_heights(random, 1));
  const double h = 1e-4;
  const auto second = [&](double q) {
    return (real<PositionCurve>(p, q + h) - 2 * real<PositionCurve>(p, q) + real<PositionCurve>(p, q - h)) / (h * h);
  };
  for (int knot = 1; knot < 9; ++knot) EXPECT_NEAR(second(knot - 1.1 * h), second(knot + 1.1 * h), 0.01) << knot;
}

// What BoundedNumbers take for granted (host_tools/numbers/bounded.hpp).
TEST(Curve, WeightsInFixedPointAreWithinThreeUnitsAndAddUpToThreeHalves) {
  const auto bump = [](double d) {
    const double far = std::fabs(d);
    return far <= 1 ? 1 - 1.5 * far * far + 0.75 * far * far * far : std::pow(std::max(2 - far, 0.0), 3) / 4;
  };
  const std::int32_t last = static_cast<std::int32_t>(curve_pieces) << argument_bits;
  for (std::int32_t raw = 0; raw <= last; raw += 99'991) {
    const Curve<Fixed32> curve = Curve<Fixed32>::at({raw});
    const double x = std::ldexp(static_cast<double>(raw), -argument_bits);
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < curve.weights.size(); ++i) {
      const double exact = bump(x + 1 - static_cast<double>(curve.first + i));
      EXPECT_NEAR(std::ldexp(curve.weights[i].raw, -unit_bits), exact, std::ldexp(3, -unit_bits)) << x << ' ' << i;
      sum += curve.weights[i].raw;
    }
    EXPECT_EQ(sum, std::int64_t{3} << (unit_bits - 1)) << x;
  }
}

TEST(Curve, SumsTheBumpsThatAreNotZeroBitForBitAndBoundsHold) {
  Random random(5);
  const Formats all = formats();
  Ranges ranges;
  const BoundScope scope(ranges, &all);
  double tightest = 1e9;
  for (int round = 0; round < 200; ++round) {
    const double span = random.uniform(0.05, 4);
    const Parameters p(random.uniform(-2, 1), span, random_heights(random, 30));
    const double a = random.uniform(-3, 3), b = a + random.uniform(0, round % 2 == 0 ? 0.1 : 3);
    const Bound of_position = bounded<PositionCurve>(p, {a, b, 0});
    const Bound of_friction = bounded<FrictionOverPosition>(p, {a, b, 0}, {-1, 1, 0});
    double largest = 0;
    for (int k = 0; k < 100; ++k) {
      const std::int32_t raw = to_raw(random.uniform(a, b), TestFormats::position);
      const double q = std::min(std::max(from_raw(raw, TestFormats::position), a), b);
      const double exact = real<PositionCurve>(p, q), error = std::fabs(fixed<PositionCurve>(p, raw) - exact);
      EXPECT_GE(exact, of_position.low - 1e-12);
      EXPECT_LE(exact, of_position.high + 1e-12);
      EXPECT_LE(error, of_position.error);
      largest = std::max(largest, error);
      const std::int32_t sign = to_raw(random.uniform(-1, 1), unit_bits);
      const double braked = real<FrictionOverPosition>(p, q, from_raw(sign, unit_bits));
      EXPECT_LE(std::fabs(braked), of_friction.magnitude() + 1e-12);
      EXPECT_LE(std::fabs(fixed<FrictionOverPosition>(p, raw, sign) - braked), of_friction.error);
    }
    if (largest > 0) tightest = std::min(tightest, of_position.error / largest);
  }
  EXPECT_LT(tightest, 20) << "a bound that is far from every error proves little";
}

}  // namespace
}  // namespace fxdyn
