#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Soft knee of dry friction: a part that reaches its full value only at higher speed, tau = amplitude
/// tanh(dq / velocity), beside Coulomb's friction with its narrower sign. Both together are two of the three terms of
/// Makkar, Dixon, Sawyer and Hu; amplitudes of at least 0 always brake. Joint side of the gearbox.
struct SoftKnee {
  static constexpr std::string_view name = "soft_knee";
  static constexpr std::string_view equation = "amplitude tanh(dq / velocity)";
  static constexpr EffectTraits traits{.words = "dry friction of which a part is reached only at some speed",
                                       .experiments = {experiments::slow_reversals, experiments::constant_speeds},
                                       .friction = true,
                                       .turns_with_sign = TurnsWithSign::amplitude};
  static constexpr std::array shape{ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity,
                                                  "Makkar, Dixon, Sawyer, Hu 2005, Eq. 1",
                                                  shapes::velocity_beyond_sign}};
  static constexpr std::array linear{
      ParameterInfo{"amplitude", "N*m", "N", 0, unbounded, Quantity::unit, "Makkar, Dixon, Sawyer, Hu 2005, Eq. 1"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double velocity, double) { return 1 / velocity; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto ratio = u.dq * words.template number<Quantity::inverse_velocity>(0);
    emit(as<Quantity::unit>, 0, tanh_of(N::template clamp<Argument<N>>(ratio)));
  }
};

}  // namespace fxdyn
