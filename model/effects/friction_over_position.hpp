#pragma once

#include "model/effects/curve.hpp"

namespace fxdyn {

/// Dry friction that is not the same everywhere: a tight spot, a worn stretch. tau = curve(q) s with the joint's sign
/// s, a cubic B-spline (model/effects/curve.hpp) between from and from + span, constant beyond. Joint side of the
/// gearbox.
struct FrictionOverPosition {
  static constexpr std::string_view name = "friction_over_position";
  static constexpr std::string_view equation = "curve(q) s";
  static constexpr EffectTraits traits{.words = "dry friction that depends on the position: a tight spot",
                                       .experiments = {experiments::wide_range, experiments::slow_reversals},
                                       .friction = true,
                                       .curve = true};
  static constexpr std::array shape = curve_shape("rad", "m", 1e3, Quantity::position, Quantity::inverse_position,
                                                  shapes::curve_from, shapes::curve_span);
  static constexpr std::array linear = curve_linear();
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) { return stored_curve_shape(i, value); }

  template <class N>
  static constexpr Curve<N> curve(const JointInput<N>& u, Words<N> words) {
    return Curve<N>::at(place_on_curve<N, Quantity::position, Quantity::inverse_position>(u.q, words)).times(u.sign);
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
