#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

// What the effects of a free curve have in common: the curve itself, and what they declare.

namespace fxdyn {

inline constexpr std::size_t curve_heights = 12;
inline constexpr std::size_t curve_pieces = curve_heights - 3;

/// A uniform cubic B-spline over x in knot distances from the first knot, 0 .. curve_pieces; constant beyond both ends:
///   curve(x) = sum_i height_i bump(x + 1 - i), i = 0 .. curve_heights - 1,
///   bump(d) = 1 - 3/2 d^2 + 3/4 |d|^3 for |d| <= 1, (2 - |d|)^3 / 4 for 1 <= |d| <= 2, else 0.
/// A bump is 1 at its middle and 1/4 at both knots beside it, so that equal heights give 1.5 of them. Twice
/// continuously differentiable within its ends. The basis is that of de Boor 1978 (A Practical Guide to Splines), times
/// 3/2. Four bumps are not zero at a time: `sum` multiplies those and no others, `each` emits all. Both give the same
/// bits.
template <class N>
struct Curve {
  std::uint32_t first = 0;           ///< bump that `weights` begin with
  std::array<Unit<N>, 4> weights{};  ///< of this and the next ones; |error| < 3e-9 in fixed point

  /// The four bumps at x from a knot to the next, of two products alone: with
  ///   foot = x^3 / 4, bend = 3/4 (x - x^2),
  ///   bump(2 - x) = foot, bump(1 - x) = 5/4 - bump(x) + bend, bump(x) = 1 - 3/2 x^2 + 3 foot,
  ///   bump(1 + x) = 1/4 - bend - foot.
  static constexpr Curve at(Argument<N> argument) {
    const auto place = split_argument(argument, static_cast<std::uint32_t>(curve_pieces - 1));
    const Unit<N> x = place.rest, one = N::one();
    const Unit<N> quarter = narrow(half_of(half_of(one + Unit<N>{})));
    const Unit<N> square = narrow(x * x);
    const Unit<N> foot = narrow(half_of(half_of(square * x)));
    const Unit<N> fallen = narrow(x - square);
    const Unit<N> bend = narrow(fallen - narrow(half_of(half_of(fallen + Unit<N>{}))));
    const Unit<N> half = narrow(half_of(square + Unit<N>{}));
    const Unit<N> thrice = narrow(foot + narrow(foot + foot));
    const Unit<N> near = narrow(narrow(one - square) + narrow(thrice - half));
    const Unit<N> far = narrow(narrow(one - near) + narrow(quarter + bend));
    const Unit<N> left = narrow(narrow(quarter - bend) - foot);
    return {place.whole, {left, near, far, foot}};
  }
  /// Every bump times `factor`.
  [[gnu::always_inline]] constexpr Curve times(Unit<N> factor) const {
    const auto by = [&](Unit<N> weight) { return N::template proven_narrow<Unit<N>>(weight * factor); };
    return {first, {by(weights[0]), by(weights[1]), by(weights[2]), by(weights[3])}};
  }
  template <class Emit>
  constexpr void each(Emit&& emit) const {
    for (std::size_t i = 0; i < curve_heights; ++i) {
      const bool there = i >= first && i < first + weights.size();
      emit(as<Quantity::unit>, i, there ? weights[i - first] : Unit<N>{});
    }
  }
  [[gnu::always_inline]] constexpr typename N::TorqueSum sum(Words<N> heights) const {
    // no loop and no call: compilers would put the weights into memory for it
    const auto term = [&](std::size_t k) {
      return heights.template coefficient<Quantity::unit>(first + k) * weights[k];
    };
    return term(0) + term(1) + term(2) + term(3);
  }

 private:
  template <class W>
  static constexpr Unit<N> narrow(W w) {
    return N::template proven_narrow<Unit<N>>(w);
  }
};

/// Where `x` is on a curve whose shape parameters are `from` (a number of `quantity`) and `span` (stored as twice the
/// reciprocal of a knot distance). Half the difference is no larger than the larger of the two, so no format has to
/// hold more than those.
template <class N, Quantity quantity, Quantity inverse>
[[gnu::always_inline]] constexpr Argument<N> place_on_curve(typename N::template Of<quantity> x, Words<N> words) {
  const auto half = half_of(x - words.template number<quantity>(0));
  const auto from_start = N::template proven_narrow<typename N::template Of<quantity>>(half);
  return N::template clamp<Argument<N>>(from_start * words.template number<inverse>(1));
}
constexpr double stored_curve_shape(std::size_t i, double value) {
  return i == 0 ? value : 2 * static_cast<double>(curve_pieces) / value;
}

/// Knots are chosen by the data (host_tools/diagnose): these are where the first is and how far the last is from it.
constexpr std::array<ParameterInfo, 2> curve_shape(std::string_view unit, std::string_view unit_prismatic,
                                                   double largest, Quantity quantity, Quantity inverse,
                                                   ShapeValues from, ShapeValues span) {
  constexpr std::string_view source = "de Boor 1978 (uniform knots)";
  return {ParameterInfo{"from", unit, unit_prismatic, -largest, largest, quantity, source, from},
          ParameterInfo{"span", unit, unit_prismatic, 1e-4, largest, inverse, source, span}};
}
constexpr std::array<ParameterInfo, curve_heights> curve_linear() {
  constexpr std::array<std::string_view, curve_heights> names{"height_1", "height_2",  "height_3",  "height_4",
                                                              "height_5", "height_6",  "height_7",  "height_8",
                                                              "height_9", "height_10", "height_11", "height_12"};
  std::array<ParameterInfo, curve_heights> all{};
  for (std::size_t i = 0; i < curve_heights; ++i)
    all[i] = {names[i], "N*m", "N", -unbounded, unbounded, Quantity::unit, "de Boor 1978", {}};
  return all;
}

}  // namespace fxdyn
