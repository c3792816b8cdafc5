#pragma once

#include "model/effects/curve.hpp"

namespace fxdyn {

/// A torque over the joint's velocity that has no name. tau = curve(dq), a cubic B-spline (model/effects/curve.hpp)
/// between from and from + span, constant beyond. Joint side of the gearbox.
struct VelocityCurve {
  static constexpr std::string_view name = "velocity_curve";
  static constexpr std::string_view equation = "curve(dq)";
  static constexpr EffectTraits traits{.words = "friction that depends on the velocity, of no known form",
                                       .experiments = {experiments::constant_speeds},
                                       .friction = true,
                                       .curve = true};
  static constexpr std::array shape = curve_shape("rad/s", "m/s", 1e3, Quantity::velocity, Quantity::inverse_velocity,
                                                  shapes::curve_velocity_from, shapes::curve_velocity_span);
  static constexpr std::array linear = curve_linear();
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) { return stored_curve_shape(i, value); }

  template <class N>
  static constexpr Curve<N> curve(const JointInput<N>& u, Words<N> words) {
    return Curve<N>::at(place_on_curve<N, Quantity::velocity, Quantity::inverse_velocity>(u.dq, words));
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
