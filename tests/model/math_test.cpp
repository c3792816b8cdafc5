#include "model/math.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "host_tools/numbers/run_time_fixed.hpp"
#include "host_tools/random.hpp"

namespace fxdyn {
namespace {

/// Random int32 and the corners, where sign changes and table ends sit.
std::vector<std::int32_t> samples() {
  std::vector<std::int32_t> out{INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX - 1, INT32_MAX};
  for (int bit = 0; bit < 31; ++bit) {
    for (const int offset : {-1, 0, 1}) {
      out.push_back((1 << bit) + offset);
      out.push_back(-(1 << bit) + offset);
    }
  }
  Random random(3);
  for (int i = 0; i < 1'000'000; ++i) out.push_back(static_cast<std::int32_t>(random.next()));
  for (int i = 0; i < 100'000; ++i) out.push_back(static_cast<std::int32_t>(random.next()) >> (i % 31));
  return out;
}

double value(std::int32_t raw_value, int bits) { return from_raw(raw_value, bits); }

TEST(Math, SineAndCosineKeepTheStatedError) {
  for (const int bits : {24, 27, 29}) {
    const double bound = 4e-9 + std::ldexp(1.0, -bits - 1);
    for (const std::int32_t q : samples()) {
      const auto result = raw::sin_cos(q, bits);
      ASSERT_NEAR(value(result.sine, 30), std::sin(value(q, bits)), bound) << q;
      ASSERT_NEAR(value(result.cosine, 30), std::cos(value(q, bits)), bound) << q;
    }
  }
}

TEST(Math, TurnsWrapExactly) {
  // 2^-40 turns a step, over +-2^23 turns: whole turns must drop out without loss.
  Random random(8);
  for (int i = 0; i < 100'000; ++i) {
    const auto turns = static_cast<std::int64_t>(random.next());
    const auto result = sin_cos_turns(Wide<40>{turns});
    const double part = std::ldexp(static_cast<double>(turns & ((std::int64_t{1} << 40) - 1)), -40);
    ASSERT_NEAR(value(result.sine.raw, 30), std::sin(2 * raw::pi * part), 3e-9) << turns;
    ASSERT_NEAR(value(result.cosine.raw, 30), std::cos(2 * raw::pi * part), 3e-9) << turns;
  }
}

TEST(Math, ClippingIsWhatALimiterAdds) {
  for (const std::int32_t x : samples()) {
    for (const std::int32_t limit : {0, 1, 1 << 20, INT32_MAX}) {
      const std::int64_t expected = std::clamp<std::int64_t>(x, -std::int64_t{limit}, limit) - x;
      ASSERT_EQ(raw::clipping(x, limit), std::min<std::int64_t>(expected, INT32_MAX)) << x;
    }
  }
}

TEST(Math, MagnitudeSaturatesAtTheEnd) {
  for (const std::int32_t x : samples())
    ASSERT_EQ(raw::magnitude(x), std::min<std::int64_t>(std::abs(std::int64_t{x}), INT32_MAX)) << x;
}

TEST(Math, CountsSplitIntoWholeAndRest) {
  for (const std::int32_t x : samples()) {
    const auto fixed = raw::split_count(x);
    const auto real = split_count(value(x, count_bits));
    ASSERT_EQ(fixed.whole, real.whole) << x;
    ASSERT_LT(fixed.rest, 1 << 30) << x;
    ASSERT_EQ(value(fixed.rest, 30), x < 32767 << 16 ? real.rest : value(fixed.rest, 30)) << x;
  }
}

TEST(Math, TanhKeepsTheStatedErrorAndIsOdd) {
  for (const std::int32_t x : samples()) {
    ASSERT_NEAR(value(raw::tanh(x), 30), std::tanh(value(x, argument_bits)), 1.5e-6) << x;
    if (x == INT32_MIN) continue;
    ASSERT_EQ(raw::tanh(x), -raw::tanh(-x)) << x;
  }
}

TEST(Math, ExponentialKeepsTheStatedError) {
  for (const std::int32_t x : samples()) {
    const double expected = x < 0 ? 1.0 : std::exp(-value(x, argument_bits));
    ASSERT_NEAR(value(raw::exp_negative(x), 30), expected, 7e-9) << x;
  }
  EXPECT_EQ(raw::exp_negative(0), 1 << 30);  // a joint at rest keeps its presliding state exactly
}

TEST(Math, AreaSineKeepsTheStatedError) {
  for (const std::int32_t x : samples()) {
    ASSERT_NEAR(value(raw::asinh(x), argument_bits), std::asinh(value(x, ratio_bits)), 7e-6) << x;
  }
}

TEST(Math, MagnitudeAndSignAreTotal) {
  EXPECT_EQ(raw::magnitude(INT32_MIN), INT32_MAX);
  EXPECT_EQ(raw::magnitude(-5), 5);
  EXPECT_EQ(raw::sign(INT32_MIN), -(1 << 30));
  EXPECT_EQ(raw::sign(0), 0);
  EXPECT_EQ(raw::sign(7), 1 << 30);
}

TEST(Fixed, NarrowingRoundsHalfUpAndSaturates) {
  Saturations saturations;
  using Numbers = Fixed<4>;
  const auto narrow = [&](std::int64_t raw_value) { return raw::narrow(raw_value, 4, saturations.count); };
  std::uint32_t outside = 0;
  EXPECT_EQ(raw::narrow(24, 4, outside), 2);    // 1.5 -> 2
  EXPECT_EQ(raw::narrow(-24, 4, outside), -1);  // -1.5 -> -1: half goes up
  EXPECT_EQ(raw::narrow(-25, 4, outside), -2);
  EXPECT_EQ(outside, 0U);
  EXPECT_EQ(narrow(INT64_MAX), INT32_MAX);
  EXPECT_EQ(saturations.count, 1U);
  EXPECT_EQ(narrow(INT64_MIN), INT32_MIN);
  EXPECT_EQ((Numbers{3} * Fixed<5>{-7}).raw, -21);
}

TEST(Fixed, NarrowingMatchesArithmeticOnRandomValues) {
  Random random(5);
  for (int i = 0; i < 200'000; ++i) {
    const auto x = static_cast<std::int64_t>(random.next()) >> (i % 40);
    const int shift = i % 31;
    std::uint32_t outside = 0;
    const std::int32_t result = raw::narrow(x, shift, outside);
    const auto exact = static_cast<long double>(x) / static_cast<long double>(std::int64_t{1} << shift);
    const long double rounded = std::floor(exact + 0.5L);
    const long double clamped =
        std::fmin(std::fmax(rounded, static_cast<long double>(INT32_MIN)), static_cast<long double>(INT32_MAX));
    ASSERT_EQ(static_cast<long double>(result), clamped) << x << " >> " << shift;
    ASSERT_EQ(outside != 0, rounded != clamped);
  }
}

}  // namespace
}  // namespace fxdyn
