#include "model/math.hpp"
#include "model/dense.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "host_tools/numbers/bounded.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "host_tools/support/random.hpp"

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

TEST(Math, ASpringBendsUntilItIsFull) {
  constexpr std::int64_t most = std::int64_t{1} << unit_bits;
  for (const std::int32_t moved : samples()) {
    for (const std::int32_t z : {0, 1, -1, 1 << 29, -(1 << 30), 1 << 30}) {
      ASSERT_EQ(raw::slip(z, moved), std::clamp<std::int64_t>(std::int64_t{z} + moved, -most, most - 1))
          << z << " " << moved;
      ASSERT_NEAR(value(raw::slip(z, moved), unit_bits), slip(value(z, unit_bits), value(moved, unit_bits)), 1e-9);
    }
    ASSERT_EQ(raw::add_saturated(moved, moved),
              std::clamp<std::int64_t>(2 * std::int64_t{moved}, INT32_MIN, INT32_MAX));
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
    ASSERT_NEAR(value(raw::exp_negative(x), 30), expected, 1.4e-9) << x;
  }
  EXPECT_EQ(raw::exp_negative(0), 1 << 30);  // a joint at rest keeps its presliding state exactly
}

TEST(Math, AreaSineKeepsTheStatedError) {
  for (const std::int32_t x : samples()) {
    ASSERT_NEAR(value(raw::asinh(x), argument_bits), std::asinh(value(x, ratio_bits)), 7e-6) << x;
  }
}

TEST(Math, ReciprocalKeepsTheStatedError) {
  for (std::int32_t x = 1 << 28; x <= 1 << 30; x += 9973) {
    ASSERT_NEAR(value(raw::reciprocal(x), ratio_bits), 1 / value(x, 30), 6e-8) << x;
  }
  EXPECT_EQ(raw::reciprocal(1 << 30), 1 << ratio_bits);
  double bias = 0, count = 0;
  for (std::int32_t x = 1 << 28; x <= 1 << 30; x += 9973, ++count)
    bias += raw::reciprocal(x) - std::ldexp(1 / value(x, 30), ratio_bits);
  EXPECT_NEAR(bias / count, 0, 0.1) << "of the last digit: rounded, not cut off";
  for (const std::int32_t x : samples()) static_cast<void>(raw::reciprocal(x));  // total
  EXPECT_EQ(reciprocal_of(0.1), 4);
  EXPECT_EQ(reciprocal_of(3.0), 1);
}

TEST(Math, HalfOfASumIsExact) {
  const Fixed<28> a{3}, b{4};
  EXPECT_EQ(half_of(a + b).raw, 7);  // of 29 bits
  static_assert(std::is_same_v<decltype(half_of(a + b)), Wide<29>>);
  EXPECT_EQ(signed_as(Fixed<30>{7}, Wide<28>{std::int64_t{-1} << 40}).raw, -7);
  EXPECT_EQ(signed_as(Fixed<30>{7}, Wide<28>{0}).raw, 7);
  EXPECT_EQ(signed_as(7.0, -1e-9), -7);
  EXPECT_EQ(signed_as(7.0, 0.0), 7) << "as in fixed point";
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

TEST(Math, TanhLinesStayWithinTheirStatedError) {
  double worst = 0;
  for (std::int32_t x = -(1 << 19); x < 1 << 19; ++x) {
    const double value = static_cast<double>(raw::upper_half(raw::tanh_line(x))) / raw::activation_one;
    worst = std::max(worst, std::fabs(value - std::tanh(std::ldexp(x, -raw::tanh_argument_bits))));
  }
  EXPECT_LT(worst, raw::tanh_line_error);
  EXPECT_GT(worst, 0.5 * raw::tanh_line_error);  // and the statement is not idle
}

TEST(Dense, IsTheSumThatItsCommentSays) {
  Random random(12);
  const auto small = [&] { return static_cast<std::int32_t>(random.uniform(-32768, 32768)); };
  for (int round = 0; round < 200; ++round) {
    std::array<std::int32_t, 4 * raw::row_words<6>> rows;
    std::array<std::int32_t, 3> u;
    std::array<std::array<std::int64_t, 7>, 4> w;
    std::array<std::int64_t, 6> in;
    for (std::size_t i = 0; i < 6; ++i) in[i] = small();
    for (std::size_t i = 0; i < 3; ++i)
      u[i] = raw::pack(static_cast<std::int32_t>(in[2 * i]), static_cast<std::int32_t>(in[2 * i + 1]));
    for (std::size_t k = 0; k < 4; ++k) {
      w[k][6] = rows[4 * k] = small() * 10000;
      for (std::size_t i = 0; i < 6; ++i) w[k][i] = small();
      for (std::size_t i = 0; i < 3; ++i)
        rows[4 * k + 1 + i] =
            raw::pack(static_cast<std::int32_t>(w[k][2 * i]), static_cast<std::int32_t>(w[k][2 * i + 1]));
    }
    std::array<std::int32_t, 4> out;
    raw::dense<6, 20>(4, 9, rows.data(), u.data(), out.data());
    for (std::size_t k = 0; k < 4; ++k) {
      std::int64_t sum = w[k][6];
      for (std::size_t i = 0; i < 6; ++i) sum += w[k][i] * in[i];
      EXPECT_EQ(out[k], std::clamp<std::int64_t>(sum >> 9, -(1 << 19), (1 << 19) - 1));
    }
  }
}

template <int shift>
void expect_rounded(std::int64_t x) {
  // only what fits is promised
  const std::int64_t whole = raw::shift_right(x, shift);
  if (whole != static_cast<std::int32_t>(whole)) return;
  EXPECT_EQ(raw::proven_narrow<shift>(x), whole) << x << " >> " << shift;
}

TEST(Fixed, ProvenNarrowRoundsHalfUpAtEveryShift) {
  Random random(13);
  for (int round = 0; round < 2000; ++round) {
    const auto magnitude = static_cast<int>(random.uniform(0, 63));
    auto x = static_cast<std::int64_t>(std::ldexp(random.uniform(-1, 1), magnitude));
    if (round % 4 == 0) x = (x | 0xffff) ^ 0x7fff;  // halves
    [&]<int... shift>(std::integer_sequence<int, shift...>) { (expect_rounded<shift>(x), ...); }
    (std::make_integer_sequence<int, 64>{});
  }
  EXPECT_EQ(raw::shift_right(INT64_MAX, 1), INT64_MAX / 2 + 1);
  EXPECT_EQ(raw::shift_right(-1, 1), 0);  // a tie goes up
}

// |a + b| <= |a| + |b|, |a x b| <= |a| |b|, |s a| <= |s| |a|; of lengths that are known better than the components'.
TEST(Vectors, ABoundOnTheLengthIsKept) {
  using Number = BoundedNumbers::Of<Quantity::length>;
  const auto vector = [](double most, double length, double error) {
    const Number component{{-most, most, error}};
    return Vector3<Number>{component, component, component, {length, error}};
  };
  const auto a = vector(2, 2, 0.25), b = vector(5, 5, 0.5);
  const double error = 2 * 0.5 + 5 * 0.25 + 0.25 * 0.5;
  EXPECT_EQ((a + b).length.length, 7);
  EXPECT_EQ((a + b).length.error, 0.75);
  EXPECT_EQ(cross(a, b).length.length, 10);
  EXPECT_EQ(cross(a, b).length.error, error);
  EXPECT_EQ(scale(b.x, a).length.length, 10);
  EXPECT_EQ(scale(b.x, a).length.error, error);
  EXPECT_EQ((Matrix3<Number>{b, b, b, {5, 0.5}} * a).length.length, 10);
}

}  // namespace
}  // namespace fxdyn
