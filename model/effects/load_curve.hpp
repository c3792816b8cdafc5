#pragma once

#include "model/effects/curve.hpp"

namespace fxdyn {

/// A torque over the load that has no name: the rigid-body torque of the tick, through a gear whose losses or sensor
/// whose line is bent. tau = curve(structural), a cubic B-spline (model/effects/curve.hpp) between from and from +
/// span, constant beyond. Joint side of the gearbox.
struct LoadCurve {
  static constexpr std::string_view name = "load_curve";
  static constexpr std::string_view equation = "curve(structural)";
  static constexpr bool needs_structural = true;
  static constexpr EffectTraits traits{.words = "a torque that depends on the load, of no known form",
                                       .experiments = {experiments::loaded_poses},
                                       .curve = true};
  static constexpr std::array shape = curve_shape("N*m", "N", 1e6, Quantity::torque, Quantity::inverse_torque,
                                                  shapes::curve_load_from, shapes::curve_load_span);
  static constexpr std::array linear = curve_linear();
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) { return stored_curve_shape(i, value); }

  template <class N>
  static constexpr Curve<N> curve(const JointInput<N>& u, Words<N> words) {
    return Curve<N>::at(place_on_curve<N, Quantity::torque, Quantity::inverse_torque>(u.structural, words));
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
