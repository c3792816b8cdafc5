#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "host_tools/numbers/formats.hpp"
#include "host_tools/numbers/run_time_fixed.hpp"
#include "model/broad_learning.hpp"
#include "model/effects/curve.hpp"
#include "model/math.hpp"
#include "model/numbers.hpp"

// Bounds instead of numbers: an interval that holds the exact value, and the largest |fixed - exact|. The model's own
// templates run in them, so what is proven is the code that runs in the drive.
//   BoundedNumbers without formats in force: interval arithmetic; the largest magnitudes seen choose the formats.
//   BoundedNumbers with formats in force (BoundScope): every narrowing adds its rounding, the functions of math.hpp add
//   their stated errors; what could leave its format is an error of the export.
// Intervals are evaluated in double precision without directed rounding: 2^-52 against a reserve of 2^-1 in the
// formats.

namespace fxdyn {

/// Largest magnitude that each kind of number took, errors included, and of the 64-bit sums in front of a narrowing.
struct Ranges {
  std::array<std::array<double, quantity_count>, group_count> largest{};

  double& at(Kind kind) { return largest[kind.group][static_cast<std::size_t>(kind.quantity)]; }
  double operator[](Kind kind) const { return largest[kind.group][static_cast<std::size_t>(kind.quantity)]; }
  double operator[](Quantity quantity) const { return (*this)[Kind{Kind::number, quantity}]; }
  void see(Kind kind, double x) { at(kind) = std::fmax(at(kind), x); }
};

/// What bounding needs on this thread: where ranges go, and the formats whose roundings count (null: none).
struct Bounding {
  Ranges* ranges = nullptr;
  const Formats* formats = nullptr;
  bool creeps = false;  ///< this tick stands for a whole creep: states add its error to what they have
};
inline thread_local Bounding current_bounding;

class BoundScope {
 public:
  BoundScope(Ranges& ranges, const Formats* formats) : previous_(current_bounding) {
    current_bounding = {&ranges, formats};
  }
  ~BoundScope() { current_bounding = previous_; }
  BoundScope(const BoundScope&) = delete;
  BoundScope& operator=(const BoundScope&) = delete;

 private:
  Bounding previous_;
};

/// The states of Dahl's model and of relaxations forget their rounding errors while they move and add them up while
/// they creep. Their error is bounded for creeping (less than one presliding distance or time constant in so many
/// ticks) that lasts no longer than this: ten seconds at 2 ms. A spring that slips (slip()) forgets only when it is
/// full, so for it a motion to and fro within two slip distances counts as creeping, too.
inline constexpr double creeping_ticks = 5'000;

struct Bound {
  double low = 0, high = 0, error = 0;

  double magnitude() const { return std::fmax(std::fabs(low), std::fabs(high)); }
  bool operator==(const Bound&) const = default;

  friend Bound operator+(Bound a, Bound b) { return {a.low + b.low, a.high + b.high, a.error + b.error}; }
  friend Bound operator-(Bound a, Bound b) { return {a.low - b.high, a.high - b.low, a.error + b.error}; }
  friend Bound operator-(Bound a) { return {-a.high, -a.low, a.error}; }
  friend Bound operator*(Bound a, Bound b) {
    const double p = a.low * b.low, q = a.low * b.high, r = a.high * b.low, s = a.high * b.high;
    return {std::fmin(std::fmin(p, q), std::fmin(r, s)), std::fmax(std::fmax(p, q), std::fmax(r, s)),
            a.magnitude() * b.error + b.magnitude() * a.error + a.error * b.error};
  }
  static Bound hull(Bound a, Bound b) {
    return {std::fmin(a.low, b.low), std::fmax(a.high, b.high), std::fmax(a.error, b.error)};
  }
  Bound cut(double from, double to) const {
    return {std::fmin(std::fmax(low, from), to), std::fmax(std::fmin(high, to), from), error};
  }
};

/// Length of a vector and of its error; unknown: infinite.
struct BoundedLength {
  double length = std::numeric_limits<double>::infinity(), error = std::numeric_limits<double>::infinity();

  friend BoundedLength operator+(BoundedLength a, BoundedLength b) { return {a.length + b.length, a.error + b.error}; }
  friend BoundedLength operator*(BoundedLength a, BoundedLength b) {
    return {a.length * b.length, a.length * b.error + b.length * a.error + a.error * b.error};
  }
};

struct BoundedWide {
  Bound value;
  friend BoundedWide operator+(BoundedWide a, BoundedWide b) { return {a.value + b.value}; }
  friend BoundedWide operator-(BoundedWide a, BoundedWide b) { return {a.value - b.value}; }
  friend BoundedWide operator-(BoundedWide a) { return {-a.value}; }
};

template <Kind kind>
struct Bounded {
  Bound value;
  template <Kind other>
  friend BoundedWide operator*(Bounded a, Bounded<other> b) {
    return {a.value * b.value};
  }
  friend BoundedWide operator+(Bounded a, Bounded b) { return {a.value + b.value}; }
  friend BoundedWide operator-(Bounded a, Bounded b) { return {a.value - b.value}; }
  friend BoundedWide operator-(Bounded a) { return {-a.value}; }
};

template <Kind kind>
struct LengthOf<Bounded<kind>> {
  using type = BoundedLength;
};
template <>
struct LengthOf<BoundedWide> {
  using type = BoundedLength;
};

inline BoundedLength length_of(const Bound& x) { return {x.magnitude(), x.error}; }
template <Kind kind>
BoundedLength length_of(const Bounded<kind>& x) {
  return length_of(x.value);
}
template <class T>
requires std::same_as<typename LengthOf<T>::type, BoundedLength> BoundedLength length_of(const Vector3<T>& v) {
  const Bound x = v.x.value, y = v.y.value, z = v.z.value;
  return {std::fmin(v.length.length, std::hypot(x.magnitude(), y.magnitude(), z.magnitude())),
          std::fmin(v.length.error, std::hypot(x.error, y.error, z.error))};
}

template <Kind kind>
BoundedWide square(const Bounded<kind>& x) {
  const Bound v = x.value, product = v * v;
  const double most = v.magnitude() * v.magnitude();
  const bool zero = v.low <= 0 && v.high >= 0;
  return {{zero ? 0 : std::fmin(v.low * v.low, v.high * v.high), most, product.error}};
}

inline BoundedWide align(BoundedWide x, BoundedWide) { return x; }
template <Kind kind>
BoundedWide align(Bounded<kind> x, BoundedWide) {
  return {x.value};
}

struct BoundedNumbers {
  template <Quantity quantity>
  using Of = Bounded<Kind{Kind::number, quantity}>;
  template <Quantity quantity>
  using Coefficient = Bounded<Kind{Kind::coefficient, quantity}>;
  template <Quantity quantity>
  using DeflectionCoefficient = Bounded<Kind{Kind::deflection_coefficient, quantity}>;
  using Mass = Bounded<Kind{Kind::mass}>;
  using FirstMoment = Bounded<Kind{Kind::first_moment}>;
  using SecondMoment = Bounded<Kind{Kind::second_moment}>;
  using TorqueSum = BoundedWide;
  using DeflectionSum = BoundedWide;
  using Word = Bound;
  static constexpr bool packed = false;
  using NodeArgument = BoundedWide;

  template <class T>
  static T load(Word word) {
    return {word};
  }
  static TorqueSum no_torque() { return {}; }
  static DeflectionSum no_deflection() { return {}; }
  static Of<Quantity::unit> one() { return {{1, 1, 0}}; }

  template <class T>
  static T proven_narrow(BoundedWide x) {
    return see(T{rounded<T>(x.value)});
  }
  template <class T>
  static T narrow_counted(BoundedWide x, Saturations&) {
    if (current_bounding.formats == nullptr) return {x.value};
    const double most = 2147483647 * unit<T>();
    return {rounded<T>(x.value).cut(-most, most)};
  }
  template <class T>
  static T narrow(BoundedWide x, Saturations&) {
    // saturates, so that its range is no demand on the format
    if (current_bounding.formats == nullptr) return {x.value};
    const double most = 2147483647 * unit<T>();
    Bound out = rounded<T>(x.value);
    out.error += std::fmax(0.0, out.magnitude() + out.error - most);  // double does not saturate
    return {out};
  }
  /// Where fixed point is cut, what is lost shows in the functions behind it.
  template <class T>
  static T clamp(BoundedWide x) {
    return {rounded<T>(x.value)};
  }
  template <class T, Kind kind>
  static T convert(Bounded<kind> x) {
    return proven_narrow<T>({x.value});
  }
  static Of<Quantity::feature> feature(BoundedWide x) {
    Bound value = x.value;
    if (current_bounding.formats != nullptr) value.error += std::ldexp(1.0, -small_bits);  // rounding and +1 itself
    return {value.cut(-1, 1)};
  }
  template <class Activation>
  static Of<Quantity::activation> activation(BoundedWide x) {
    Bound out{Activation::of(x.value.low), Activation::of(x.value.high), 0};  // activations never fall
    if (current_bounding.formats != nullptr) {
      // half a unit of the kernel's argument, the kernel's stated error
      out.error = steepest<Activation>(x.value) * (x.value.error + std::ldexp(0.5, -Activation::argument_bits)) +
                  Activation::kernel_error;
    }
    return {out};
  }
  static Coefficient<Quantity::activation> node_coefficient(Word word, int) { return {word}; }

  template <class T, class U>
  static Vector3<T> turned(Vector3<T> v, U cosine, U sine) {
    if (current_bounding.formats != nullptr) {
      v.length.error += v.length.length * std::hypot(cosine.value.error, sine.value.error) +
                        v.length.error * std::hypot(cosine.value.error, sine.value.error) + unit<T>() / std::sqrt(2.0);
    }
    const BoundedLength most = v.length;
    const auto cut = [&](Bound& x) {
      x = x.cut(-most.length, most.length);
      x.error = std::fmin(x.error, most.error);
    };
    cut(v.x.value);
    cut(v.y.value);
    cut(v.z.value);
    v.length = length_of(v);
    return v;
  }
  template <class T>
  static BoundedLength rounded_length(BoundedLength x, double units) {
    if (current_bounding.formats != nullptr) x.error += unit<T>() * units;
    return x;
  }
  template <class T>
  static T narrow_between(BoundedWide x, T a, T b) {
    Bound out = Bound::hull(a.value, b.value);
    if (current_bounding.formats != nullptr) out.error = rounded<T>(x.value).error;
    return {out};
  }
  /// Each tick adds an own error p and keeps the state's with a weight of 1 - share: p / share in the end, on top of
  /// the target's. A state that creeps keeps its error, to which creeping_ticks times p come.
  template <class T>
  static T narrow_relaxed(BoundedWide, T state, T target, Of<Quantity::unit> share) {
    Bound out = Bound::hull(state.value, target.value);
    if (current_bounding.formats == nullptr) return {out};
    const double kept = state.value.error, from_target = target.value.error;
    const double own = (state.value.magnitude() + kept + target.value.magnitude() + from_target) *
                           (share.value.error + unit<Of<Quantity::unit>>()) +
                       unit<T>() / 2;
    const bool forgets =
        share.value.low > 1 / creeping_ticks || (share.value.low > 0 && share.value.low == share.value.high);
    const double in_the_end = from_target + own * (forgets ? 1 / share.value.low : creeping_ticks);
    out.error = std::fmax(kept, in_the_end);
    if (!forgets && current_bounding.creeps) out.error = std::fmax(kept, from_target) + own * creeping_ticks;
    // Both states stay between what they were and their targets.
    out.error = std::fmin(out.error, out.high - out.low + from_target + unit<T>());
    return {out};
  }
  /// Largest slope of a curve that is steepest at zero.
  template <class Curve>
  static double steepest(Bound x) {
    const double nearest = x.low <= 0 && x.high >= 0 ? 0 : std::fmin(std::fabs(x.low), std::fabs(x.high));
    return Curve::steepest(std::fmax(0.0, nearest - x.error));
  }

 private:
  template <Kind kind>
  static Kind kind_of(Bounded<kind>) {
    return kind;
  }
  template <class T>
  static double unit() {
    return std::ldexp(1.0, -bits_of(*current_bounding.formats, kind_of(T{})));
  }
  template <class T>
  static Bound rounded(Bound x) {
    if (current_bounding.formats != nullptr) x.error += unit<T>() / 2;
    return x;
  }
  template <Kind kind>
  static Bounded<kind> see(Bounded<kind> x) {
    current_bounding.ranges->see(kind, x.value.magnitude() + x.value.error);
    return x;
  }
};

template <Kind kind>
Bounded<kind> limit(Bounded<kind> x, Bounded<kind> lower, Bounded<kind> upper, Saturations&) {
  Bound out = x.value.cut(lower.value.low, upper.value.high);
  out.error = std::fmin(out.error, upper.value.high - lower.value.low);
  return {out};
}

// ---- the functions of math.hpp with their stated errors --------------------------------------------------------

namespace detail {
inline bool rounding() { return current_bounding.formats != nullptr; }
/// Range of the sine over [low, high].
inline Bound sine_range(double low, double high) {
  const double turn = 2 * raw::pi;
  if (!(high - low < turn)) return {-1, 1, 0};
  const auto holds = [&](double x) { return std::ceil((low - x) / turn) * turn + x <= high; };
  return {holds(-raw::pi / 2) ? -1 : std::fmin(std::sin(low), std::sin(high)),
          holds(raw::pi / 2) ? 1 : std::fmax(std::sin(low), std::sin(high)), 0};
}
inline SineCosine<BoundedNumbers::Of<Quantity::unit>> sine_cosine(Bound angle, double own_error) {
  Bound sine = sine_range(angle.low, angle.high);
  Bound cosine = sine_range(angle.low + raw::pi / 2, angle.high + raw::pi / 2);
  if (rounding()) sine.error = cosine.error = std::fmin(2.0, angle.error + own_error);
  return {{sine}, {cosine}};
}
}  // namespace detail

template <Kind kind>
SineCosine<BoundedNumbers::Of<Quantity::unit>> sin_cos(Bounded<kind> q) {
  return detail::sine_cosine(q.value, 4e-9 + 1.1e-10 * q.value.magnitude());
}
inline SineCosine<BoundedNumbers::Of<Quantity::unit>> sin_cos_turns(BoundedWide turns) {
  const double scale = 2 * raw::pi;
  return detail::sine_cosine({scale * turns.value.low, scale * turns.value.high, scale * turns.value.error}, 4e-9);
}
inline BoundedNumbers::Of<Quantity::unit> tanh_of(BoundedNumbers::Of<Quantity::argument> x) {
  Bound out{std::tanh(x.value.low), std::tanh(x.value.high), 0};
  if (detail::rounding()) out.error = BoundedNumbers::steepest<TanhNodes>(x.value) * x.value.error + 1.5e-6;
  return {out};
}
inline BoundedNumbers::Of<Quantity::unit> exp_negative(BoundedNumbers::Of<Quantity::argument> x) {
  Bound out{std::exp(-std::fmax(0.0, x.value.high)), std::exp(-std::fmax(0.0, x.value.low)), 0};
  if (detail::rounding()) {
    const double end = std::ldexp(1.0, 31 - argument_bits);
    out.error = std::exp(-std::fmax(0.0, x.value.low - x.value.error)) * x.value.error + 1.4e-9;
    if (x.value.high + x.value.error > end) out.error += std::exp(-end);  // fixed point goes no further
  }
  return {out};
}
/// Not as exp_negative() of the square: the square's error is large where the curve is flat.
template <>
inline BoundedNumbers::Of<Quantity::unit> bell_of<BoundedNumbers>(BoundedNumbers::Of<Quantity::argument> x) {
  constexpr double steepest = 0.858;  // of exp(-x^2), at x = 1 / sqrt(2)
  const bool zero = x.value.low <= 0 && x.value.high >= 0;
  const double nearest = zero ? 0 : std::fmin(std::fabs(x.value.low), std::fabs(x.value.high));
  const double farthest = x.value.magnitude();
  Bound out{std::exp(-farthest * farthest), std::exp(-nearest * nearest), 0};
  if (detail::rounding()) {
    out.error = steepest * x.value.error + std::ldexp(0.5, -argument_bits) + 1.4e-9;
    const double end = std::ldexp(1.0, 31 - argument_bits);
    if (square(farthest + x.value.error) > end) out.error += std::exp(-end);  // fixed point goes no further
  }
  return {out};
}
inline BoundedNumbers::Of<Quantity::argument> asinh_of(BoundedNumbers::Of<Quantity::ratio> x) {
  Bound out{std::asinh(x.value.low), std::asinh(x.value.high), 0};
  if (detail::rounding()) {
    const double end = std::ldexp(1.0, 31 - ratio_bits);
    out.error = x.value.error + 7e-6 + std::fmax(0.0, std::asinh(x.value.magnitude()) - std::asinh(end));
  }
  return {out};
}
template <Kind kind>
Bounded<kind> magnitude(Bounded<kind> x) {
  const bool zero = x.value.low <= 0 && x.value.high >= 0;
  return {{zero ? 0 : std::fmin(std::fabs(x.value.low), std::fabs(x.value.high)), x.value.magnitude(), x.value.error}};
}
template <Kind kind>
BoundedNumbers::Of<Quantity::unit> sign_of(Bounded<kind> x) {
  const bool touches = x.value.low - x.value.error <= 0 && x.value.high + x.value.error >= 0;
  return {{sign_of(x.value.low), sign_of(x.value.high), touches && x.value.error > 0 ? 2.0 : 0.0}};
}
template <Kind kind>
Bounded<kind> signed_as(Bounded<kind> size, BoundedWide x) {
  const Bound v = size.value;
  Bound out = x.value.low >= 0 ? v : x.value.high < 0 ? -v : Bound::hull(v, -v);
  const bool touches = x.value.low - x.value.error < 0 && x.value.high + x.value.error >= 0;
  if (touches && x.value.error > 0) out.error += 2 * v.magnitude();
  return {out};
}
inline BoundedWide half_of(BoundedWide x) { return {{x.value.low / 2, x.value.high / 2, x.value.error / 2}}; }
inline BoundedNumbers::Of<Quantity::ratio> reciprocal_of(BoundedNumbers::Of<Quantity::unit> x) {
  Bound out{reciprocal_of(x.value.high), reciprocal_of(x.value.low), 0};
  if (detail::rounding()) out.error = x.value.error * out.high * out.high + 6e-8;
  return {out};
}
template <Kind kind>
Bounded<kind> clipping(Bounded<kind> x, Bounded<kind> limit) {
  return {{clipping(x.value.high, limit.value.low), clipping(x.value.low, limit.value.low),
           x.value.error + limit.value.error}};
}
/// A spring adds up the errors of its way until it is full, which both springs are then: at most 2 / |moved| ticks. One
/// that creeps is full after creeping_ticks at the latest.
inline BoundedNumbers::Of<Quantity::unit> slip(BoundedNumbers::Of<Quantity::unit> z,
                                               BoundedNumbers::Of<Quantity::unit> moved) {
  const Bound &state = z.value, &way = moved.value;
  Bound out = Bound{state.low + way.low, state.high + way.high, 0}.cut(-1, 1);
  if (!detail::rounding()) return {out};
  const bool turns = way.low <= 0 && way.high >= 0;
  const double slowest = turns ? 0 : std::fmin(std::fabs(way.low), std::fabs(way.high));
  const bool creeps = slowest < 2 / creeping_ticks;
  out.error = std::fmax(state.error, way.error * (creeps ? creeping_ticks : 2 / slowest + 1));
  if (creeps && current_bounding.creeps) out.error = state.error + way.error * creeping_ticks;
  out.error = std::fmin(out.error + std::ldexp(1.0, -unit_bits), 2.0);  // fixed point is full one unit below 1
  return {out};
}
/// Fixed point saturates at 2, where any spring is full.
inline BoundedNumbers::Of<Quantity::unit> doubled(BoundedNumbers::Of<Quantity::unit> x) {
  return {{2 * x.value.low, 2 * x.value.high, 2 * x.value.error}};
}
inline WholeAndRest<BoundedNumbers::Of<Quantity::unit>> split_count(BoundedNumbers::Of<Quantity::count> x) {
  const auto parts = split_count(x.value.low);  // a parameter: one value
  return {parts.whole, {{parts.rest, parts.rest, x.value.error}}};
}

/// A free curve over an interval: weights are not negative (but by rounding) and always add up to 3/2, so the curve is
/// between 3/2 of the least and of the largest height whose bump reaches the interval. It is no steeper than 3/2 of the
/// largest difference between neighbours a knot distance.
template <>
struct Curve<BoundedNumbers> {
  Bound x{}, factor{1, 1, 0};
  bool multiplied = false;

  static Curve at(BoundedNumbers::Of<Quantity::argument> place) {
    Bound x = place.value.cut(0, static_cast<double>(curve_pieces));
    x.error = std::fmin(x.error, static_cast<double>(curve_pieces));
    return {x};
  }
  Curve times(BoundedNumbers::Of<Quantity::unit> by) const { return {x, by.value, true}; }
  template <class Emit>
  void each(Emit&& emit) const {
    for (std::size_t i = 0; i < curve_heights; ++i)
      emit(as<Quantity::unit>, i, BoundedNumbers::Of<Quantity::unit>{scaled(bump(static_cast<double>(i) - 1), 1)});
  }
  BoundedWide sum(Words<BoundedNumbers> heights) const {
    const auto last_piece = static_cast<double>(curve_pieces - 1);
    const auto piece = [&](double at) { return static_cast<std::size_t>(std::fmin(std::floor(at), last_piece)); };
    const std::size_t from = piece(x.low), to = piece(x.high) + 3;
    const auto height = [&](std::size_t i) { return heights.coefficient<Quantity::unit>(i).value; };
    Bound all = height(from);
    double largest = 0, steepest = 0;
    for (std::size_t i = 0; i < curve_heights; ++i) {
      if (i >= from && i <= to) all = Bound::hull(all, height(i));
      largest = std::fmax(largest, height(i).magnitude() + height(i).error);
      if (i > 0) steepest = std::fmax(steepest, (height(i) - height(i - 1)).magnitude());
    }
    const Bound out{1.5 * all.low, 1.5 * all.high,
                    1.5 * all.error + 1.5 * steepest * x.error + 4 * own_error() * largest};
    return {scaled(out, 4 * largest)};
  }

 private:
  /// Of a weight, beside that of x.
  static double own_error() { return detail::rounding() ? std::ldexp(3.0, -unit_bits) : 0; }
  /// @param roundings how much a unit of the narrowed products matters
  Bound scaled(Bound value, double roundings) const {
    if (!multiplied) return value;
    Bound out = value * factor;
    if (detail::rounding()) out.error += std::ldexp(0.5, -unit_bits) * roundings;
    return out;
  }
  Bound bump(double middle) const {
    const auto at = [](double d) {
      if (d >= 2) return 0.0;
      return d >= 1 ? (2 - d) * (2 - d) * (2 - d) / 4 : 1 - d * d * (1.5 - 0.75 * d);
    };
    const double a = x.low - middle, b = x.high - middle;
    const double nearest = a <= 0 && b >= 0 ? 0 : std::fmin(std::fabs(a), std::fabs(b));
    return {at(std::fmax(std::fabs(a), std::fabs(b))), at(nearest), x.error + own_error()};  // the steepest slope is 1
  }
};

}  // namespace fxdyn
