#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Play of the gear, delta = half_gap * tanh(structural / torque_scale): the link lies against the flank that the load
/// pushes it to, and crosses the gap as the load changes sign. Acts on the position: the link is at q - delta. Link
/// side of the gearbox, in its angle.
struct Backlash {
  static constexpr std::string_view name = "backlash";
  static constexpr std::string_view equation = "delta = half_gap tanh(structural / torque_scale)";
  static constexpr ActsOn acts_on = ActsOn::position;
  static constexpr bool needs_structural = true;
  static constexpr EffectTraits traits{.words = "play of the gear: the link is free over a small gap",
                                       .experiments = {experiments::load_reversals, experiments::fast_motion}};
  static constexpr std::array shape{ParameterInfo{"torque_scale", "N*m", "N", 1e-3, 1e5, Quantity::inverse_torque,
                                                  "Nordin, Gutman 2002 (backlash, smoothed)", shapes::small_load}};
  static constexpr std::array linear{
      ParameterInfo{"half_gap", "rad", "m", 0, 0.1, Quantity::unit, "Nordin, Gutman 2002 (backlash, smoothed)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double torque_scale, double) { return 1 / torque_scale; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto ratio = u.structural * words.template number<Quantity::inverse_torque>(0);
    emit(as<Quantity::unit>, 0, tanh_of(N::template clamp<Argument<N>>(ratio)));
  }
};

}  // namespace fxdyn
