#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "model/fixed.hpp"
#include "model/numbers.hpp"

// sin, cos, tanh, exp(-x), asinh. In fixed point: tables made by the compiler and a short series around the nearest
// node, constant time, no division. Each function states its largest error.

namespace fxdyn {

template <class U>
struct SineCosine {
  U sine, cosine;
};

/// A number in parts.
template <class U>
struct WholeAndRest {
  std::uint32_t whole;
  U rest;  ///< [0, 1)
};

// ---- double
// ----------------------------------------------------------------------------------------------------------
inline SineCosine<double> sin_cos(double q) { return {std::sin(q), std::cos(q)}; }
/// Sine and cosine of an angle in turns.
inline SineCosine<double> sin_cos_turns(double turns) { return sin_cos(6.28318530717958647693 * turns); }
inline double tanh_of(double x) { return std::tanh(x); }
/// exp(-x) for x >= 0
inline double exp_negative(double x) { return std::exp(-x); }
inline double asinh_of(double x) { return std::asinh(x); }
/// size where x >= 0, else -size.
constexpr double signed_as(double size, double x) { return x < 0 ? -size : size; }
constexpr double half_of(double x) { return x / 2; }
/// 1 / x, 0.25 <= x <= 1
constexpr double reciprocal_of(double x) { return 1 / (x < 0.25 ? 0.25 : x > 1 ? 1 : x); }
constexpr double magnitude(double x) { return x < 0 ? -x : x; }
/// sign(x): -1, 0 or 1
constexpr double sign_of(double x) { return static_cast<double>((x > 0) - (x < 0)); }
/// A spring in parts of the most that it can bend, |z| <= 1, after its ends moved against each other: where it is full,
/// the contact behind it slips.
constexpr double slip(double z, double moved) {
  const double bent = z + moved;
  return bent > 1 ? 1 : (bent < -1 ? -1 : bent);
}
/// 2 x; saturates, so only for what has no effect beyond a size of 2.
constexpr double doubled(double x) { return 2 * x; }
/// What a limiter to [-limit, limit] adds to x.
constexpr double clipping(double x, double limit) { return x > limit ? limit - x : (x < -limit ? -limit - x : 0.0); }
/// Negative and absurd counts are limited as the fixed-point format limits them.
constexpr WholeAndRest<double> split_count(double x) {
  const double limited = x > 0 ? (x < 32767 ? x : 32767) : 0;
  const auto whole = static_cast<std::uint32_t>(limited);
  return {whole, limited - whole};
}
/// x limited to 0 .. last + 1, of which `rest` is 1 at the end.
constexpr WholeAndRest<double> split_argument(double x, std::uint32_t last) {
  const double end = last + 1.0, limited = x > 0 ? (x < end ? x : end) : 0;
  const auto piece = static_cast<std::uint32_t>(limited);
  const std::uint32_t whole = piece < last ? piece : last;
  return {whole, limited - whole};
}

// ---- raw integers: shared by all fixed formats
// -------------------------------------------------------------------------
namespace raw {

/// Series for the compiler's use only (the standard library's functions are not constexpr).
namespace series {
constexpr double exponential(double x) {  // |x| <= 1
  double term = 1, sum = 1;
  for (int k = 1; k < 24; ++k) sum += term *= x / k;
  return sum;
}
constexpr double sine(double x) {  // |x| <= 2 pi
  double term = x, sum = x;
  for (int k = 1; k < 24; ++k) sum += term *= -x * x / ((2 * k) * (2 * k + 1));
  return sum;
}
constexpr double logarithm(double x) {  // x >= 1
  double result = 0;
  while (x > 1.0905077326652577) {  // 2^(1/8)
    x /= 1.0905077326652577;
    result += 0.08664339756999316;  // ln 2 / 8
  }
  const double u = (x - 1) / (x + 1);
  double power = u;
  for (int k = 1; k < 40; k += 2, power *= u * u) result += 2 * power / k;
  return result;
}
constexpr double square_root(double x) {
  double root = x > 1 ? x : 1;
  for (int k = 0; k < 60; ++k) root = (root + x / root) / 2;
  return root;
}
constexpr double inverse_hyperbolic_sine(double x) { return logarithm(x + square_root(x * x + 1)); }
/// tanh(i / 128), 0 <= i <= 1024, all at once: exp(-2x) is a product of two powers, of which there are few. Compilers
/// limit the steps that they take for a constant (clang: 2^20).
inline constexpr auto hyperbolic_tangents = [] {
  std::array<double, 33> coarse{};  // exp(-i / 2)
  std::array<double, 32> fine{};    // exp(-i / 64)
  for (std::size_t i = 0; i < fine.size(); ++i) fine[i] = exponential(-static_cast<double>(i) / 64);
  coarse[0] = 1;
  for (std::size_t i = 1; i < coarse.size(); ++i) coarse[i] = coarse[i - 1] * exponential(-0.5);
  std::array<double, 1025> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double e = coarse[i / 32] * fine[i % 32];
    table[i] = (1 - e) / (1 + e);
  }
  return table;
}();
constexpr std::int32_t to_raw(double x, int bits) {
  const double scaled = x * static_cast<double>(std::int64_t{1} << bits);
  return static_cast<std::int32_t>(scaled < 0 ? scaled - 0.5 : scaled + 0.5);
}
}  // namespace series

inline constexpr double pi = 3.14159265358979323846;

/// sin(2 pi i / 256), one and a quarter turns, 30 bits.
inline constexpr auto sine_table = [] {
  std::array<std::int32_t, 321> table{};
  for (std::size_t i = 0; i < 321; ++i)
    table[i] = series::to_raw(series::sine(2 * pi * static_cast<double>(i % 256) / 256), 30);
  return table;
}();

/// Sine and cosine (30 bits) of phase * 2^-32 turns, |error| < 2e-9. From the nearest node a: sin(a + h) = sin a cos h
/// + cos a sin h with |h| <= pi / 256, cos h = 1 - h^2/2, sin h = h - h^3/6.
constexpr SineCosine<std::int32_t> sin_cos_of_phase(std::uint32_t phase) {
  constexpr std::int32_t two_pi = 1686629713;  // 2^28
  constexpr std::int32_t third = 1431655765;   // 2^32
  const std::uint32_t nearest = wrapping_add(phase, 1U << 23);
  const std::uint32_t node = nearest >> 24;
  const std::int32_t h =
      multiply_high(static_cast<std::int32_t>(wrapping_shift_left(nearest, 8) ^ 0x80000000U), two_pi);  // 36 bits
  const std::int32_t half_square = multiply_high(h, h);                                                 // 41 bits
  const std::int32_t sine_h = h - (multiply_high(multiply_high(h, half_square), third) >> 9);           // 36 bits
  const std::int32_t versine = half_square >> 5;                                                        // 36 bits
  const std::int64_t s = sine_table[node];
  const std::int64_t c = sine_table[node + 64];
  return {static_cast<std::int32_t>(s) + proven_narrow<36>(c * sine_h - s * versine),
          static_cast<std::int32_t>(c) - proven_narrow<36>(s * sine_h + c * versine)};
}

/// Sine and cosine (30 bits) of q [rad] with `bits` fractional bits, |error| < 4e-9 + 1.1e-10 |q|.
template <int bits>
constexpr SineCosine<std::int32_t> sin_cos(std::int32_t q) {
  constexpr std::int64_t inverse_two_pi = 1367130551;                                                // 2^33 / (2 pi)
  return sin_cos_of_phase(static_cast<std::uint32_t>(proven_narrow<bits + 1>(q * inverse_two_pi)));  // wraps
}
inline SineCosine<std::int32_t> sin_cos(std::int32_t q, int bits) {
  return sin_cos_of_phase(static_cast<std::uint32_t>(shift_right(q * std::int64_t{1367130551}, bits + 1)));
}

/// Phase for sin_cos_of_phase() of an angle in turns with `bits` fractional bits: whole turns drop out by themselves.
constexpr std::uint32_t phase_of_turns(std::int64_t turns, int bits) {
  return static_cast<std::uint32_t>(shift_right(turns, bits - 32));
}

/// tanh(i / 32), 0 <= x <= 8, 30 bits.
inline constexpr auto tanh_table = [] {
  std::array<std::int32_t, 257> table{};
  for (std::size_t i = 0; i < 257; ++i) table[i] = series::to_raw(series::hyperbolic_tangents[4 * i], 30);
  return table;
}();

/// tanh (30 bits) of x with `argument_bits`, |error| < 1.5e-6; constant beyond |x| = 8. From the nearest node t =
/// tanh(a): tanh(a + d) = t + d (1 - t^2) (1 - d t) + O(d^3 / 3), |d| <= 1/64.
constexpr std::int32_t tanh(std::int32_t x) {
  const std::int32_t sign = x >> 31;
  std::uint32_t size = wrapping_subtract(static_cast<std::uint32_t>(x ^ sign), static_cast<std::uint32_t>(sign));
  constexpr std::uint32_t end = 8U << argument_bits;
  size = size < end ? size : end;
  const std::uint32_t node = (size + (1U << (argument_bits - 6))) >> (argument_bits - 5);
  const auto d = static_cast<std::int32_t>(wrapping_subtract(size, node << (argument_bits - 5))) << 5;  // 32 bits
  const std::int32_t t = tanh_table[node];
  const std::int32_t slope = (1 << 28) - multiply_high(t, t);      // 28 bits
  const std::int32_t bend = (1 << 30) - multiply_high(d, t);       // 30 bits
  const std::int32_t step = multiply_high(slope << 2, bend) << 2;  // 30 bits
  const std::int32_t value = t + multiply_high(d, step);
  return (value ^ sign) - sign;
}

/// 2^(-i/64), 30 bits.
inline constexpr auto power_table = [] {
  std::array<std::int32_t, 65> table{};
  for (std::size_t i = 0; i < 65; ++i)
    table[i] = series::to_raw(series::exponential(-0.69314718055994531 * static_cast<double>(i) / 64), 30);
  return table;
}();

/// exp(-x) (30 bits) of x >= 0 with `argument_bits` (negative x count as 0), |error| < 1.4e-9. x / ln 2 = k + i/64 + r:
/// 2^-k by shifting, 2^(-i/64) from the table, 2^-r by its series to the third power.
constexpr std::int32_t exp_negative(std::int32_t x) {
  x &= ~(x >> 31);
  const std::int64_t product = x * std::int64_t{1549082005};  // 1 / ln 2: 30 bits, product 57
  const auto k = static_cast<std::uint32_t>(product >> 57);
  const auto fraction = static_cast<std::uint32_t>(product >> 25);  // 32 bits
  const std::uint32_t node = fraction >> 26;
  const auto r = static_cast<std::int32_t>((fraction & 0x03ffffffU) << 5);  // 37 bits, r < 2^-6
  const std::int32_t u = multiply_high(r, 1488522236) << 1;                 // r ln 2, 37 bits
  const std::int32_t square = multiply_high(u, u);                          // 42 bits
  const std::int32_t cube = multiply_high(square, u);                       // 47 bits
  // 1 - 2^-r = u - u^2 / 2 + u^3 / 6
  const std::int32_t loss = u - (square >> 6) + (multiply_high(cube, 715827883) >> 10);  // 37 bits
  const std::int32_t value = power_table[node];
  const std::int32_t full = value - proven_narrow<37>(std::int64_t{value} * loss);
  return static_cast<std::int32_t>(((static_cast<std::uint32_t>(full) << 1 >> k) + 1) >> 1);
}

/// 256 / i, 0.25 <= i / 256 <= 1, 28 bits.
inline constexpr int reciprocal_bits = 28;
inline constexpr auto reciprocal_table = [] {
  std::array<std::int32_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i)
    table[i] = series::to_raw(256 / static_cast<double>((i < 192 ? i : 192) + 64), reciprocal_bits);
  return table;
}();

/// 1 / x (ratio_bits) of x in [0.25, 1] with 30 bits, |error| < 6e-8; beyond, anything. With the nearest node's r:
/// e = 1 - x r, 1 / x = r (1 + e + e^2 + e^3) + O(e^4 / x), |e| <= 1/128.
constexpr std::int32_t reciprocal(std::int32_t x) {
  const std::uint32_t node = wrapping_subtract(wrapping_add(static_cast<std::uint32_t>(x), 1U << 21), 1U << 28) >> 22;
  const std::int32_t r = reciprocal_table[node & 255U];
  // 36 bits, of which the one has none among the lowest 32
  const auto e = static_cast<std::int32_t>(wrapping_negate(static_cast<std::uint32_t>((std::int64_t{x} * r) >> 22)));
  const std::int32_t square = multiply_high(e, e);  // 40 bits
  // Unsigned: beyond the range the sums wrap.
  const std::uint32_t series =
      wrapping_add(static_cast<std::uint32_t>(square >> 4), static_cast<std::uint32_t>(multiply_high(square, e) >> 8));
  const auto gain = static_cast<std::int32_t>(wrapping_add(static_cast<std::uint32_t>(e), series));  // 36 bits
  const std::int32_t more = proven_narrow<36>(std::int64_t{r} * gain);                               // 28 bits
  const std::uint32_t value = wrapping_add(static_cast<std::uint32_t>(r), static_cast<std::uint32_t>(more));
  return static_cast<std::int32_t>(wrapping_add(value, 1U << 3)) >> (reciprocal_bits - ratio_bits);
}

struct Parabola {
  std::int32_t c0, c1, c2;  ///< 27 bits; over a segment parameter in [0, 1)
};

/// asinh over 1 + |x| in [2^e, 2^(e+1)), e = 0 .. 7, sixteen segments an octave, interpolated at three points of each.
inline constexpr auto asinh_table = [] {
  std::array<Parabola, 8 * 16> table{};
  for (std::size_t e = 0; e < 8; ++e) {
    for (std::size_t i = 0; i < 16; ++i) {
      const double width = static_cast<double>(1U << e) / 16;
      const double from = static_cast<double>(1U << e) + static_cast<double>(i) * width - 1;
      const double f0 = series::inverse_hyperbolic_sine(from);
      const double f1 = series::inverse_hyperbolic_sine(from + width / 2);
      const double f2 = series::inverse_hyperbolic_sine(from + width);
      table[e * 16 + i] = {series::to_raw(f0, argument_bits), series::to_raw(4 * f1 - 3 * f0 - f2, argument_bits),
                           series::to_raw(2 * f0 - 4 * f1 + 2 * f2, argument_bits)};
    }
  }
  return table;
}();

/// asinh (argument_bits) of x with `ratio_bits`, |error| < 7e-6.
constexpr std::int32_t asinh(std::int32_t x) {
  const std::int32_t sign = x >> 31;
  // 1 + |x|, at most 129 * 2^24: fits unsigned
  const std::uint32_t shifted =
      wrapping_subtract(static_cast<std::uint32_t>(x ^ sign), static_cast<std::uint32_t>(sign)) + (1U << ratio_bits);
  const int e = 31 - ratio_bits - std::countl_zero(shifted);
  // Leading one at bit 31. `shifted` is 2^24 at least, which the analyzer does not see.
  // NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult)
  const std::uint32_t mantissa = shifted << (31 - ratio_bits - e);
  const Parabola& piece = asinh_table[static_cast<std::uint32_t>(e) * 16 + ((mantissa >> 27) & 15U)];
  const std::int64_t s = mantissa & ((1U << 27) - 1);  // 27 bits
  const auto value = static_cast<std::int32_t>(piece.c0 + ((s * (piece.c1 + ((s * piece.c2) >> 27))) >> 27));
  return (value ^ sign) - sign;
}

constexpr std::int32_t magnitude(std::int32_t x) {
  const auto sign = static_cast<std::uint32_t>(x >> 31);
  const std::uint32_t size = wrapping_subtract(static_cast<std::uint32_t>(x) ^ sign, sign);
  return static_cast<std::int32_t>(size - (size >> 31));  // 2^31 becomes the nearest int32, without a branch
}

/// sign(x) with 30 bits
constexpr std::int32_t sign(std::int32_t x) { return ((x > 0) - (x < 0)) * (1 << 30); }
/// size where x >= 0, else -size.
constexpr std::int32_t signed_as(std::int32_t size, std::int64_t x) {
  const auto mask = static_cast<std::int32_t>(x >> 63);
  return (size ^ mask) - mask;
}

/// What a limiter to [-limit, limit], limit >= 0, adds to x; masks stand for max(x - limit, 0) and min(x + limit, 0).
constexpr std::int32_t clipping(std::int32_t x, std::int32_t limit) {
  const std::int64_t over = std::int64_t{x} - limit, under = std::int64_t{x} + limit;
  std::uint32_t ignored = 0;  // only x = -2^31 with limit 0 is outside
  return saturate(-((over & ~(over >> 63)) + (under & (under >> 63))), ignored);
}

/// a + b, saturated.
constexpr std::int32_t add_saturated(std::int32_t a, std::int32_t b) {
#ifdef __ARM_FEATURE_DSP
  if (!std::is_constant_evaluated()) return __qadd(a, b);
#endif
  std::uint32_t ignored = 0;
  return saturate(std::int64_t{a} + b, ignored);
}

/// slip() with unit_bits. Saturating to 31 bits takes one instruction whatever the data: from -1 to one unit below 1.
constexpr std::int32_t slip(std::int32_t z, std::int32_t moved) {
  static_assert(unit_bits == 30);
  return saturate_to<unit_bits + 1>(add_saturated(z, moved));
}

/// A count (count_bits) in parts, the rest with 30 bits; negative ones count as 0.
constexpr WholeAndRest<std::int32_t> split_count(std::int32_t x) {
  x &= ~(x >> 31);
  return {static_cast<std::uint32_t>(x) >> count_bits, (x & ((1 << count_bits) - 1)) << (unit_bits - count_bits)};
}

/// An argument (argument_bits) limited to 0 .. last + 1 < 16 in parts, the rest with 30 bits: 1 at the end.
constexpr WholeAndRest<std::int32_t> split_argument(std::int32_t x, std::uint32_t last) {
  const auto end = static_cast<std::int32_t>((last + 1) << argument_bits);
  x &= ~(x >> 31);
  x = x < end ? x : end;
  const std::uint32_t piece = static_cast<std::uint32_t>(x) >> argument_bits;
  const std::uint32_t whole = piece - static_cast<std::uint32_t>(piece > last);
  return {whole, (x - static_cast<std::int32_t>(whole << argument_bits)) * (1 << (unit_bits - argument_bits))};
}

}  // namespace raw

// ---- fixed point
// -----------------------------------------------------------------------------------------------------
template <int bits>
constexpr SineCosine<Fixed<unit_bits>> sin_cos(Fixed<bits> q) {
  const auto result = raw::sin_cos<bits>(q.raw);
  return {{result.sine}, {result.cosine}};
}
template <int bits>
constexpr SineCosine<Fixed<unit_bits>> sin_cos_turns(Wide<bits> turns) {
  const auto result = raw::sin_cos_of_phase(raw::phase_of_turns(turns.raw, bits));
  return {{result.sine}, {result.cosine}};
}
constexpr Fixed<unit_bits> tanh_of(Fixed<argument_bits> x) { return {raw::tanh(x.raw)}; }
constexpr Fixed<unit_bits> exp_negative(Fixed<argument_bits> x) { return {raw::exp_negative(x.raw)}; }
constexpr Fixed<argument_bits> asinh_of(Fixed<ratio_bits> x) { return {raw::asinh(x.raw)}; }
constexpr Fixed<ratio_bits> reciprocal_of(Fixed<unit_bits> x) { return {raw::reciprocal(x.raw)}; }
/// Exact: one more fractional bit.
template <int bits>
constexpr Wide<bits + 1> half_of(Wide<bits> x) {
  return {x.raw};
}
template <int bits>
constexpr Fixed<bits> magnitude(Fixed<bits> x) {
  return {raw::magnitude(x.raw)};
}
template <int bits>
constexpr Fixed<unit_bits> sign_of(Fixed<bits> x) {
  return {raw::sign(x.raw)};
}
template <int bits, int other>
constexpr Fixed<bits> signed_as(Fixed<bits> size, Wide<other> x) {
  return {raw::signed_as(size.raw, x.raw)};
}
template <int bits>
constexpr Fixed<bits> clipping(Fixed<bits> x, Fixed<bits> limit) {
  return {raw::clipping(x.raw, limit.raw)};
}
constexpr Fixed<unit_bits> slip(Fixed<unit_bits> z, Fixed<unit_bits> moved) { return {raw::slip(z.raw, moved.raw)}; }
constexpr Fixed<unit_bits> doubled(Fixed<unit_bits> x) { return {raw::add_saturated(x.raw, x.raw)}; }
constexpr WholeAndRest<Fixed<unit_bits>> split_count(Fixed<count_bits> x) {
  const auto parts = raw::split_count(x.raw);
  return {parts.whole, {parts.rest}};
}
constexpr WholeAndRest<Fixed<unit_bits>> split_argument(Fixed<argument_bits> x, std::uint32_t last) {
  const auto parts = raw::split_argument(x.raw, last);
  return {parts.whole, {parts.rest}};
}

// ---- all number systems
// ----------------------------------------------------------------------------------------------

/// exp(-x^2).
template <class N>
constexpr Unit<N> bell_of(Argument<N> x) {
  return exp_negative(N::template clamp<Argument<N>>(x * x));
}

/// a + share (b - a), 0 <= share <= 1: never outside [a, b].
template <class N, class T>
constexpr T blend(T a, T b, Unit<N> share) {
  const auto rest = N::template proven_narrow<Unit<N>>(N::one() - share);
  return N::template narrow_between<T>(a * rest + b * share, a, b);
}

/// The next value of a state that goes to its target by `share`, 0 <= share <= 1, in each tick: never outside both, so
/// a state whose targets keep to a range keeps to it for ever.
template <class N, class T>
constexpr T relax(T state, T target, Unit<N> share) {
  const auto rest = N::template proven_narrow<Unit<N>>(N::one() - share);
  return N::template narrow_relaxed<T>(state * rest + target * share, state, target, share);
}

}  // namespace fxdyn
