#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <compare>

#include "host_tools/numbers/formats.hpp"
#include "host_tools/support/error.hpp"
#include "model/math.hpp"
#include "model/numbers.hpp"

// The firmware's fixed point on the host, with formats that are known only at run time: the same templates of model/,
// the same functions on raw integers (namespace raw), hence the same bits. A test replays both side by side.

namespace fxdyn {

/// 64-bit sums must not wrap: the choice of formats sees to it, and the host checks every one.
[[noreturn]] inline void sum_overflow() {
  throw DataError(
      "a 64-bit sum overflows in fixed point: limits or parameters are too far apart in size; check the project's "
      "limits");
}

struct RunTimeWide {
  std::int64_t raw = 0;
  int bits = 0;

  friend RunTimeWide operator+(RunTimeWide a, RunTimeWide b) {
    assert(a.bits == b.bits);
    if (__builtin_add_overflow(a.raw, b.raw, &a.raw)) sum_overflow();
    return a;
  }
  friend RunTimeWide operator-(RunTimeWide a, RunTimeWide b) {
    assert(a.bits == b.bits);
    if (__builtin_sub_overflow(a.raw, b.raw, &a.raw)) sum_overflow();
    return a;
  }
  friend RunTimeWide operator-(RunTimeWide a) { return {-a.raw, a.bits}; }
};

/// The formats in force on this thread while a FormatScope lives.
inline thread_local const Formats* current_formats = nullptr;

class FormatScope {
 public:
  explicit FormatScope(const Formats& formats) : previous_(current_formats) { current_formats = &formats; }
  ~FormatScope() { current_formats = previous_; }
  FormatScope(const FormatScope&) = delete;
  FormatScope& operator=(const FormatScope&) = delete;

 private:
  const Formats* previous_;
};

template <Kind kind>
struct RunTimeFixed {
  std::int32_t raw = 0;

  static int bits() { return bits_of(*current_formats, kind); }
  template <Kind other>
  friend RunTimeWide operator*(RunTimeFixed a, RunTimeFixed<other> b) {
    return {static_cast<std::int64_t>(a.raw) * b.raw, bits() + b.bits()};
  }
  friend RunTimeWide operator+(RunTimeFixed a, RunTimeFixed b) { return {std::int64_t{a.raw} + b.raw, bits()}; }
  friend RunTimeWide operator-(RunTimeFixed a, RunTimeFixed b) { return {std::int64_t{a.raw} - b.raw, bits()}; }
  friend RunTimeWide operator-(RunTimeFixed a) { return {-std::int64_t{a.raw}, bits()}; }
  friend auto operator<=>(RunTimeFixed, RunTimeFixed) = default;
};

inline RunTimeWide align(RunTimeWide x, RunTimeWide like) {
  assert(like.bits >= x.bits);
  const std::int64_t shifted = raw::shift_right(x.raw, x.bits - like.bits);
  if (shifted >> (like.bits - x.bits) != x.raw) sum_overflow();
  return {shifted, like.bits};
}
template <Kind kind>
RunTimeWide align(RunTimeFixed<kind> x, RunTimeWide like) {
  return align(RunTimeWide{x.raw, x.bits()}, like);
}

template <Kind kind>
RunTimeFixed<kind> limit(RunTimeFixed<kind> x, RunTimeFixed<kind> lower, RunTimeFixed<kind> upper,
                         Saturations& saturations) {
  std::uint32_t outside = 0;
  const RunTimeFixed<kind> result{raw::limit(x.raw, lower.raw, upper.raw, outside)};
  saturations.count += outside;
  return result;
}

struct RunTimeNumbers {
  template <Quantity quantity>
  using Of = RunTimeFixed<Kind{Kind::number, quantity}>;
  template <Quantity quantity>
  using Coefficient = RunTimeFixed<Kind{Kind::coefficient, quantity}>;
  using Mass = RunTimeFixed<Kind{Kind::mass}>;
  using FirstMoment = RunTimeFixed<Kind{Kind::first_moment}>;
  using SecondMoment = RunTimeFixed<Kind{Kind::second_moment}>;
  using TorqueSum = RunTimeWide;
  template <Quantity quantity>
  using DeflectionCoefficient = RunTimeFixed<Kind{Kind::deflection_coefficient, quantity}>;
  using DeflectionSum = RunTimeWide;
  using Word = std::int32_t;
  static constexpr bool packed = true;
  using NodeArgument = std::int32_t;
  static int weight_bits() { return (*current_formats)[Quantity::weight]; }

  template <class T>
  static T load(Word word) {
    return {word};
  }
  static TorqueSum no_torque() { return {0, current_formats->torque_sum}; }
  static DeflectionSum no_deflection() { return {0, current_formats->deflection_sum}; }
  static Of<Quantity::feature> feature(RunTimeWide x) {
    return {raw::saturate_to<16>(proven_narrow<Of<Quantity::feature>>(x).raw)};
  }
  static TorqueSum node_sum(std::int64_t sum, int bits) {
    return align(RunTimeWide{sum, bits + small_bits}, no_torque());
  }
  template <class T, class U>
  static Vector3<T> turned(const Vector3<T>& v, U, U) {
    return v;
  }
  template <class T>
  static NoLength rounded_length(NoLength, double) {
    return {};
  }
  template <class T>
  static T narrow_between(RunTimeWide x, T, T) {
    return proven_narrow<T>(x);
  }
  template <class T>
  static T narrow_relaxed(RunTimeWide x, T, T, Of<Quantity::unit>) {
    return proven_narrow<T>(x);
  }
  static Of<Quantity::unit> one() { return {1 << unit_bits}; }

  template <class T>
  static T narrow(RunTimeWide x, Saturations& saturations) {
    assert(x.bits >= T::bits());
    std::uint32_t outside = 0;
    const T result{raw::narrow(x.raw, x.bits - T::bits(), outside)};
    saturations.count += outside;
    return result;
  }
  template <class T>
  static T narrow_counted(RunTimeWide x, Saturations& saturations) {
    return narrow<T>(x, saturations);
  }
  template <class T>
  static T proven_narrow(RunTimeWide x) {
    assert(x.bits >= T::bits());
    std::uint32_t outside = 0;
    const T result{raw::narrow(x.raw, x.bits - T::bits(), outside)};
    if (outside != 0) sum_overflow();
    return result;
  }
  template <class T>
  static T clamp(RunTimeWide x) {
    Saturations ignored;
    return narrow<T>(x, ignored);
  }
  template <class T, Kind kind>
  static T convert(RunTimeFixed<kind> x) {
    std::uint32_t outside = 0;
    const T result{raw::narrow(x.raw, x.bits() - T::bits(), outside)};
    if (outside != 0) sum_overflow();
    return result;
  }
};

template <Kind kind>
SineCosine<RunTimeNumbers::Of<Quantity::unit>> sin_cos(RunTimeFixed<kind> q) {
  const auto result = raw::sin_cos(q.raw, q.bits());
  return {{result.sine}, {result.cosine}};
}
inline SineCosine<RunTimeNumbers::Of<Quantity::unit>> sin_cos_turns(RunTimeWide turns) {
  const auto result = raw::sin_cos_of_phase(raw::phase_of_turns(turns.raw, turns.bits));
  return {{result.sine}, {result.cosine}};
}
inline RunTimeNumbers::Of<Quantity::unit> tanh_of(RunTimeNumbers::Of<Quantity::argument> x) {
  return {raw::tanh(x.raw)};
}
inline RunTimeNumbers::Of<Quantity::unit> exp_negative(RunTimeNumbers::Of<Quantity::argument> x) {
  return {raw::exp_negative(x.raw)};
}
inline RunTimeNumbers::Of<Quantity::argument> asinh_of(RunTimeNumbers::Of<Quantity::ratio> x) {
  return {raw::asinh(x.raw)};
}
inline RunTimeNumbers::Of<Quantity::ratio> reciprocal_of(RunTimeNumbers::Of<Quantity::unit> x) {
  return {raw::reciprocal(x.raw)};
}
inline RunTimeWide half_of(RunTimeWide x) { return {x.raw, x.bits + 1}; }
template <Kind kind>
RunTimeFixed<kind> magnitude(RunTimeFixed<kind> x) {
  return {raw::magnitude(x.raw)};
}
template <Kind kind>
RunTimeNumbers::Of<Quantity::unit> sign_of(RunTimeFixed<kind> x) {
  return {raw::sign(x.raw)};
}
template <Kind kind>
RunTimeFixed<kind> signed_as(RunTimeFixed<kind> size, RunTimeWide x) {
  return {raw::signed_as(size.raw, x.raw)};
}
template <Kind kind>
RunTimeFixed<kind> clipping(RunTimeFixed<kind> x, RunTimeFixed<kind> limit) {
  return {raw::clipping(x.raw, limit.raw)};
}
inline RunTimeNumbers::Of<Quantity::unit> slip(RunTimeNumbers::Of<Quantity::unit> z,
                                               RunTimeNumbers::Of<Quantity::unit> moved) {
  return {raw::slip(z.raw, moved.raw)};
}
inline RunTimeNumbers::Of<Quantity::unit> doubled(RunTimeNumbers::Of<Quantity::unit> x) {
  return {raw::add_saturated(x.raw, x.raw)};
}
inline WholeAndRest<RunTimeNumbers::Of<Quantity::unit>> split_count(RunTimeNumbers::Of<Quantity::count> x) {
  const auto parts = raw::split_count(x.raw);
  return {parts.whole, {parts.rest}};
}
inline WholeAndRest<RunTimeNumbers::Of<Quantity::unit>> split_argument(RunTimeNumbers::Of<Quantity::argument> x,
                                                                       std::uint32_t last) {
  const auto parts = raw::split_argument(x.raw, last);
  return {parts.whole, {parts.rest}};
}

/// The nearest fixed-point number with `bits` fractional bits; saturates.
inline std::int32_t to_raw(double value, int bits) {
  const double scaled = std::floor(std::ldexp(value, bits) + 0.5);
  return static_cast<std::int32_t>(
      std::clamp(scaled, static_cast<double>(raw::min32), static_cast<double>(raw::max32)));
}
inline double from_raw(std::int32_t raw_value, int bits) { return std::ldexp(static_cast<double>(raw_value), -bits); }

}  // namespace fxdyn
