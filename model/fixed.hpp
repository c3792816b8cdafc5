#pragma once

#include <compare>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "model/quantity.hpp"
#include "model/wrapping.hpp"

#ifdef __ARM_FEATURE_SAT
#include <arm_acle.h>
#endif

// Two's complement binary fixed point: value = raw * 2^-bits, raw in int32 (a number) or int64 (a product or a sum).
// Products and sums widen and are exact; the only inexact operation is the narrowing back to 32 bits, which rounds
// half up and saturates. The arithmetic on raw integers stands once, in `raw`; `Fixed<bits>` (firmware, format known
// when compiling) and the host's run-time formats both call it, which is what makes them equal bit for bit.

namespace fxdyn {

/// Counts the narrowings that left their format and were saturated; 0 in healthy operation.
struct Saturations {
  std::uint32_t count = 0;
};

namespace raw {

inline constexpr std::int64_t max32 = std::numeric_limits<std::int32_t>::max();
inline constexpr std::int64_t min32 = std::numeric_limits<std::int32_t>::min();

/// x * 2^-shift, rounded half up (towards +infinity on a tie) for shift > 0, exact for shift <= 0. The rounding is
/// added after the shift, so that it can't overflow.
constexpr std::int64_t shift_right(std::int64_t x, int shift) {
  if (shift <= 0) return static_cast<std::int64_t>(wrapping_shift_left(static_cast<std::uint64_t>(x), -shift));
  return (x >> shift) + ((x >> (shift - 1)) & 1);
}

/// The nearest int32 to x; `outside` is 1 where x was out of range, else 0. No branch: both results are computed.
constexpr std::int32_t saturate(std::int64_t x, std::uint32_t& outside) {
  const auto low = static_cast<std::int32_t>(x);
  const auto high = static_cast<std::int32_t>(x >> 32);
  const std::int32_t bound = (high >> 31) ^ static_cast<std::int32_t>(max32);
  outside = static_cast<std::uint32_t>(high != (low >> 31));
  // a mask instead of a choice, of which compilers make a branch
  return low ^ ((low ^ bound) & -static_cast<std::int32_t>(outside));
}

constexpr std::int32_t narrow(std::int64_t x, int shift, std::uint32_t& outside) {
  return saturate(shift_right(x, shift), outside);
}

/// x * 2^-shift rounded half up, for x known to fit. On Thumb-2 the carry of the shift is the rounding: three
/// instructions instead of five.
template <int shift>
constexpr std::int32_t proven_narrow(std::int64_t x) {
  static_assert(0 <= shift && shift < 64);
  if constexpr (shift == 0) return static_cast<std::int32_t>(x);
  const auto high = static_cast<std::int32_t>(x >> 32);
  if constexpr (shift == 32) return high + static_cast<std::int32_t>(static_cast<std::uint32_t>(x) >> 31);
#if defined(__thumb2__)
  if (!std::is_constant_evaluated() && !__builtin_constant_p(x)) {
    if constexpr (shift < 32) {
      auto low = static_cast<std::uint32_t>(x);
      asm("lsrs %0, %0, %2\n\torr %0, %0, %1, lsl %3\n\tadc %0, %0, #0"
          : "+&r"(low)
          : "r"(high), "i"(shift), "i"((32 - shift) & 31)
          : "cc");
      return static_cast<std::int32_t>(low);
    } else {
      std::int32_t result = high;
      asm("asrs %0, %0, %1\n\tadc %0, %0, #0" : "+r"(result) : "i"((shift - 32) & 31) : "cc");
      return result;
    }
  }
#endif
  return static_cast<std::int32_t>(shift_right(x, shift));
}

/// narrow() that counts nothing. On Thumb-2 the shift's carry is the rounding and a conditional move the limit: ten
/// instructions instead of sixteen.
template <int shift>
constexpr std::int32_t clamp(std::int64_t x) {
  static_assert(0 <= shift && shift < 64);
#if defined(__thumb2__)
  if constexpr (shift > 0 && shift < 32) {
    if (!std::is_constant_evaluated() && !__builtin_constant_p(x)) {
      auto low = static_cast<std::uint32_t>(x);
      auto high = static_cast<std::int32_t>(x >> 32);
      std::int32_t bound = static_cast<std::int32_t>(max32);
      asm("lsrs %0, %0, %3\n\torr %0, %0, %1, lsl %4\n\tasr %1, %1, %3\n\tadcs %0, %0, #0\n\tadc %1, %1, #0\n\t"
          "cmp %1, %0, asr #31\n\tit ne\n\teorne %0, %2, %1, asr #31"
          : "+&r"(low), "+&r"(high)
          : "r"(bound), "i"(shift), "i"((32 - shift) & 31)
          : "cc");
      return static_cast<std::int32_t>(low);
    }
  }
#endif
  std::uint32_t ignored = 0;
  return narrow(x, shift, ignored);
}

/// x within [lower, upper]; `outside` is 1 where it was not. Minimum and maximum, no branch.
constexpr std::int32_t limit(std::int32_t x, std::int32_t lower, std::int32_t upper, std::uint32_t& outside) {
  const std::int32_t raised = x > lower ? x : lower;
  const std::int32_t result = raised < upper ? raised : upper;
  const auto difference = static_cast<std::uint32_t>(result ^ x);
  outside = (difference | wrapping_negate(difference)) >> 31;
  return result;
}

/// The upper half of the 64-bit product: a b 2^-32, rounded down.
constexpr std::int32_t multiply_high(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>((std::int64_t{a} * b) >> 32);
}

/// Saturates to `bits` bits with sign.
template <int bits>
constexpr std::int32_t saturate_to(std::int32_t x) {
#ifdef __ARM_FEATURE_SAT
  if (!std::is_constant_evaluated()) return __ssat(x, bits);
#endif
  constexpr std::int32_t most = (1 << (bits - 1)) - 1;
  return x > most ? most : (x < -most - 1 ? -most - 1 : x);
}

}  // namespace raw

/// An exact product or sum, value = raw * 2^-bits. Overflow of the 64 bits is excluded by the choice of formats.
template <int bits>
struct Wide {
  std::int64_t raw = 0;
  // Unsigned inside: whatever stands in a table that was flashed with a valid CRC, a sum wraps and nothing else
  // happens.
  friend constexpr Wide operator+(Wide a, Wide b) { return wrapped(wrapping_add(unsigned_of(a), unsigned_of(b))); }
  friend constexpr Wide operator-(Wide a, Wide b) { return wrapped(wrapping_subtract(unsigned_of(a), unsigned_of(b))); }
  friend constexpr Wide operator-(Wide a) { return wrapped(wrapping_negate(unsigned_of(a))); }

 private:
  static constexpr std::uint64_t unsigned_of(Wide x) { return static_cast<std::uint64_t>(x.raw); }
  static constexpr Wide wrapped(std::uint64_t x) { return {static_cast<std::int64_t>(x)}; }
};

/// A stored number, value = raw * 2^-bits. There is no conversion from double: firmware can't contain one.
template <int bits_>
struct Fixed {
  static constexpr int bits = bits_;
  std::int32_t raw = 0;

  template <int other>
  friend constexpr Wide<bits + other> operator*(Fixed a, Fixed<other> b) {
    return {static_cast<std::int64_t>(a.raw) * b.raw};
  }
  friend constexpr Wide<bits> operator+(Fixed a, Fixed b) { return {std::int64_t{a.raw} + b.raw}; }
  friend constexpr Wide<bits> operator-(Fixed a, Fixed b) { return {std::int64_t{a.raw} - b.raw}; }
  friend constexpr Wide<bits> operator-(Fixed a) { return {-std::int64_t{a.raw}}; }
  friend constexpr auto operator<=>(Fixed, Fixed) = default;
};

template <class T>
concept OfRaw = requires(T x) {
  x.raw;
};

/// No number is divided in fixed point. Declared for its message alone.
template <class A, class B>
requires(OfRaw<A> || OfRaw<B>) constexpr auto operator/(const A&, const B&) {
  static_assert(sizeof(A) == 0,
                "no division on the drive: a shape parameter is stored as the reciprocal that the formula needs");
}

/// x within [lower, upper]; counted where it was not.
template <int bits>
constexpr Fixed<bits> limit(Fixed<bits> x, Fixed<bits> lower, Fixed<bits> upper, Saturations& saturations) {
  std::uint32_t outside = 0;
  const Fixed<bits> result{raw::limit(x.raw, lower.raw, upper.raw, outside)};
  saturations.count += outside;
  return result;
}
constexpr double limit(double x, double lower, double upper, Saturations& saturations) {
  const double result = x < lower ? lower : (x > upper ? upper : x);
  saturations.count += static_cast<std::uint32_t>(result != x);
  return result;
}

/// condition ? a : b, without a branch in fixed point: a tick takes the same number of instructions whatever the data.
template <class T>
constexpr T select(bool condition, const T& a, const T& b) {
  return condition ? a : b;
}
template <int bits>
constexpr Fixed<bits> select(bool condition, Fixed<bits> a, Fixed<bits> b) {
  return {b.raw ^ ((a.raw ^ b.raw) & -static_cast<std::int32_t>(condition))};
}

/// x * x; a name of its own since an interval's square is narrower than the product of two intervals.
template <class T>
constexpr auto square(const T& x) {
  return x * x;
}

constexpr double align(double x, double) { return x; }

/// x, exactly, in the finer format of `like`: what it takes to add numbers of different formats. A coarser target
/// does not compile.
template <int bits, int like>
constexpr Wide<like> align(Fixed<bits> x, Wide<like>) {
  static_assert(like >= bits, "the accumulator is coarser than the number: narrow explicitly");
  return {raw::shift_right(x.raw, bits - like)};
}
template <int bits, int like>
constexpr Wide<like> align(Wide<bits> x, Wide<like>) {
  static_assert(like >= bits, "the accumulator is coarser than the number: narrow explicitly");
  return {raw::shift_right(x.raw, bits - like)};
}

}  // namespace fxdyn
