#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Stribeck effect: friction above Coulomb's at low speed, tau = amplitude * s * exp(-(dq / velocity)^2) with
/// s = tanh(dq / width) of the joint. Paper Eq. 21 (its tau_s - tau_c is the amplitude). Joint side of the gearbox.
struct Stribeck {
  static constexpr std::string_view name = "stribeck";
  static constexpr std::string_view equation = "amplitude s exp(-(dq / velocity)^2)";
  static constexpr EffectTraits traits{.words = "friction that is higher at very low speed",
                                       .experiments = {experiments::small_reversals},
                                       .friction = true,
                                       .identified = 4,
                                       .turns_with_sign = TurnsWithSign::amplitude};
  static constexpr std::array shape{ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity,
                                                  "Han, Wu, Hui 2025, Eq. 21", shapes::velocity_beyond_sign}};
  static constexpr std::array linear{
      ParameterInfo{"amplitude", "N*m", "N", 0, unbounded, Quantity::unit, "Han, Wu, Hui 2025, Eq. 21"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double velocity, double) { return 1 / velocity; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto ratio = N::template clamp<Argument<N>>(u.dq * words.template number<Quantity::inverse_velocity>(0));
    const auto bump = bell_of<N>(ratio);
    emit(as<Quantity::unit>, 0, N::template proven_narrow<Unit<N>>(u.sign * bump));
  }
};

}  // namespace fxdyn
