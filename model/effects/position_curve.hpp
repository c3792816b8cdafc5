#pragma once

#include "model/effects/curve.hpp"

namespace fxdyn {

/// A torque over the joint's position that has no name: a cable that pulls, a cover that presses. tau = curve(q), a
/// cubic B-spline (model/effects/curve.hpp) between from and from + span, constant beyond. Joint side of the gearbox.
struct PositionCurve {
  static constexpr std::string_view name = "position_curve";
  static constexpr std::string_view equation = "curve(q)";
  static constexpr EffectTraits traits{.words = "a torque that depends on the position, of no known form",
                                       .experiments = {experiments::wide_range, experiments::wide_range_or_baseline},
                                       .curve = true};
  static constexpr std::array shape = curve_shape("rad", "m", 1e3, Quantity::position, Quantity::inverse_position,
                                                  shapes::curve_from, shapes::curve_span);
  static constexpr std::array linear = curve_linear();
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) { return stored_curve_shape(i, value); }

  template <class N>
  static constexpr Curve<N> curve(const JointInput<N>& u, Words<N> words) {
    return Curve<N>::at(place_on_curve<N, Quantity::position, Quantity::inverse_position>(u.q, words));
  }
  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    curve<N>(u, words).each(emit);
  }
  template <class N>
  static constexpr auto sum(const JointInput<N>& u, Words<N> words, NoState&, Saturations&) {
    return curve<N>(u, words).sum({words.data + shape.size()});
  }
};

}  // namespace fxdyn
