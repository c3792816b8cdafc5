#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/fixed.hpp"
#include "model/math.hpp"

// The int16 kernels of the Broad Learning System. Two int16 stand in one word (the first in the lower half), so that
// cores with the DSP extension (Cortex-M4, M7, M33) multiply and add both in one instruction; elsewhere the same sums
// are written out. Sums are exact in 64 bits: order and instruction make no difference to the bits.

namespace fxdyn::raw {

constexpr std::int32_t lower_half(std::int32_t pair) { return static_cast<std::int16_t>(pair); }
constexpr std::int32_t upper_half(std::int32_t pair) { return pair >> 16; }
constexpr std::int32_t pack(std::int32_t lower, std::int32_t upper) {
  return static_cast<std::int32_t>((static_cast<std::uint32_t>(lower) & 0xffffU) |
                                   wrapping_shift_left(static_cast<std::uint32_t>(upper), 16));
}

constexpr std::int32_t pack_upper_halves(std::int32_t lower, std::int32_t upper) {
#ifdef __ARM_FEATURE_DSP
  if (!std::is_constant_evaluated()) {
    asm("pkhtb %0, %1, %2, asr #16" : "=r"(lower) : "r"(upper), "r"(lower));
    return lower;
  }
#endif
  return pack(upper_half(lower), upper_half(upper));
}

/// A 64-bit sum of products of int16. Its halves are variables of their own: the compiler moves pairs of registers
/// about, single ones it leaves where they are.
struct DualSum {
  std::uint32_t low = 0;
  std::int32_t high = 0;

  constexpr DualSum() = default;
  constexpr explicit DualSum(std::int32_t start) : low(static_cast<std::uint32_t>(start)), high(start >> 31) {}
  constexpr std::int64_t value() const {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(static_cast<std::uint32_t>(high)) << 32 | low);
  }
  /// sum 2^-shift, 0 < shift < 32, rounded down, for a result of 32 bits
  constexpr std::int32_t shifted(int shift) const {
    return static_cast<std::int32_t>(low >> shift | wrapping_shift_left(static_cast<std::uint32_t>(high), 32 - shift));
  }
  /// += a_lower b_lower + a_upper b_upper
  constexpr void add(std::int32_t a, std::int32_t b) {
#ifdef __ARM_FEATURE_DSP
    if (!std::is_constant_evaluated()) {
      asm("smlald %0, %1, %2, %3" : "+r"(low), "+r"(high) : "r"(a), "r"(b));
      return;
    }
#endif
    const std::int64_t sum =
        value() + std::int64_t{lower_half(a)} * lower_half(b) + std::int64_t{upper_half(a)} * upper_half(b);
    low = static_cast<std::uint32_t>(sum);
    high = static_cast<std::int32_t>(sum >> 32);
  }
};

/// Two words from `at` on, which moves behind them: one instruction where there is one.
constexpr void load_two(const std::int32_t*& at, std::int32_t& first, std::int32_t& second) {
#ifdef __thumb2__
  if (!std::is_constant_evaluated()) {
    asm("ldrd %0, %1, [%2], #8"
        : "=&r"(first), "=&r"(second), "+r"(at)
        : "m"(*reinterpret_cast<const std::int32_t(*)[2]>(at)));
    return;
  }
#endif
  first = at[0];
  second = at[1];
  at += 2;
}

/// Words of one row of a dense layer: the bias in the format of the sum, then the weights, two a word.
template <std::size_t inputs>
inline constexpr std::size_t row_words = inputs / 2 + 1;

/// One row: bias + sum_i w_i u_i; `row` moves to the next.
template <std::size_t inputs>
constexpr DualSum dense_row(const std::int32_t*& row, const std::int32_t* u) {
  constexpr std::size_t words = inputs / 2, alone = words % 2;
  std::int32_t bias = 0, a = 0, b = 0;
  if constexpr (alone == 1) {
    load_two(row, bias, a);
  } else {
    bias = *row++;
  }
  DualSum sum(bias);
  if constexpr (alone == 1) sum.add(a, u[0]);
#pragma GCC unroll 32
  for (std::size_t i = alone; i < words; i += 2) {
    load_two(row, a, b);
    sum.add(a, u[i]);
    sum.add(b, u[i + 1]);
  }
  return sum;
}

/// out_k = (bias_k + sum_i w_ki u_i) 2^-shift, rounded down (the exporter adds half a unit to the bias) and saturated
/// to `bits` bits with sign; |sum| 2^-shift must be below 2^31. `outputs` is even (constant in firmware).
template <std::size_t inputs, int bits>
[[gnu::always_inline]] constexpr void dense(std::size_t outputs, int shift, const std::int32_t* rows,
                                            const std::int32_t* u, std::int32_t* out) {
  static_assert(inputs % 2 == 0, "pad with zeros to an even number");
#pragma GCC unroll 4
  for (std::size_t k = 0; k < outputs; k += 2) {
    const std::int32_t first = dense_row<inputs>(rows, u).shifted(shift);
    const std::int32_t second = dense_row<inputs>(rows, u).shifted(shift);
    out[k] = saturate_to<bits>(first);
    out[k + 1] = saturate_to<bits>(second);
  }
}

/// The activations are tanh with this value as one: raw int16 = tanh * activation_one, so that +-1 is exact.
inline constexpr std::int32_t activation_one = 32767;
inline constexpr int tanh_argument_bits = 16;    ///< fractional bits of the table's argument
inline constexpr int tanh_argument_width = 20;   ///< bits with sign: +-8
inline constexpr int tanh_table_step_bits = 10;  ///< step 1/64

/// tanh over [-8, 8), 64 intervals a unit. A word holds slope (lower half, signed) and, as a whole, the value at the
/// interval's start with 31 bits plus half a unit of the result: word + slope * offset has the result in its upper
/// half. The line of an interval is shifted by half of its largest distance from the curve.
inline constexpr auto tanh_lines = [] {
  std::array<std::int32_t, 1024> table{};
  for (int i = 0; i < 1024; ++i) {
    const auto tanh_of = [](int x) {  // of x / 128
      const double size = series::hyperbolic_tangents[static_cast<std::size_t>(x < 0 ? -x : x)];
      return x < 0 ? -size : size;
    };
    const int from = 2 * (i - 512), to = from + 2;
    const double f0 = tanh_of(from), f1 = tanh_of(to), bow = (tanh_of(from + 1) - (f0 + f1) / 2) / 2;
    const double scale = activation_one * 65536.0;
    const double slope = (f1 - f0) * scale / (1 << tanh_table_step_bits);
    // NOLINTNEXTLINE(bugprone-incorrect-roundings): a slope of tanh is never negative
    const auto slope_raw = static_cast<std::int32_t>(slope + 0.5);
    const double value = (f0 + bow) * scale + 32768.0;
    // the nearest number whose lower half is the slope
    const double upper = (value - slope_raw) / 65536.0;
    const auto upper_raw = static_cast<std::int32_t>(upper < 0 ? upper - 0.5 : upper + 0.5);
    table[static_cast<std::size_t>(i)] = pack(slope_raw, upper_raw);
  }
  return table;
}();

/// Largest error of tanh_line(): half a unit of int16 each for the value at an interval's start and for the result, and
/// what the curve leaves the line.
inline constexpr double tanh_line_error = 4.1e-5;

/// tanh in the upper half of the result; x with tanh_argument_bits in tanh_argument_width bits.
constexpr std::int32_t tanh_line(std::int32_t x) {
  const std::int32_t* middle = tanh_lines.data() + 512;
  const std::int32_t line = middle[x >> tanh_table_step_bits];
  const std::int32_t offset = x & ((1 << tanh_table_step_bits) - 1);
#ifdef __ARM_FEATURE_DSP
  if (!std::is_constant_evaluated()) return __smlabb(line, offset, line);
#endif
  return line + lower_half(line) * offset;
}

/// sum_k c_k tanh(x_k): coefficients two a word, `nodes` even.
[[gnu::always_inline]] constexpr std::int64_t weighted_tanh(std::size_t nodes, const std::int32_t* coefficients,
                                                            const std::int32_t* x) {
  DualSum sum;
#pragma GCC unroll 2
  for (std::size_t k = 0; k < nodes; k += 2) {
    const std::int32_t lower = tanh_line(x[k]), upper = tanh_line(x[k + 1]);
    sum.add(*coefficients++, pack_upper_halves(lower, upper));
  }
  return sum.value();
}

/// The ramp max(x, 0) needs no table: with the argument's +-8 in int16 the raw x is the int16 of x / 8.
inline constexpr int ramp_argument_bits = 12;
inline constexpr int ramp_argument_width = 16;
/// Largest error of ramp() as x / 8: the largest int16 stands for 8.
inline constexpr double ramp_error = 3.1e-5;

constexpr std::int32_t ramp(std::int32_t x) { return x & ~(x >> 31); }

/// sum_k c_k max(x_k, 0): coefficients two a word, `nodes` even, x with ramp_argument_bits in ramp_argument_width bits.
[[gnu::always_inline]] constexpr std::int64_t weighted_ramp(std::size_t nodes, const std::int32_t* coefficients,
                                                            const std::int32_t* x) {
  DualSum sum;
#pragma GCC unroll 2
  for (std::size_t k = 0; k < nodes; k += 2) sum.add(*coefficients++, pack(ramp(x[k]), ramp(x[k + 1])));
  return sum.value();
}

}  // namespace fxdyn::raw
