#pragma once

#include <compare>
#include <cstdint>
#include <limits>

#include "model/quantity.hpp"

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

/// x * 2^-shift, rounded half up (towards +infinity on a tie) for shift > 0, exact for shift <= 0. The rounding term is
/// added to the value above the last dropped bit, so it can't overflow.
constexpr std::int64_t shift_right(std::int64_t x, int shift) {
  if (shift <= 0) return static_cast<std::int64_t>(static_cast<std::uint64_t>(x) << -shift);
  return ((x >> (shift - 1)) + 1) >> 1;
}

/// The nearest int32 to x; `outside` is 1 where x was out of range, else 0. No branch: both results are computed.
constexpr std::int32_t saturate(std::int64_t x, std::uint32_t& outside) {
  const auto low = static_cast<std::int32_t>(x);
  const auto high = static_cast<std::int32_t>(x >> 32);
  const std::int32_t bound = (high >> 31) ^ static_cast<std::int32_t>(max32);
  outside = static_cast<std::uint32_t>(high != (low >> 31));
  return outside != 0 ? bound : low;
}

constexpr std::int32_t narrow(std::int64_t x, int shift, std::uint32_t& outside) {
  return saturate(shift_right(x, shift), outside);
}

/// x * 2^-shift rounded half up, for x known to fit.
template <int shift>
constexpr std::int32_t proven_narrow(std::int64_t x) {
  return static_cast<std::int32_t>(shift_right(x, shift));
}

}  // namespace raw

/// An exact product or sum, value = raw * 2^-bits. Overflow of the 64 bits is excluded by the choice of formats.
template <int bits>
struct Wide {
  std::int64_t raw = 0;
  friend constexpr Wide operator+(Wide a, Wide b) { return {a.raw + b.raw}; }
  friend constexpr Wide operator-(Wide a, Wide b) { return {a.raw - b.raw}; }
  friend constexpr Wide operator-(Wide a) { return {-a.raw}; }
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
